"""A camera's picture of a point, and its derivative, in compiled code."""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import add, dot, row, scale, sub

# nearer than this a point is not in front of a camera [m]
NEAR = 1e-3


@inline
def view(camera, p):
    """A world point's picture, and its derivative: in front or not, (u, v), two rows by world.

    The lens model is that of cameras.Camera.
    """
    r1, r2, r3 = row(camera.rotation, 0), row(camera.rotation, 1), row(camera.rotation, 2)
    t = camera.translation
    z = dot(r3, p) + t[2]
    if z < NEAR:
        return False, 0.0, 0.0, r1, r2
    a = (dot(r1, p) + t[0]) / z
    b = (dot(r2, p) + t[1]) / z
    bent = camera.distortion
    k1, k2, p1, p2, k3 = bent[0], bent[1], bent[2], bent[3], bent[4]
    k4, k5, k6 = bent[5], bent[6], bent[7]
    q = a * a + b * b
    top = 1.0 + q * (k1 + q * (k2 + q * k3))
    low = 1.0 + q * (k4 + q * (k5 + q * k6))
    radial = top / low
    # by q
    slope = (k1 + q * (2.0 * k2 + 3.0 * q * k3)) / low
    slope -= radial * (k4 + q * (2.0 * k5 + 3.0 * q * k6)) / low
    x = radial * a + 2.0 * p1 * a * b + p2 * (q + 2.0 * a * a)
    y = radial * b + p1 * (q + 2.0 * b * b) + 2.0 * p2 * a * b
    xa = radial + 2.0 * slope * a * a + 2.0 * p1 * b + 6.0 * p2 * a
    xb = 2.0 * slope * a * b + 2.0 * p1 * a + 2.0 * p2 * b
    yb = radial + 2.0 * slope * b * b + 6.0 * p1 * b + 2.0 * p2 * a
    fx, skew, fy = camera.fx, camera.skew, camera.fy
    ua, ub = (fx * xa + skew * xb) / z, (fx * xb + skew * yb) / z
    va, vb = fy * xb / z, fy * yb / z
    # a, b by the world: (r1 - a r3) / z, (r2 - b r3) / z
    da, db = sub(r1, scale(a, r3)), sub(r2, scale(b, r3))
    return (
        True,
        fx * x + skew * y + camera.cx,
        fy * y + camera.cy,
        add(scale(ua, da), scale(ub, db)),
        add(scale(va, da), scale(vb, db)),
    )
