"""What a frame's joints say of a pose, as a dense gradient and Hessian."""

from __future__ import annotations

from handtrack.fitting.arrowhead import root_hessian
from handtrack.fitting.compiled import Solver, inline
from handtrack.fitting.lanes import (
    COVARIANCE,
    FULL,
    GRADIENT,
    H_22,
    H_23,
    H_33,
    H_Y2,
    H_Y3,
    H_YY,
    H_Z2,
    H_Z3,
    H_ZY,
    H_ZZ,
    LANES,
    OBJECTIVE,
    ROW,
    ROW_Z,
    SYSTEM,
    G,
    buffer_rotation,
    differentiate,
    place,
)
from handtrack.fitting.vectors import apply

HESSIAN = COVARIANCE


@inline
def assemble(s, g, h):
    """Gradient (26,) and Hessian (26, 26) from their parts in the buffer.

    Order: angles, then the fitter's own unknowns of the root, a turn and a shift in its frame.
    The buffer is as `differentiate` and `root_hessian` leave it.
    """
    for i in range(20):
        for j in range(20):
            h[i, j] = 0.0
    for f in range(5):
        k = 4 * f
        h[k, k], h[k, k + 1], h[k, k + 2] = s[H_ZZ + f], s[H_ZY + f], s[H_Z2 + f]
        h[k, k + 3], h[k + 1, k + 1] = s[H_Z3 + f], s[H_YY + f]
        h[k + 1, k + 2], h[k + 1, k + 3] = s[H_Y2 + f], s[H_Y3 + f]
        h[k + 2, k + 2], h[k + 2, k + 3], h[k + 3, k + 3] = s[H_22 + f], s[H_23 + f], s[H_33 + f]
        for i in range(4):
            row = ROW_Z + i * ROW + f
            g[k + i] = s[row + G]
            for j in range(i):
                h[k + i, k + j] = h[k + j, k + i]
            for j in range(6):
                h[k + i, 20 + j] = h[20 + j, k + i] = s[row + j * LANES]
    for i in range(6):
        g[20 + i] = s[SYSTEM + i * LANES + 6]
        for j in range(6):
            h[20 + i, 20 + j] = s[SYSTEM + i * LANES + j]


@Solver
def information(s):
    """Objective, and gradient and Gauss-Newton Hessian of its half, at the pose in the buffer.

    Order and frame are a pose's: angles, a turn of the world on the left of the rotation,
    translation. Sets OBJECTIVE; and, where FULL is not 0, GRADIENT and HESSIAN (26 x 26).
    """
    s[OBJECTIVE] = place(s)
    if s[FULL] == 0.0:
        return
    differentiate(s, 0.0)
    root_hessian(s)
    g, h = s[GRADIENT : GRADIENT + 26], s[HESSIAN : HESSIAN + 676].reshape(26, 26)
    assemble(s, g, h)
    # the root's own part: from its frame to the world, on both sides
    r = buffer_rotation(s)
    for k in (20, 23):
        g[k], g[k + 1], g[k + 2] = apply(r, (g[k], g[k + 1], g[k + 2]))
        for j in range(26):
            h[k, j], h[k + 1, j], h[k + 2, j] = apply(r, (h[k, j], h[k + 1, j], h[k + 2, j]))
    for k in (20, 23):
        for i in range(26):
            h[i, k], h[i, k + 1], h[i, k + 2] = apply(r, (h[i, k], h[i, k + 1], h[i, k + 2]))
