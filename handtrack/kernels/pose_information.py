"""What a frame's joints say of a pose: gradient and Hessian, and what is known by them.

(27) The inverse of the arrowhead is a sum of outer products: every unknown has six numbers from
the root (`shared`), and an angle four more from its own finger (`own`).
"""

from __future__ import annotations

import math

from handtrack.kernels.arrowhead import (
    answer,
    eliminate_fingers,
    factor_faces,
    factor_root,
    lift_pivots,
    root_hessian,
)
from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.derivatives import differentiate
from handtrack.kernels.faces import guess_faces
from handtrack.kernels.joint_objective import place
from handtrack.kernels.vectors import apply, column, matrix, part, put_column, put_part
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    FINGERS,
    FLEXION,
    GRADIENT,
    HINGE_1,
    HINGE_2,
    LANES,
    N_ANGLES,
    N_POSE,
    ROOT,
    SHIFT,
    TURN,
)


@inline
def assemble(w, g, h):
    """Gradient (26,) and Hessian (26, 26) from their parts in the workspace.

    Order: angles, then the fitter's own unknowns of the root, a turn and a shift in its frame.
    The workspace is as `differentiate` and `root_hessian` leave it.
    """
    for i in range(N_ANGLES):
        for j in range(N_ANGLES):
            h[i, j] = 0.0
    for f in range(FINGERS):
        k = 4 * f
        for a in range(ANGLES):
            g[k + a] = w.row[a, GRADIENT, f]
            for b in range(ANGLES):
                h[k + a, k + b] = w.hessian[a, b, f]
            for j in range(ROOT):
                h[k + a, N_ANGLES + j] = h[N_ANGLES + j, k + a] = w.row[a, j, f]
    for i in range(ROOT):
        g[N_ANGLES + i] = w.system[i, GRADIENT]
        for j in range(ROOT):
            h[N_ANGLES + i, N_ANGLES + j] = w.system[i, j]


@inline
def turn_to_world(r, g, h):
    """The root's own part of a gradient and a Hessian: from its frame to the world."""
    for k in (N_ANGLES + TURN, N_ANGLES + SHIFT):
        put_part(g, k, apply(r, part(g, k)))
        for j in range(N_POSE):
            put_column(h[k : k + 3], j, apply(r, column(h[k : k + 3], j)))
    for k in (N_ANGLES + TURN, N_ANGLES + SHIFT):
        for i in range(N_POSE):
            put_part(h[i], k, apply(r, part(h[i], k)))


@Solver
def information(w):
    """Objective, and gradient and Gauss-Newton Hessian of its half, at the pose in the workspace.

    Order and frame are a pose's: angles, a turn of the world on the left of the rotation,
    translation. Sets `objective`; and, where `full` is not 0, `gradient` and `information`.
    """
    w.objective = place(w)
    if w.full:
        differentiate(w, 0.0)
        root_hessian(w)
        assemble(w, w.gradient, w.information)
        turn_to_world(matrix(w.rotation), w.gradient, w.information)


# variance at unit noise that stands for "not observed" [rad^2/m^2]
_UNSEEN = 1e7


@inline
def share_root(w):
    """`shared`: what the root's six unknowns make of each unknown.

    Through the root's L^-1, and over the pivots' roots. An angle answers them by -H^-1 B; the
    root's own are turned into the world.
    """
    for i in range(ROOT):
        for f in range(LANES):
            v = (w.face_row[0, i, f], w.face_row[1, i, f], w.face_row[2, i, f], w.face_row[3, i, f])
            w.line[0, f], w.line[1, f], w.line[2, f], w.line[3, f] = answer(w, v, f)
        for f in range(FINGERS):
            for a in range(ANGLES):
                w.shared[i, 4 * f + a] = w.line[a, f]
        for j in range(N_ANGLES, N_POSE):
            w.shared[i, j] = 0.0
    for i in range(3):
        for j in range(3):
            w.shared[j, N_ANGLES + i] = w.rotation[i, j]
            w.shared[SHIFT + j, N_ANGLES + SHIFT + i] = w.rotation[i, j]
    for i in range(ROOT):
        for j in range(i):
            v = w.system[j, i] * w.root_change[j]
            for k in range(N_POSE):
                w.shared[i, k] -= v * w.shared[j, k]
        w.root_change[i] = 1.0 / w.system[i, i]
    for i in range(ROOT):
        v = math.sqrt(w.root_change[i])
        for k in range(N_POSE):
            w.shared[i, k] *= v


@inline
def own_parts(w):
    """`own`: the angles' unit vectors through each finger's L^-1, over the pivots' roots."""
    for f in range(LANES):
        c, n = w.normal[0, f], w.normal[1, f]
        m0, m1, m2, m3 = w.free[0, f], w.free[1, f], w.free[2, f], w.free[3, f]
        l10, l20, l30 = w.factor[1, 0, f], w.factor[2, 0, f], w.factor[3, 0, f]
        l21, l31, l32 = w.factor[2, 1, f], w.factor[3, 1, f], w.factor[3, 2, f]
        for a in range(ANGLES):
            v0 = (c if a == FLEXION else (n if a == ABDUCTION else 0.0)) * m0
            v1 = (-n if a == FLEXION else (c if a == ABDUCTION else 0.0)) * m1 - l10 * v0
            v2 = (m2 if a == HINGE_1 else 0.0) - l20 * v0 - l21 * v1
            v3 = (m3 if a == HINGE_2 else 0.0) - l30 * v0 - l31 * v1 - l32 * v2
            w.own[a, 0, f], w.own[a, 1, f] = v0 * root(w, 0, f), v1 * root(w, 1, f)
            w.own[a, 2, f], w.own[a, 3, f] = v2 * root(w, 2, f), v3 * root(w, 3, f)


@inline
def root(w, k, f):
    return math.sqrt(w.pivot[k, f])


@inline
def find_variances(w):
    """`variance`: the sums of squares of an angle's numbers; infinite where nothing sees it."""
    for a in range(ANGLES):
        for f in range(FINGERS):
            v = 0.0
            for i in range(ANGLES):
                v += w.own[a, i, f] ** 2
            for i in range(ROOT):
                v += w.shared[i, 4 * f + a] ** 2
            seen = w.diagonal[a, f] > 0.0 and v < _UNSEEN
            w.variance[4 * f + a] = v if seen else math.inf


@inline
def multiply_out(w):
    """`covariance`: the products of all unknowns' numbers, and the variances on the diagonal."""
    for i in range(N_POSE):
        x0, x1, x2 = w.shared[0, i], w.shared[1, i], w.shared[2, i]
        x3, x4, x5 = w.shared[3, i], w.shared[4, i], w.shared[5, i]
        for j in range(N_POSE):
            v = x0 * w.shared[0, j] + x1 * w.shared[1, j] + x2 * w.shared[2, j]
            v += x3 * w.shared[3, j] + x4 * w.shared[4, j] + x5 * w.shared[5, j]
            w.covariance[i, j] = v
    for f in range(FINGERS):
        for a in range(ANGLES):
            for b in range(ANGLES):
                v = 0.0
                for k in range(ANGLES):
                    v += w.own[a, k, f] * w.own[b, k, f]
                w.covariance[4 * f + a, 4 * f + b] += v
    for i in range(N_ANGLES):
        if w.variance[i] == math.inf:
            for j in range(N_POSE):
                w.covariance[i, j] = w.covariance[j, i] = 0.0
        w.covariance[i, i] = w.variance[i]


@Solver
def unit_covariance(w):
    """Covariance of the pose at unit noise, from Gauss-Newton's Hessian on the face.

    Order: angles, a turn of the world on the left of the rotation, translation. What a limit
    holds has no variance; what nothing observes has infinite variance and no covariance.
    Places the pose in the workspace. Sets `variance`; and `covariance`, where `full` is not 0.
    """
    place(w)
    differentiate(w, 0.0)
    guess_faces(w)
    lift_pivots(w, 1e-9)
    factor_faces(w)
    root_hessian(w)
    eliminate_fingers(w)
    factor_root(w, 1e-9)
    share_root(w)
    own_parts(w)
    find_variances(w)
    if w.full:
        multiply_out(w)
