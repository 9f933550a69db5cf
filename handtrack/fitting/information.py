"""What a frame's joints say of a pose, as a dense gradient and Hessian."""

from __future__ import annotations

from handtrack.fitting.arrowhead import root_hessian
from handtrack.fitting.compiled import Solver
from handtrack.fitting.lanes import (
    COVARIANCE,
    FULL,
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
    SIZE,
    SYSTEM,
    G,
    buffer_rotation,
    differentiate,
    place,
)

GRADIENT = SIZE
"""Where the gradient (26,) goes: behind the fitter's buffer."""
HESSIAN = COVARIANCE
LONG = SIZE + 26
"""Size of a buffer with room for the gradient."""


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
    h = s[HESSIAN : HESSIAN + 676].reshape(26, 26)
    for i in range(20):
        for j in range(20):
            h[i, j] = 0.0
    r = buffer_rotation(s)
    for f in range(5):
        k = 4 * f
        h[k, k], h[k, k + 1], h[k, k + 2] = s[H_ZZ + f], s[H_ZY + f], s[H_Z2 + f]
        h[k, k + 3], h[k + 1, k + 1] = s[H_Z3 + f], s[H_YY + f]
        h[k + 1, k + 2], h[k + 1, k + 3] = s[H_Y2 + f], s[H_Y3 + f]
        h[k + 2, k + 2], h[k + 2, k + 3], h[k + 3, k + 3] = s[H_22 + f], s[H_23 + f], s[H_33 + f]
        for i in range(4):
            row = ROW_Z + i * ROW + f
            s[GRADIENT + k + i] = s[row + G]
            for j in range(i):
                h[k + i, k + j] = h[k + j, k + i]
            for b in range(2):
                at = row + 3 * b * LANES
                x, y, z = s[at], s[at + LANES], s[at + 2 * LANES]
                for j in range(3):
                    v = r[j][0] * x + r[j][1] * y + r[j][2] * z
                    h[k + i, 20 + 3 * b + j] = h[20 + 3 * b + j, k + i] = v
    # the root's own part: from its frame to the world on both sides
    for b in range(2):
        for j in range(3):
            v = 0.0
            for i in range(3):
                v += r[j][i] * s[SYSTEM + (3 * b + i) * LANES + 6]
            s[GRADIENT + 20 + 3 * b + j] = v
        for c in range(2):
            for i in range(3):
                for j in range(3):
                    v = 0.0
                    for m in range(3):
                        w = 0.0
                        for n in range(3):
                            w += s[SYSTEM + (3 * b + m) * LANES + 3 * c + n] * r[j][n]
                        v += r[i][m] * w
                    h[20 + 3 * b + i, 20 + 3 * c + j] = v
