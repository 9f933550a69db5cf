"""A pose's dense system held to the active face, solved, and taken back to angles.

What has a prior or pixels or contacts in it is no arrowhead: filter, image fit and collisions
take their steps here.
"""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.workspace import (
    ANGLES,
    FINGERS,
    GRADIENT,
    HINGE_1,
    N_POSE,
    NORMAL,
    TANGENT,
)


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
        if w.free[NORMAL, f] == 0.0 or w.free[TANGENT, f] == 0.0:
            faces = True
            c, n = w.normal[0, f], w.normal[1, f]
            for j in range(N_POSE):
                z, y = h[k, j], h[k + 1, j]
                h[k, j], h[k + 1, j] = c * z + n * y, c * y - n * z
            for j in range(N_POSE):
                z, y = h[j, k], h[j, k + 1]
                h[j, k], h[j, k + 1] = c * z + n * y, c * y - n * z
            z, y = x[k], x[k + 1]
            x[k], x[k + 1] = c * z + n * y, c * y - n * z
            h[k + 1, k + 1] += w.curvature[f]
            if w.free[TANGENT, f] == 0.0:
                hold(h, x, k + 1)
            hold(h, x, k)
        for a in range(HINGE_1, ANGLES):
            if w.free[a, f] == 0.0:
                faces = True
                hold(h, x, k + a)
    return faces


@inline
def hold(h, x, k):
    for j in range(N_POSE):
        h[k, j] = h[j, k] = 0.0
    h[k, k] = 1.0
    x[k] = 0.0


@inline
def leave_faces(w, x):
    """The step of the angles from the faces' directions to angles, in x and in `step`."""
    for f in range(FINGERS):
        k = 4 * f
        if w.free[NORMAL, f] == 0.0 or w.free[TANGENT, f] == 0.0:
            c, n = w.normal[0, f], w.normal[1, f]
            z, y = x[k], x[k + 1]
            x[k], x[k + 1] = c * z - n * y, n * z + c * y
        for a in range(ANGLES):
            w.step[a, f] = x[k + a]
