"""How well a fitted pose is known: its covariance from the Gauss-Newton Hessian."""

from __future__ import annotations

import math

from handtrack.fitting.arrowhead import (
    eliminate_fingers,
    factor_faces,
    lift_pivots,
    root_hessian,
)
from handtrack.fitting.compiled import Solver, inline
from handtrack.fitting.fingers import guess_faces
from handtrack.fitting.lanes import (
    COVARIANCE,
    D_Z,
    FREE_2,
    FREE_3,
    FREE_N,
    FREE_T,
    FULL,
    L_01,
    L_02,
    L_03,
    L_12,
    L_13,
    L_23,
    LANES,
    NORMAL_Y,
    NORMAL_Z,
    P_0,
    P_1,
    P_2,
    P_3,
    R_0,
    R_1,
    R_2,
    R_3,
    ROOT,
    SCHUR,
    SYSTEM,
    VARIANCE,
    differentiate,
    place,
)

# variance at unit noise that stands for "not observed" [rad^2/m^2]
_UNSEEN = 1e7
# The covariance is a sum of outer products: every unknown has six numbers from the root, and an
# angle four more from its own finger. SHARED: six rows of ANGLES lanes for the angles (slots in
# their order) and eight for the root; OWN: slot 4 a + i for angle a. They take up space that
# `eliminate_fingers` leaves.
ANGLES = 4 * LANES
WIDTH = ANGLES + LANES
SHARED, OWN, LINE = SCHUR, R_0, SCHUR + 6 * WIDTH


@inline
def factor_root(s):
    """SYSTEM into L L^T: L^T above the diagonal, on it the inverses of L's."""
    for k in range(6):
        row = SYSTEM + k * LANES
        d = 1.0 / math.sqrt(max(s[row + k], 1e-9 * s[row + 7]))
        s[row + k] = d
        for i in range(k + 1, 6):
            s[row + i] *= d
        for i in range(k + 1, 6):
            for j in range(i, 6):
                s[SYSTEM + i * LANES + j] -= s[row + i] * s[row + j]


@inline
def share_root(s):
    """SHARED: what the root's six unknowns make of each unknown, through the root's L^-1.

    An angle answers them by - H^-1 B; the root's own are turned into the world.
    """
    for i in range(6):
        for f in range(LANES):
            k, m = i * LANES + f, SHARED + i * WIDTH + f
            x3 = -s[R_3 + k] * s[P_3 + f]
            x2 = -s[R_2 + k] * s[P_2 + f] - s[L_23 + f] * x3
            x1 = -s[R_1 + k] * s[P_1 + f] - s[L_12 + f] * x2 - s[L_13 + f] * x3
            x0 = -s[R_0 + k] * s[P_0 + f]
            x0 -= s[L_01 + f] * x1 + s[L_02 + f] * x2 + s[L_03 + f] * x3
            c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
            s[m], s[m + LANES] = c * x0 - n * x1, n * x0 + c * x1
            s[m + 2 * LANES], s[m + 3 * LANES] = x2, x3
            s[m + ANGLES] = 0.0
    for i in range(3):
        for j in range(3):
            m = SHARED + ANGLES + j * WIDTH + i
            s[m] = s[m + 3 * WIDTH + 3] = s[ROOT + 3 * i + j]
    for i in range(6):
        for j in range(i):
            v = s[SYSTEM + j * LANES + i]
            for m in range(WIDTH):
                s[SHARED + i * WIDTH + m] -= v * s[SHARED + j * WIDTH + m]
        v = s[SYSTEM + i * LANES + i]
        for m in range(WIDTH):
            s[SHARED + i * WIDTH + m] *= v


@inline
def own_parts(s):
    """OWN: the angles' unit vectors through each finger's L^-1, over the pivots' roots."""
    for f in range(LANES):
        c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
        l01, l02, l03 = s[L_01 + f], s[L_02 + f], s[L_03 + f]
        l12, l13, l23 = s[L_12 + f], s[L_13 + f], s[L_23 + f]
        p0, p1 = math.sqrt(s[P_0 + f]), math.sqrt(s[P_1 + f])
        p2, p3 = math.sqrt(s[P_2 + f]), math.sqrt(s[P_3 + f])
        m0, m1, m2, m3 = s[FREE_N + f], s[FREE_T + f], s[FREE_2 + f], s[FREE_3 + f]
        for a in range(4):
            v0 = (c if a == 0 else (n if a == 1 else 0.0)) * m0
            v1 = (-n if a == 0 else (c if a == 1 else 0.0)) * m1 - l01 * v0
            v2 = (m2 if a == 2 else 0.0) - l02 * v0 - l12 * v1
            v3 = (m3 if a == 3 else 0.0) - l03 * v0 - l13 * v1 - l23 * v2
            k = OWN + 4 * a * LANES + f
            s[k], s[k + LANES] = v0 * p0, v1 * p1
            s[k + 2 * LANES], s[k + 3 * LANES] = v2 * p2, v3 * p3


@inline
def find_variances(s):
    """VARIANCE: the sums of the squares of an angle's numbers; infinite where nothing sees it."""
    for a in range(4):
        for f in range(5):
            v = 0.0
            for i in range(4):
                v += s[OWN + (4 * a + i) * LANES + f] ** 2
            for i in range(6):
                v += s[SHARED + i * WIDTH + a * LANES + f] ** 2
            seen = s[D_Z + a * LANES + f] > 0.0 and v < _UNSEEN
            s[VARIANCE + 4 * f + a] = v if seen else math.inf


@inline
def multiply_out(s):
    """COVARIANCE: the products of all unknowns' numbers, and the variances on the diagonal."""
    for i in range(26):
        f, a = i // 4, i % 4
        p = SHARED + (a * LANES + f if i < 20 else ANGLES + i - 20)
        x0, x1, x2 = s[p], s[p + WIDTH], s[p + 2 * WIDTH]
        x3, x4, x5 = s[p + 3 * WIDTH], s[p + 4 * WIDTH], s[p + 5 * WIDTH]
        for m in range(WIDTH):
            q = SHARED + m
            v = x0 * s[q] + x1 * s[q + WIDTH] + x2 * s[q + 2 * WIDTH]
            v += x3 * s[q + 3 * WIDTH] + x4 * s[q + 4 * WIDTH] + x5 * s[q + 5 * WIDTH]
            s[LINE + m] = v
        if i < 20:
            for b in range(4):
                for k in range(4):
                    x = s[OWN + (4 * a + k) * LANES + f] * s[OWN + (4 * b + k) * LANES + f]
                    s[LINE + b * LANES + f] += x
        out = COVARIANCE + 26 * i
        for g in range(5):
            for b in range(4):
                s[out + 4 * g + b] = s[LINE + b * LANES + g]
        for b in range(6):
            s[out + 20 + b] = s[LINE + ANGLES + b]
    for i in range(20):
        if s[VARIANCE + i] == math.inf:
            for j in range(26):
                s[COVARIANCE + 26 * i + j] = s[COVARIANCE + 26 * j + i] = 0.0
        s[COVARIANCE + 27 * i] = s[VARIANCE + i]


@Solver
def unit_covariance(s):
    """Covariance of the pose at unit noise, from Gauss-Newton's Hessian on the face.

    Order: angles, a turn of the world on the left of the rotation, translation. What a limit
    holds has no variance; what nothing observes has infinite variance and no covariance.
    Places the pose in the buffer. The angles' variances go to VARIANCE; and the matrix (26, 26)
    to COVARIANCE, where FULL in the buffer is not 0.
    """
    place(s)
    differentiate(s, 0.0)
    guess_faces(s)
    lift_pivots(s, 1e-9)
    factor_faces(s)
    root_hessian(s)
    eliminate_fingers(s)
    factor_root(s)
    share_root(s)
    own_parts(s)
    find_variances(s)
    if s[FULL] != 0.0:
        multiply_out(s)
