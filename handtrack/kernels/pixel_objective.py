"""A camera's picture of a point, and what a pose costs in pictures.

(28) Half the objective is sum_c,k w rho(|pi_c(R x_k + t) - z_c,k|^2) / 2 [px^2], Huber's loss of
squared reprojection errors, plus half the squared distances of the angles from the expected ones
by their stiffness.
"""

from __future__ import annotations

import numpy as np

from handtrack.kernels.compiled import inline
from handtrack.kernels.joint_objective import loss_of
from handtrack.kernels.kinematics import place_fingers, place_marks
from handtrack.kernels.losses import HUBER
from handtrack.kernels.vectors import (
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    lane,
    matrix,
    part,
    row,
    scale,
    sub,
)
from handtrack.kernels.workspace import N_ANGLES, N_POSE, ROOT, SHIFT, TURN, WRIST

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


# a joint that falls behind a camera costs as much as being so far off [px^2]
BEHIND = 1e8
_JOINTS = 21


@inline
def finger_of(k):
    """Lane and place in it of joint k of 21."""
    return (WRIST, 0) if k == 0 else ((k - 1) // 4, (k - 1) % 4)


@inline
def weigh_pixels(w, seen):
    """Place the pose and weigh it: the objective.

    Args:
        seen: cameras (C,) LENS, pixels (C, 21, 2), weights (C, 21), the square of the distance at
            which the loss bends [px^2] or 0, expected angles (20,), stiffness (20,).
    """
    cameras, pixels, weights, spread2, prior, stiffness = seen
    place_fingers(w)
    place_marks(w)
    total = 0.0
    r, t = matrix(w.rotation), part(w.translation, 0)
    for k in range(_JOINTS):
        f, j = finger_of(k)
        p = add(apply(r, lane(w.mark, j, f)), t)
        for c in range(len(cameras)):
            weight = weights[c, k]
            if weight > 0.0:
                there, u, v, _, _ = view(cameras[c], p)
                q = (u - pixels[c, k, 0]) ** 2 + (v - pixels[c, k, 1]) ** 2 if there else BEHIND
                if spread2 > 0.0:
                    q, _ = loss_of(HUBER, q, spread2)
                total += weight * q
    for i in range(N_ANGLES):
        total += stiffness[i] * (w.angle[i % 4, i // 4] - prior[i]) ** 2
    return total


@inline
def picture_rows(w, f, j, du, dv, rows):
    """How the unknowns that move a joint move its picture, in rows (2, 10); how many angles do.

    (29) By an angle du . (u_a x (x - p_a)); by the root's turn x x du, by its shift du; du and dv
    are in the root frame.
    """
    x = lane(w.mark, j, f)
    n = 0 if j == 0 else 1 + j
    for a in range(n):
        arm = cross(lane(w.axis, a, f), sub(x, lane(w.joint, max(a - 1, 0), f)))
        rows[0, a], rows[1, a] = dot(du, arm), dot(dv, arm)
    by_u, by_v = cross(x, du), cross(x, dv)
    for i in range(3):
        rows[0, n + TURN + i], rows[1, n + TURN + i] = by_u[i], by_v[i]
        rows[0, n + SHIFT + i], rows[1, n + SHIFT + i] = du[i], dv[i]
    return n


@inline
def add_picture(rows, first, n, weight, ru, rv, g, h):
    """Add one picture's residual (ru, rv) to gradient and Hessian; angles begin at `first`."""
    for i in range(n + ROOT):
        by_u, by_v = weight * rows[0, i], weight * rows[1, i]
        a = first + i if i < n else N_ANGLES + i - n
        g[a] += by_u * ru + by_v * rv
        for j in range(i + 1):
            b = first + j if j < n else N_ANGLES + j - n
            h[a, b] += by_u * rows[0, j] + by_v * rows[1, j]


@inline
def differentiate_pixels(w, seen, g, h):
    """Gradient and Gauss-Newton Hessian of half the objective, by angles, omega and v."""
    cameras, pixels, weights, spread2, prior, stiffness = seen
    for i in range(N_POSE):
        g[i] = 0.0
        for j in range(N_POSE):
            h[i, j] = 0.0
    rows = np.empty((2, 10))
    r, t = matrix(w.rotation), part(w.translation, 0)
    for k in range(_JOINTS):
        f, j = finger_of(k)
        p = add(apply(r, lane(w.mark, j, f)), t)
        for c in range(len(cameras)):
            weight = weights[c, k]
            if not weight > 0.0:
                continue
            there, u, v, du, dv = view(cameras[c], p)
            if not there:
                continue
            ru, rv = u - pixels[c, k, 0], v - pixels[c, k, 1]
            if spread2 > 0.0:
                _, slope = loss_of(HUBER, ru * ru + rv * rv, spread2)
                weight *= slope
            n = picture_rows(w, f, j, apply_transposed(r, du), apply_transposed(r, dv), rows)
            add_picture(rows, 4 * f, n, weight, ru, rv, g, h)
    for i in range(N_ANGLES):
        g[i] += stiffness[i] * (w.angle[i % 4, i // 4] - prior[i])
        h[i, i] += stiffness[i]
    for i in range(N_POSE):
        for j in range(i):
            h[j, i] = h[i, j]
