"""A camera's picture of a point, and its derivative, in compiled code."""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import add, dot, scale, sub

# places in a camera's numbers (see cameras.Camera.numbers)
FX, SKEW, CX, FY, CY, K1, K2, P1, P2, K3, K4, K5, K6, ROTATION = range(14)
TRANSLATION = ROTATION + 9
# nearer than this a point is not in front of a camera [m]
NEAR = 1e-3


@inline
def view(camera, p):
    """A world point's picture, and its derivative: in front or not, (u, v), two rows by world.

    The lens model is that of cameras.Camera.
    """
    r = ROTATION
    r1 = (camera[r], camera[r + 1], camera[r + 2])
    r2 = (camera[r + 3], camera[r + 4], camera[r + 5])
    r3 = (camera[r + 6], camera[r + 7], camera[r + 8])
    z = dot(r3, p) + camera[TRANSLATION + 2]
    if z < NEAR:
        return False, 0.0, 0.0, r1, r2
    a = (dot(r1, p) + camera[TRANSLATION]) / z
    b = (dot(r2, p) + camera[TRANSLATION + 1]) / z
    k1, k2, k3 = camera[K1], camera[K2], camera[K3]
    k4, k5, k6 = camera[K4], camera[K5], camera[K6]
    p1, p2 = camera[P1], camera[P2]
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
    fx, skew, fy = camera[FX], camera[SKEW], camera[FY]
    ua, ub = (fx * xa + skew * xb) / z, (fx * xb + skew * yb) / z
    va, vb = fy * xb / z, fy * yb / z
    # a, b by the world: (r1 - a r3) / z, (r2 - b r3) / z
    da, db = sub(r1, scale(a, r3)), sub(r2, scale(b, r3))
    return (
        True,
        fx * x + skew * y + camera[CX],
        fy * y + camera[CY],
        add(scale(ua, da), scale(ub, db)),
        add(scale(va, da), scale(vb, db)),
    )
