"""The arrowhead system: six unknowns of the root, and five independent fingers of four.

Every finger is factored on its active face; what is left is a Schur complement of the root (24).
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.linear_algebra import ldl4
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    FINGERS,
    FLEXION,
    GRADIENT,
    HINGE_1,
    HINGE_2,
    LANES,
    ROOT,
    SHIFT,
)

# a pivot below this share of Gauss-Newton's diagonal is lifted to it
SOUND_PIVOT = 0.05
# [m^2] keeps what nothing observes in place
PIVOT_FLOOR = 1e-10
# the column of the root's system that holds the least sound pivots
LEAST = GRADIENT + 1
_ANY = (-math.inf, -math.inf, -math.inf, -math.inf)


@inline
def lift_pivots(w, share):
    """Make every finger's Hessian positive definite by raising its diagonal, if need be.

    (22) In L D L^T from flexion to the tip a pivot ends up no smaller than `share` of
    Gauss-Newton's diagonal; the tip's pivot, given all others, is the weak one.
    """
    h = w.hessian
    for f in range(LANES):
        upper = (
            (h[0, 0, f], h[0, 1, f], h[0, 2, f], h[0, 3, f]),
            (h[1, 1, f], h[1, 2, f], h[1, 3, f]),
            (h[2, 2, f], h[2, 3, f]),
            h[3, 3, f],
        )
        least = (
            share * w.diagonal[0, f] + PIVOT_FLOOR,
            share * w.diagonal[1, f] + PIVOT_FLOOR,
            share * w.diagonal[2, f] + PIVOT_FLOOR,
            share * w.diagonal[3, f] + PIVOT_FLOOR,
        )
        pivots, found, _ = ldl4(upper, least)
        for a in range(ANGLES):
            h[a, a, f] += pivots[a] - found[a]


@inline
def face_hessian(w, f):
    """(23) A finger's Hessian in the directions of its face, upper triangle.

    The saddle is turned to the boundary's normal and tangent; what is held drops out, with one
    on the diagonal.
    """
    h = w.hessian
    m0, m1, m2, m3 = w.free[0, f], w.free[1, f], w.free[2, f], w.free[3, f]
    c, n = w.normal[0, f], w.normal[1, f]
    zz, zy, yy = h[0, 0, f], h[0, 1, f], h[1, 1, f]
    z2, z3, y2, y3 = h[0, 2, f], h[0, 3, f], h[1, 2, f], h[1, 3, f]
    normal = c * c * zz + 2.0 * c * n * zy + n * n * yy
    both = (c * c - n * n) * zy + c * n * (yy - zz)
    tangent = n * n * zz - 2.0 * c * n * zy + c * c * yy + w.curvature[f]
    return (
        (
            normal * m0 + (1.0 - m0),
            both * m0 * m1,
            (c * z2 + n * y2) * m0 * m2,
            (c * z3 + n * y3) * m0 * m3,
        ),
        (
            tangent * m1 + (1.0 - m1),
            (c * y2 - n * z2) * m1 * m2,
            (c * y3 - n * z3) * m1 * m3,
        ),
        (h[2, 2, f] * m2 + (1.0 - m2), h[2, 3, f] * m2 * m3),
        h[3, 3, f] * m3 + (1.0 - m3),
    )


@inline
def factor_faces(w):
    """L D L^T of every finger's Hessian on its active face, and its rows through L^-1."""
    for f in range(LANES):
        pivots, _, (l0, l1, l2) = ldl4(face_hessian(w, f), _ANY)
        for a in range(ANGLES):
            w.pivot[a, f] = 1.0 / pivots[a]
        w.factor[1, 0, f], w.factor[2, 0, f], w.factor[3, 0, f] = l0
        w.factor[2, 1, f], w.factor[3, 1, f] = l1
        w.factor[3, 2, f] = l2
    for f in range(LANES):
        m0, m1, m2, m3 = w.free[0, f], w.free[1, f], w.free[2, f], w.free[3, f]
        c, n = w.normal[0, f], w.normal[1, f]
        l10, l20, l30 = w.factor[1, 0, f], w.factor[2, 0, f], w.factor[3, 0, f]
        l21, l31, l32 = w.factor[2, 1, f], w.factor[3, 1, f], w.factor[3, 2, f]
        for i in range(ROOT + 1):
            z, y = w.row[FLEXION, i, f], w.row[ABDUCTION, i, f]
            v0, v1 = (c * z + n * y) * m0, (c * y - n * z) * m1
            v1 -= l10 * v0
            v2 = w.row[HINGE_1, i, f] * m2 - l20 * v0 - l21 * v1
            v3 = w.row[HINGE_2, i, f] * m3 - l30 * v0 - l31 * v1 - l32 * v2
            w.face_row[0, i, f], w.face_row[1, i, f] = v0, v1
            w.face_row[2, i, f], w.face_row[3, i, f] = v2, v3


@inline
def answer(w, v, f):
    """Angles x of finger f with L^T x = -D^-1 v, from the face's directions."""
    x3 = -v[3] * w.pivot[3, f]
    x2 = -v[2] * w.pivot[2, f] - w.factor[3, 2, f] * x3
    x1 = -v[1] * w.pivot[1, f] - w.factor[2, 1, f] * x2 - w.factor[3, 1, f] * x3
    x0 = -v[0] * w.pivot[0, f]
    x0 -= w.factor[1, 0, f] * x1 + w.factor[2, 0, f] * x2 + w.factor[3, 0, f] * x3
    c, n = w.normal[0, f], w.normal[1, f]
    return c * x0 - n * x1, n * x0 + c * x1, x2, x3


@inline
def move_along_faces(w, from_gradient):
    """(25) Every finger's answer -H^-1 (B rho + g) on its face to the root's change rho.

    From the gradient: the step itself; else the answer to rho alone is added to the step.
    """
    w.root_change[GRADIENT] = 1.0 if from_gradient else 0.0
    keep = 1.0 - w.root_change[GRADIENT]
    for f in range(LANES):
        v0 = v1 = v2 = v3 = 0.0
        for i in range(ROOT + 1):
            x = w.root_change[i]
            v0 += w.face_row[0, i, f] * x
            v1 += w.face_row[1, i, f] * x
            v2 += w.face_row[2, i, f] * x
            v3 += w.face_row[3, i, f] * x
        z, y, p, q = answer(w, (v0, v1, v2, v3), f)
        w.step[FLEXION, f] = keep * w.step[FLEXION, f] + z
        w.step[ABDUCTION, f] = keep * w.step[ABDUCTION, f] + y
        w.step[2, f] = keep * w.step[2, f] + p
        w.step[3, f] = keep * w.step[3, f] + q


@inline
def over_lanes(shares):
    """The sum of a field's (LANES,) entries: fingers and wrist."""
    total = 0.0
    for f in range(FINGERS + 1):
        total += shares[f]
    return total


@inline
def root_hessian(w):
    """The root's own 6 x 6 Hessian and gradient, in `system`, with the least sound pivots (11)."""
    for i in range(3):
        for j in range(i, 3):
            h = over_lanes(w.root_moment[i, j])
            w.system[i, j] = w.system[j, i] = h
            w.system[SHIFT + i, SHIFT + j] = w.system[SHIFT + j, SHIFT + i] = 0.0
    weight = over_lanes(w.root_weight)
    for i in range(3):
        # sum_i w_i [x_i]x couples turn and shift
        x = over_lanes(w.root_lever[i])
        j, k = (i + 1) % 3, (i + 2) % 3
        w.system[i, SHIFT + i] = w.system[SHIFT + i, i] = 0.0
        w.system[j, SHIFT + k] = w.system[SHIFT + k, j] = -x
        w.system[k, SHIFT + j] = w.system[SHIFT + j, k] = x
        w.system[SHIFT + i, SHIFT + i] = weight
    for i in range(ROOT):
        w.system[i, GRADIENT] = over_lanes(w.root_gradient[i])
        w.system[i, LEAST] = 1e-3 * abs(w.system[i, i]) + 1e-12


@inline
def add_model_gradient(w):
    """Add to the root's gradient what the step so far, fingers and root, makes of it."""
    for i in range(ROOT):
        g = 0.0
        for j in range(ROOT):
            g += w.system[i, j] * w.root_step[j]
        for a in range(ANGLES):
            for f in range(FINGERS):
                g += w.row[a, i, f] * w.step[a, f]
        w.system[i, GRADIENT] += g
    # the fingers' own gradients are answered already
    for a in range(ANGLES):
        for f in range(LANES):
            w.face_row[a, GRADIENT, f] = 0.0


@inline
def eliminate_fingers(w):
    """(24) The Schur complement: take B^T H^-1 (B, g) of every finger from `system`."""
    for f in range(LANES):
        p0, p1, p2, p3 = w.pivot[0, f], w.pivot[1, f], w.pivot[2, f], w.pivot[3, f]
        for i in range(ROOT):
            v0, v1 = p0 * w.face_row[0, i, f], p1 * w.face_row[1, i, f]
            v2, v3 = p2 * w.face_row[2, i, f], p3 * w.face_row[3, i, f]
            for j in range(i, ROOT + 1):
                h = v0 * w.face_row[0, j, f] + v1 * w.face_row[1, j, f]
                h += v2 * w.face_row[2, j, f] + v3 * w.face_row[3, j, f]
                w.schur[i, j, f] = h
    for i in range(ROOT):
        for j in range(i, ROOT + 1):
            h = 0.0
            for f in range(FINGERS):
                h += w.schur[i, j, f]
            w.system[i, j] -= h
            if j < ROOT:
                w.system[j, i] = w.system[i, j]


@inline
def factor_root(w, share):
    """`system` into D L^T above its diagonal, with D on it; of the gradient L^-1 times it.

    Elimination in order, with pivots lifted to `share` of the least sound ones. Returns whether
    none was.
    """
    sound = True
    for k in range(ROOT):
        row = w.system[k]
        d = row[k]
        if not d >= share * row[LEAST]:
            sound = False
            d = share * row[LEAST]
        row[k] = d
        inverse = 1.0 / d
        for i in range(k + 1, ROOT):
            other, v = w.system[i], row[i] * inverse
            for j in range(i, ROOT + 1):
                other[j] -= v * row[j]
    return sound


@inline
def solve_root(w):
    """The root's change from `system`, in place; returns whether it has a minimum."""
    sound = factor_root(w, 1.0)
    for k in range(ROOT):
        i = ROOT - 1 - k
        row = w.system[i]
        v = -row[GRADIENT]
        for j in range(i + 1, ROOT):
            v -= row[j] * w.root_change[j]
        w.root_change[i] = v / row[i]
    return sound
