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
    N_POSE,
    NORMAL,
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
