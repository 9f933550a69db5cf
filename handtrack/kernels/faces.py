"""The active face of a finger's limits: which hinges are held, and where the ellipse holds.

A face is guessed from the pose and its gradient, reported by a finger's bounded problem, and
used wherever a system is held to it. What has a prior or pixels or contacts in it is no
arrowhead: filter, image fit and collisions hold their dense systems to it here.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.limits import inverse_squares
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    FINGERS,
    FLEXION,
    GRADIENT,
    HINGE_1,
    HINGE_2,
    LANES,
    N_POSE,
    NORMAL,
    ROOT,
    TANGENT,
)


@inline
def release(w, f):
    """Mark finger f's saddle as inside its limits."""
    w.free[NORMAL, f] = w.free[TANGENT, f] = 1.0
    w.normal[0, f], w.normal[1, f] = 1.0, 0.0
    w.curvature[f] = 0.0


@inline
def fix_saddle(w, f, z, y, multiplier):
    """Hold finger f's saddle to its ellipse at (z, y).

    (21) With the multiplier m of half the constraint the boundary's curvature adds
    m (n_y^2 / a^2 + n_z^2 / b^2) to the model along the tangent; n is the unit normal.
    """
    pz, py = inverse_squares(w, f, z, y)
    nz, ny = z * pz, y * py
    n = math.sqrt(nz * nz + ny * ny)
    nz, ny = nz / n, ny / n
    w.free[NORMAL, f] = 0.0
    w.normal[0, f], w.normal[1, f] = nz, ny
    w.curvature[f] = multiplier * (ny * ny * pz + nz * nz * py)


@inline
def guess_faces(w):
    """Faces from the pose: a limit is active where the pose is on it and the gradient leaves."""
    for f in range(LANES):
        release(w, f)
        for a in range(HINGE_1, ANGLES):
            x, g = w.angle[a, f], w.row[a, GRADIENT, f]
            stuck = (x <= w.lower[a, f] and g > 0.0) or (x >= w.upper[a, f] and g < 0.0)
            w.free[a, f] = 0.0 if stuck else 1.0
    for f in range(FINGERS):
        z, y = w.angle[FLEXION, f], w.angle[ABDUCTION, f]
        pz, py = inverse_squares(w, f, z, y)
        if z * z * pz + y * y * py < 1.0 - 1e-9:
            continue
        nz, ny = z * pz, y * py
        push = -(w.row[FLEXION, GRADIENT, f] * nz + w.row[ABDUCTION, GRADIENT, f] * ny)
        if push > 0.0:
            fix_saddle(w, f, z, y, push / (nz * nz + ny * ny))


@inline
def slope_with_root(w, a, f):
    """An angle's gradient after the root's step."""
    v = w.row[a, GRADIENT, f]
    for i in range(ROOT):
        v += w.row[a, i, f] * w.root_step[i]
    return v


@inline
def keeps_limits(w, f):
    """Whether finger f's step stays inside its limits and its face is the right one."""
    if w.free[NORMAL, f] == 0.0:
        return False  # a curved boundary is left by any straight step
    z, y = w.angle[FLEXION, f] + w.step[FLEXION, f], w.angle[ABDUCTION, f] + w.step[ABDUCTION, f]
    pz, py = inverse_squares(w, f, z, y)
    if z * z * pz + y * y * py > 1.0:
        return False
    for a in range(HINGE_1, ANGLES):
        x = w.angle[a, f] + w.step[a, f]
        if x < w.lower[a, f] or x > w.upper[a, f]:
            return False
    # the multipliers of fixed hinges must push outwards
    for a in range(HINGE_1, ANGLES):
        if w.free[a, f] == 0.0:
            other = HINGE_1 + HINGE_2 - a
            m = slope_with_root(w, a, f) + w.hessian[a, FLEXION, f] * w.step[FLEXION, f]
            m += w.hessian[a, ABDUCTION, f] * w.step[ABDUCTION, f]
            m += w.hessian[a, other, f] * w.step[other, f]
            if (m < 0.0) == (w.angle[a, f] + w.step[a, f] <= w.lower[a, f]):
                return False
    return True


@inline
def put_gradient(w, g):
    """A pose's gradient (26,) where faces are guessed from."""
    for f in range(FINGERS):
        for a in range(ANGLES):
            w.row[a, GRADIENT, f] = g[4 * f + a]


@inline
def hold_faces(w, h, x):
    """Hold a pose's system h step = x to the limits' active faces, which are in the workspace.

    A saddle on its ellipse moves along the tangent; a hinge at its bound not at all. Returns
    whether there is any.
    """
    faces = False
    for f in range(FINGERS):
        k = 4 * f
        if w.free[NORMAL, f] == 0.0:
            turn_saddle(w, f, h)
            h[k + 1, k + 1] += w.curvature[f]
        for a in range(ANGLES):
            if w.free[a, f] == 0.0:
                faces = True
                for j in range(N_POSE):
                    h[k + a, j] = h[j, k + a] = 0.0
                h[k + a, k + a] = 1.0
    hold_vector(w, x)
    return faces


@inline
def turn_saddle(w, f, h):
    """Rows and columns of a saddle's two angles to its boundary's normal and tangent."""
    k, c, n = 4 * f, w.normal[0, f], w.normal[1, f]
    for j in range(N_POSE):
        z, y = h[k, j], h[k + 1, j]
        h[k, j], h[k + 1, j] = c * z + n * y, c * y - n * z
    for j in range(N_POSE):
        z, y = h[j, k], h[j, k + 1]
        h[j, k], h[j, k + 1] = c * z + n * y, c * y - n * z


@inline
def hold_vector(w, x):
    """A pose's vector in the directions of the faces, with none along what is held."""
    for f in range(FINGERS):
        k = 4 * f
        if w.free[NORMAL, f] == 0.0:
            c, n = w.normal[0, f], w.normal[1, f]
            z, y = x[k], x[k + 1]
            x[k], x[k + 1] = c * z + n * y, c * y - n * z
        for a in range(ANGLES):
            x[k + a] *= w.free[a, f]


@inline
def leave_faces(w, x):
    """The step of the angles from the faces' directions to angles, in x and in `step`."""
    for f in range(FINGERS):
        k = 4 * f
        if w.free[NORMAL, f] == 0.0:
            c, n = w.normal[0, f], w.normal[1, f]
            z, y = x[k], x[k + 1]
            x[k], x[k + 1] = c * z - n * y, n * z + c * y
        for a in range(ANGLES):
            w.step[a, f] = x[k + a]
