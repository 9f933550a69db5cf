"""The arrowhead system: six unknowns of the root, and five independent fingers of four.

Every finger is factored on its active face; what is left is a Schur complement of the root.
"""

from __future__ import annotations

from handtrack.fitting.compiled import inline
from handtrack.fitting.lanes import (
    CHANGE,
    CURVE,
    D_2,
    D_3,
    D_Y,
    D_Z,
    FREE_2,
    FREE_3,
    FREE_N,
    FREE_T,
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
    RHO,
    ROOT_GRAD,
    ROOT_HESS,
    ROOT_W,
    ROOT_WX,
    ROW,
    ROW_2,
    ROW_3,
    ROW_Y,
    ROW_Z,
    SCHUR,
    STEP_2,
    STEP_3,
    STEP_Y,
    STEP_Z,
    SYSTEM,
    G,
)

# a pivot below this share of Gauss-Newton's diagonal is lifted to it
SOUND_PIVOT = 0.05
# [m^2] keeps what nothing observes in place
PIVOT_FLOOR = 1e-10


@inline
def lift_pivots(s, share):
    """Make every finger's Hessian positive definite by raising its diagonal, if need be.

    A pivot ends up no smaller than `share` of Gauss-Newton's diagonal.
    """
    for f in range(LANES):
        a00, a01, a02, a03 = s[H_ZZ + f], s[H_ZY + f], s[H_Z2 + f], s[H_Z3 + f]
        a11, a12, a13 = s[H_YY + f], s[H_Y2 + f], s[H_Y3 + f]
        a22, a23, a33 = s[H_22 + f], s[H_23 + f], s[H_33 + f]
        # L D L^T; the tip's pivot, given all others, is the weak one
        d0 = max(a00, share * s[D_Z + f] + PIVOT_FLOOR)
        l1, l2, l3 = a01 / d0, a02 / d0, a03 / d0
        b11, b12, b13 = a11 - l1 * a01, a12 - l1 * a02, a13 - l1 * a03
        b22, b23, b33 = a22 - l2 * a02, a23 - l2 * a03, a33 - l3 * a03
        d1 = max(b11, share * s[D_Y + f] + PIVOT_FLOOR)
        l2, l3 = b12 / d1, b13 / d1
        c22, c23, c33 = b22 - l2 * b12, b23 - l2 * b13, b33 - l3 * b13
        d2 = max(c22, share * s[D_2 + f] + PIVOT_FLOOR)
        e33 = c33 - c23 * c23 / d2
        d3 = max(e33, share * s[D_3 + f] + PIVOT_FLOOR)
        s[H_ZZ + f] += d0 - a00
        s[H_YY + f] += d1 - b11
        s[H_22 + f] += d2 - c22
        s[H_33 + f] += d3 - e33


@inline
def factor_faces(s):
    """L D L^T of every finger's Hessian on its active face, and its rows through L^-1.

    The saddle is turned to the boundary's normal and tangent; what is fixed drops out.
    """
    for f in range(LANES):
        m0, m1, m2, m3 = s[FREE_N + f], s[FREE_T + f], s[FREE_2 + f], s[FREE_3 + f]
        c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
        zz, zy, yy = s[H_ZZ + f], s[H_ZY + f], s[H_YY + f]
        z2, z3, y2, y3 = s[H_Z2 + f], s[H_Z3 + f], s[H_Y2 + f], s[H_Y3 + f]
        a00 = (c * c * zz + 2.0 * c * n * zy + n * n * yy) * m0 + (1.0 - m0)
        a01 = ((c * c - n * n) * zy + c * n * (yy - zz)) * m0 * m1
        a11 = (n * n * zz - 2.0 * c * n * zy + c * c * yy + s[CURVE + f]) * m1 + (1.0 - m1)
        a02, a03 = (c * z2 + n * y2) * m0 * m2, (c * z3 + n * y3) * m0 * m3
        a12, a13 = (c * y2 - n * z2) * m1 * m2, (c * y3 - n * z3) * m1 * m3
        a22, a33 = s[H_22 + f] * m2 + (1.0 - m2), s[H_33 + f] * m3 + (1.0 - m3)
        a23 = s[H_23 + f] * m2 * m3
        d0 = 1.0 / a00
        l01, l02, l03 = a01 * d0, a02 * d0, a03 * d0
        b11, b12, b13 = a11 - l01 * a01, a12 - l01 * a02, a13 - l01 * a03
        d1 = 1.0 / b11
        l12, l13 = b12 * d1, b13 * d1
        b22, b23 = a22 - l02 * a02 - l12 * b12, a23 - l02 * a03 - l12 * b13
        d2 = 1.0 / b22
        l23 = b23 * d2
        d3 = 1.0 / (a33 - l03 * a03 - l13 * b13 - l23 * b23)
        s[P_0 + f], s[P_1 + f], s[P_2 + f], s[P_3 + f] = d0, d1, d2, d3
        s[L_01 + f], s[L_02 + f], s[L_03 + f] = l01, l02, l03
        s[L_12 + f], s[L_13 + f], s[L_23 + f] = l12, l13, l23
    for f in range(LANES):
        m0, m1, m2, m3 = s[FREE_N + f], s[FREE_T + f], s[FREE_2 + f], s[FREE_3 + f]
        c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
        l01, l02, l03 = s[L_01 + f], s[L_02 + f], s[L_03 + f]
        l12, l13, l23 = s[L_12 + f], s[L_13 + f], s[L_23 + f]
        for i in range(7):
            k = i * LANES + f
            z, y = s[ROW_Z + k], s[ROW_Y + k]
            v0, v1 = (c * z + n * y) * m0, (c * y - n * z) * m1
            v2, v3 = s[ROW_2 + k] * m2, s[ROW_3 + k] * m3
            v1 -= l01 * v0
            v2 -= l02 * v0 + l12 * v1
            v3 -= l03 * v0 + l13 * v1 + l23 * v2
            s[R_0 + k] = v0
            s[R_1 + k] = v1
            s[R_2 + k] = v2
            s[R_3 + k] = v3


@inline
def move_along_faces(s, from_gradient):
    """Every finger's answer on its face to the root's change in CHANGE.

    From the gradient: the step itself; else the answer is added to the step.
    """
    s[CHANGE + 6] = 1.0 if from_gradient else 0.0
    keep = 1.0 - s[CHANGE + 6]
    for f in range(LANES):
        v0 = v1 = v2 = v3 = 0.0
        for i in range(7):
            x, k = s[CHANGE + i], i * LANES + f
            v0 += s[R_0 + k] * x
            v1 += s[R_1 + k] * x
            v2 += s[R_2 + k] * x
            v3 += s[R_3 + k] * x
        # L^T x = - D^-1 v
        x3 = -v3 * s[P_3 + f]
        x2 = -v2 * s[P_2 + f] - s[L_23 + f] * x3
        x1 = -v1 * s[P_1 + f] - s[L_12 + f] * x2 - s[L_13 + f] * x3
        x0 = -v0 * s[P_0 + f] - s[L_01 + f] * x1 - s[L_02 + f] * x2 - s[L_03 + f] * x3
        c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
        s[STEP_Z + f] = keep * s[STEP_Z + f] + c * x0 - n * x1
        s[STEP_Y + f] = keep * s[STEP_Y + f] + n * x0 + c * x1
        s[STEP_2 + f] = keep * s[STEP_2 + f] + x2
        s[STEP_3 + f] = keep * s[STEP_3 + f] + x3


@inline
def root_hessian(s):
    """The root's own 6x6 Hessian and gradient, in SYSTEM; column 7: the least sound pivots."""
    for i in range(6 * LANES):
        s[SYSTEM + i] = 0.0
    n = 0
    for i in range(3):
        for j in range(i, 3):
            h = 0.0
            for f in range(6):
                h += s[ROOT_HESS + n * LANES + f]
            n += 1
            s[SYSTEM + i * LANES + j] = h
            s[SYSTEM + j * LANES + i] = h
    w = 0.0
    for f in range(6):
        w += s[ROOT_W + f]
    for i in range(3):
        # sum_i w_i [x_i]x couples turn and shift
        x = 0.0
        for f in range(6):
            x += s[ROOT_WX + i * LANES + f]
        j, k = (i + 1) % 3, (i + 2) % 3
        s[SYSTEM + j * LANES + 3 + k] = s[SYSTEM + (3 + k) * LANES + j] = -x
        s[SYSTEM + k * LANES + 3 + j] = s[SYSTEM + (3 + j) * LANES + k] = x
        s[SYSTEM + (3 + i) * LANES + 3 + i] = w
    for i in range(6):
        g = 0.0
        for f in range(6):
            g += s[ROOT_GRAD + i * LANES + f]
        s[SYSTEM + i * LANES + 6] = g
        s[SYSTEM + i * LANES + 7] = 1e-3 * abs(s[SYSTEM + i * LANES + i]) + 1e-12


@inline
def add_model_gradient(s):
    """Add to the root's gradient what the step so far, fingers and root, makes of it."""
    for i in range(6):
        g = 0.0
        for j in range(6):
            g += s[SYSTEM + i * LANES + j] * s[RHO + j]
        for a in range(4):
            for f in range(5):
                g += s[ROW_Z + a * ROW + i * LANES + f] * s[STEP_Z + a * LANES + f]
        s[SYSTEM + i * LANES + 6] += g
    # the fingers' own gradients are answered already
    for f in range(LANES):
        s[R_0 + G + f] = s[R_1 + G + f] = s[R_2 + G + f] = s[R_3 + G + f] = 0.0


@inline
def eliminate_fingers(s):
    """The Schur complement: take B^T H^-1 (B, gradient) of every finger from SYSTEM."""
    for f in range(LANES):
        p0, p1, p2, p3 = s[P_0 + f], s[P_1 + f], s[P_2 + f], s[P_3 + f]
        for i in range(6):
            k = i * LANES + f
            v0, v1, v2, v3 = p0 * s[R_0 + k], p1 * s[R_1 + k], p2 * s[R_2 + k], p3 * s[R_3 + k]
            for j in range(i, 7):
                k = j * LANES + f
                h = v0 * s[R_0 + k] + v1 * s[R_1 + k] + v2 * s[R_2 + k] + v3 * s[R_3 + k]
                s[SCHUR + 7 * LANES * i + k] = h
    for i in range(6):
        for j in range(i, 7):
            k = SCHUR + (7 * i + j) * LANES
            h = s[k] + s[k + 1] + s[k + 2] + s[k + 3] + s[k + 4]
            s[SYSTEM + i * LANES + j] -= h
            if j < 6:
                s[SYSTEM + j * LANES + i] = s[SYSTEM + i * LANES + j]


@inline
def solve_root(s):
    """The root's change in CHANGE, from SYSTEM in place; returns whether it has a minimum.

    Elimination in order, with pivots lifted to a share of what they began with.
    """
    sound = True
    for k in range(6):
        row_k = SYSTEM + k * LANES
        d = s[row_k + k]
        if not d >= s[row_k + 7]:
            sound = False
            d = s[row_k + 7]
        s[row_k + k] = d
        inverse = 1.0 / d
        for i in range(k + 1, 6):
            row_i = SYSTEM + i * LANES
            v = s[row_k + i] * inverse
            for j in range(i, 7):
                s[row_i + j] -= v * s[row_k + j]
    for i in range(5, -1, -1):
        row_i = SYSTEM + i * LANES
        v = -s[row_i + 6]
        for j in range(i + 1, 6):
            v -= s[row_i + j] * s[CHANGE + j]
        s[CHANGE + i] = v / s[row_i + i]
    return sound
