"""One finger's quadratic model inside its limits, solved exactly.

Limits: a box for the two hinges, the ellipse for the saddle. The face that holds the solution
(which hinges are at a bound, where on the ellipse the saddle is) goes into the root's Schur
complement.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import inline
from handtrack.fitting.lanes import (
    ANGLE_2,
    ANGLE_3,
    ANGLE_Y,
    ANGLE_Z,
    CURVE,
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
    LANES,
    LOW_2,
    LOW_3,
    LOW_Y,
    LOW_Z,
    NORMAL_Y,
    NORMAL_Z,
    RHO,
    ROW_2,
    ROW_3,
    ROW_Y,
    ROW_Z,
    STEP_2,
    STEP_3,
    STEP_Y,
    STEP_Z,
    UP_2,
    UP_3,
    UP_Y,
    UP_Z,
    G,
)


@inline
def release(s, f):
    """Mark finger f's saddle as inside its limits."""
    s[FREE_N + f] = s[FREE_T + f] = 1.0
    s[NORMAL_Z + f], s[NORMAL_Y + f] = 1.0, 0.0
    s[CURVE + f] = 0.0


@inline
def guess_faces(s):
    """Faces from the pose: a limit is active where the pose is on it and the gradient leaves."""
    for f in range(LANES):
        release(s, f)
        for a in range(2):
            i = a * LANES + f
            x, g = s[ANGLE_2 + i], s[ROW_2 + a * (ROW_3 - ROW_2) + G + f]
            stuck = (x <= s[LOW_2 + i] and g > 0.0) or (x >= s[UP_2 + i] and g < 0.0)
            s[FREE_2 + i] = 0.0 if stuck else 1.0
    for f in range(5):
        z, y = s[ANGLE_Z + f], s[ANGLE_Y + f]
        pz, py = inverse_squares(s, f, z, y)
        if z * z * pz + y * y * py < 1.0 - 1e-9:
            continue
        nz, ny = z * pz, y * py
        push = -(s[ROW_Z + G + f] * nz + s[ROW_Y + G + f] * ny)
        if push > 0.0:
            fix_saddle(s, f, z, y, push / (nz * nz + ny * ny))


@inline
def inverse_squares(s, f, z, y):
    """1/a^2 and 1/b^2 of the saddle's ellipse in the quadrant of (z, y) (eq. 3)."""
    a = s[UP_Z + f] if z >= 0.0 else s[LOW_Z + f]
    b = s[UP_Y + f] if y >= 0.0 else s[LOW_Y + f]
    return 1.0 / (a * a), 1.0 / (b * b)


@inline
def fix_saddle(s, f, z, y, multiplier):
    """Hold finger f's saddle to its ellipse at (z, y); multiplier of half the constraint."""
    pz, py = inverse_squares(s, f, z, y)
    nz, ny = z * pz, y * py
    n = math.sqrt(nz * nz + ny * ny)
    nz, ny = nz / n, ny / n
    s[FREE_N + f] = 0.0
    s[NORMAL_Z + f], s[NORMAL_Y + f] = nz, ny
    # the multiplier bends the model along the boundary
    s[CURVE + f] = multiplier * (ny * ny * pz + nz * nz * py)


@inline
def couple(s, row, f):
    """What the root's step adds to the gradient of an angle."""
    v = s[row + G + f]
    for i in range(6):
        v += s[row + i * LANES + f] * s[RHO + i]
    return v


@inline
def keeps_limits(s, f):
    """Whether finger f's step stays inside its limits and its face is the right one."""
    if s[FREE_N + f] == 0.0:
        return False  # a curved boundary is left by any straight step
    dz, dy, d2, d3 = s[STEP_Z + f], s[STEP_Y + f], s[STEP_2 + f], s[STEP_3 + f]
    z, y = s[ANGLE_Z + f] + dz, s[ANGLE_Y + f] + dy
    p, q = s[ANGLE_2 + f] + d2, s[ANGLE_3 + f] + d3
    pz, py = inverse_squares(s, f, z, y)
    if z * z * pz + y * y * py > 1.0:
        return False
    if p < s[LOW_2 + f] or p > s[UP_2 + f] or q < s[LOW_3 + f] or q > s[UP_3 + f]:
        return False
    # the multipliers of fixed hinges must push outwards
    if s[FREE_2 + f] == 0.0:
        m = couple(s, ROW_2, f) + s[H_Z2 + f] * dz + s[H_Y2 + f] * dy + s[H_23 + f] * d3
        if (m < 0.0) == (p <= s[LOW_2 + f]):
            return False
    if s[FREE_3 + f] == 0.0:
        m = couple(s, ROW_3, f) + s[H_Z3 + f] * dz + s[H_Y3 + f] * dy + s[H_23 + f] * d2
        if (m < 0.0) == (q <= s[LOW_3 + f]):
            return False
    return True


@inline
def solve_finger(s, f):
    """The exact minimiser of finger f's quadratic model inside its limits, for the root's step.

    Hinges are free or at a bound, an active set; for each such choice the saddle's two angles
    solve a two-dimensional problem inside the ellipse. The model is convex, so a choice whose
    multipliers all push outwards is the solution.
    """
    h00, h01, h02, h03 = s[H_ZZ + f], s[H_ZY + f], s[H_Z2 + f], s[H_Z3 + f]
    h11, h12, h13 = s[H_YY + f], s[H_Y2 + f], s[H_Y3 + f]
    h22, h23, h33 = s[H_22 + f], s[H_23 + f], s[H_33 + f]
    z0, y0, p0, q0 = s[ANGLE_Z + f], s[ANGLE_Y + f], s[ANGLE_2 + f], s[ANGLE_3 + f]
    # the model in absolute angles: x H x / 2 + g x
    g0 = couple(s, ROW_Z, f) - h00 * z0 - h01 * y0 - h02 * p0 - h03 * q0
    g1 = couple(s, ROW_Y, f) - h01 * z0 - h11 * y0 - h12 * p0 - h13 * q0
    g2 = couple(s, ROW_2, f) - h02 * z0 - h12 * y0 - h22 * p0 - h23 * q0
    g3 = couple(s, ROW_3, f) - h03 * z0 - h13 * y0 - h23 * p0 - h33 * q0
    low2, up2, low3, up3 = s[LOW_2 + f], s[UP_2 + f], s[LOW_3 + f], s[UP_3 + f]
    det23 = h22 * h33 - h23 * h23

    best = math.inf
    bz, by, bp, bq, bl = z0, y0, p0, q0, -1.0
    b2 = b3 = at2 = at3 = 0  # -1 lower bound, 0 free, 1 upper bound
    for attempt in range(12):
        if attempt >= 3:
            # the active set did not settle: go through all nine choices
            at2, at3 = (attempt - 3) % 3 - 1, (attempt - 3) // 3 - 1
        # eliminate the hinges: free ones answer the saddle linearly
        p, q = low2 if at2 < 0 else up2, low3 if at3 < 0 else up3
        pz = py = qz = qy = 0.0
        if at2 == 0 and at3 == 0:
            p, q = (h23 * g3 - h33 * g2) / det23, (h23 * g2 - h22 * g3) / det23
            pz, py = (h23 * h03 - h33 * h02) / det23, (h23 * h13 - h33 * h12) / det23
            qz, qy = (h23 * h02 - h22 * h03) / det23, (h23 * h12 - h22 * h13) / det23
        elif at2 == 0:
            p, pz, py = -(g2 + h23 * q) / h22, -h02 / h22, -h12 / h22
        elif at3 == 0:
            q, qz, qy = -(g3 + h23 * p) / h33, -h03 / h33, -h13 / h33
        k00, k01 = h00 + h02 * pz + h03 * qz, h01 + h02 * py + h03 * qy
        k11 = h11 + h12 * py + h13 * qy
        c0, c1 = -(g0 + h02 * p + h03 * q), -(g1 + h12 * p + h13 * q)
        z, y, multiplier = solve_saddle(s, f, k00, k01, k11, c0, c1)
        p += pz * z + py * y
        q += qz * z + qy * y
        # violated bounds and wrong multipliers
        m2 = g2 + h02 * z + h12 * y + h22 * p + h23 * q
        m3 = g3 + h03 * z + h13 * y + h23 * p + h33 * q
        bad2 = at2 == 0 and (p < low2 or p > up2)
        bad3 = at3 == 0 and (q < low3 or q > up3)
        wrong2 = (at2 < 0 and m2 < 0.0) or (at2 > 0 and m2 > 0.0)
        wrong3 = (at3 < 0 and m3 < 0.0) or (at3 > 0 and m3 > 0.0)
        if not (bad2 or bad3):
            m0 = g0 + h00 * z + h01 * y + h02 * p + h03 * q
            m1 = g1 + h01 * z + h11 * y + h12 * p + h13 * q
            value = z * (m0 + g0) + y * (m1 + g1) + p * (m2 + g2) + q * (m3 + g3)
            if value < best:
                best = value
                bz, by, bp, bq, bl, b2, b3 = z, y, p, q, multiplier, at2, at3
            if not (wrong2 or wrong3):
                break
        if bad2:
            at2 = -1 if p < low2 else 1
        elif wrong2:
            at2 = 0
        if bad3:
            at3 = -1 if q < low3 else 1
        elif wrong3:
            at3 = 0
    s[STEP_Z + f], s[STEP_Y + f] = bz - z0, by - y0
    s[STEP_2 + f], s[STEP_3 + f] = bp - p0, bq - q0
    release(s, f)
    s[FREE_2 + f] = 1.0 if b2 == 0 else 0.0
    s[FREE_3 + f] = 1.0 if b3 == 0 else 0.0
    if bl >= 0.0:
        fix_saddle(s, f, bz, by, bl)


@inline
def solve_saddle(s, f, k00, k01, k11, c0, c1):
    """Minimiser of u K u / 2 - c u inside the saddle's ellipse, and the limit's multiplier.

    On the boundary (K + m diag(1/a^2, 1/b^2)) u = c with m >= 0 (More and Sorensen 1983); the
    quadrant, which sets a and b, follows the solution. Inside, the multiplier is -1.
    """
    det = k00 * k11 - k01 * k01
    z, y = (k11 * c0 - k01 * c1) / det, (k00 * c1 - k01 * c0) / det
    pz, py = inverse_squares(s, f, z, y)
    if z * z * pz + y * y * py <= 1.0:
        return z, y, -1.0
    m = 0.0
    for _ in range(4):
        m = 0.0
        for _ in range(40):
            # Newton on 1/|u| - 1, which is nearly linear in m and never overshoots
            a, b = k00 + m * pz, k11 + m * py
            det = a * b - k01 * k01
            z, y = (b * c0 - k01 * c1) / det, (a * c1 - k01 * c0) / det
            q = z * z * pz + y * y * py
            dz, dy = z * pz, y * py
            slope = (b * dz * dz - 2.0 * k01 * dz * dy + a * dy * dy) / det
            step = (math.sqrt(q) - 1.0) * q / slope
            # a quadrant's ellipse may hold the point that another one's does not
            m = max(m + step, 0.0)
            if abs(step) <= 1e-12 * (m + 1e-12) or (m == 0.0 and step < 0.0):
                break
        nz, ny = inverse_squares(s, f, z, y)
        if nz == pz and ny == py:
            break
        pz, py = nz, ny
    pz, py = inverse_squares(s, f, z, y)
    n = math.sqrt(z * z * pz + y * y * py)
    if n > 1.0:
        z, y = z / n, y / n
    return z, y, m
