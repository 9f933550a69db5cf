"""How well a fitted pose is known: its covariance from the Gauss-Newton Hessian."""

from __future__ import annotations

import math

import numpy as np

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
    D_2,
    D_3,
    D_Y,
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
    SYSTEM,
    buffer_rotation,
    differentiate,
    place,
)

# variance at unit noise that stands for "not observed" [rad^2/m^2]
_UNSEEN = 1e7


@inline
def hide_unseen(s, out):
    """Infinite variance for the angles that nothing observes."""
    for f in range(5):
        for i in range(4):
            g = s[(D_Z if i == 0 else (D_Y if i == 1 else (D_2 if i == 2 else D_3))) + f]
            k = 4 * f + i
            if g <= 0.0 or not out[k, k] < _UNSEEN:
                for j in range(26):
                    out[k, j] = out[j, k] = 0.0
                out[k, k] = math.inf


@Solver
def unit_covariance(s):
    """Covariance (26, 26) of the pose at unit noise, from Gauss-Newton's Hessian on the face.

    Order: angles, a turn of the world on the left of the rotation, translation. What a limit
    holds has no variance; what nothing observes has infinite variance and no covariance.
    Places the pose in the buffer; the covariance goes to COVARIANCE. Only the variances of
    the angles where FULL in the buffer is 0.
    """
    out = s[COVARIANCE : COVARIANCE + 676].reshape(26, 26)
    place(s)
    differentiate(s, 0.0)
    guess_faces(s)
    lift_pivots(s, 1e-9)
    factor_faces(s)
    root_hessian(s)
    eliminate_fingers(s)
    # inverse of the root's Schur complement, by Gauss-Jordan
    a = np.zeros((6, 12))
    for i in range(6):
        for j in range(6):
            a[i, j] = s[SYSTEM + i * LANES + j]
        a[i, 6 + i] = 1.0
    for k in range(6):
        d = max(a[k, k], 1e-9 * s[SYSTEM + k * LANES + 7])
        for j in range(12):
            a[k, j] /= d
        for i in range(6):
            if i != k:
                v = a[i, k]
                for j in range(12):
                    a[i, j] -= v * a[k, j]
    for i in range(26):
        for j in range(26):
            out[i, j] = 0.0
    # how every angle answers the root (6), and its own face's inverse
    answer = np.zeros((20, 6))
    solved = np.zeros(4)
    for f in range(5):
        l01, l02, l03 = s[L_01 + f], s[L_02 + f], s[L_03 + f]
        l12, l13, l23 = s[L_12 + f], s[L_13 + f], s[L_23 + f]
        d0, d1, d2, d3 = s[P_0 + f], s[P_1 + f], s[P_2 + f], s[P_3 + f]
        c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
        for j in range(10):
            if j < 6:
                k = j * LANES + f
                v0, v1, v2, v3 = s[R_0 + k], s[R_1 + k], s[R_2 + k], s[R_3 + k]
            else:
                # a unit vector of one angle, on the face and through L^-1
                v0 = (c if j == 6 else (n if j == 7 else 0.0)) * s[FREE_N + f]
                v1 = (-n if j == 6 else (c if j == 7 else 0.0)) * s[FREE_T + f]
                v2 = (1.0 if j == 8 else 0.0) * s[FREE_2 + f]
                v3 = (1.0 if j == 9 else 0.0) * s[FREE_3 + f]
                v1 -= l01 * v0
                v2 -= l02 * v0 + l12 * v1
                v3 -= l03 * v0 + l13 * v1 + l23 * v2
            x3 = v3 * d3
            x2 = v2 * d2 - l23 * x3
            x1 = v1 * d1 - l12 * x2 - l13 * x3
            x0 = v0 * d0 - l01 * x1 - l02 * x2 - l03 * x3
            solved[0], solved[1] = c * x0 - n * x1, n * x0 + c * x1
            solved[2], solved[3] = x2, x3
            for i in range(4):
                if j < 6:
                    answer[4 * f + i, j] = -solved[i]
                else:
                    out[4 * f + i, 4 * f + j - 6] = solved[i]
    # the root's own covariance, turned to the world, and its part in the angles'
    turned = np.zeros((26, 6))
    for i in range(20):
        for j in range(6):
            for k in range(6):
                turned[i, j] += answer[i, k] * a[k, 6 + j]
    if s[FULL] == 0.0:
        for i in range(20):
            for k in range(6):
                out[i, i] += turned[i, k] * answer[i, k]
        hide_unseen(s, out)
        return
    for i in range(20):
        for j in range(20):
            for k in range(6):
                out[i, j] += turned[i, k] * answer[j, k]
    rot = buffer_rotation(s)
    for i in range(26):
        for h in range(2):
            for j in range(3):
                v = 0.0
                for k in range(3):
                    x = turned[i, 3 * h + k] if i < 20 else a[i - 20, 6 + 3 * h + k]
                    v += rot[j][k] * x
                out[i, 20 + 3 * h + j] = v
    for j in range(20, 26):
        for i in range(20):
            out[j, i] = out[i, j]
        # the root's block still has its rows in the root frame
    for h in range(2):
        for j in range(20, 26):
            v = (out[20 + 3 * h, j], out[21 + 3 * h, j], out[22 + 3 * h, j])
            for i in range(3):
                w = 0.0
                for k in range(3):
                    w += rot[i][k] * v[k]
                out[20 + 3 * h + i, j] = w
    hide_unseen(s, out)
