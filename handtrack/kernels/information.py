"""What a frame's joints say of a pose, as a dense gradient and Hessian."""

from __future__ import annotations

from handtrack.kernels.arrowhead import root_hessian
from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.derivatives import differentiate
from handtrack.kernels.objectives import place
from handtrack.kernels.vectors import apply, column, matrix, part, put_column, put_part
from handtrack.kernels.workspace import (
    ANGLES,
    FINGERS,
    GRADIENT,
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
