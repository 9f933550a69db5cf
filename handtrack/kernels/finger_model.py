"""One finger's quadratic model inside its limits, solved exactly.

Limits: a box for the two hinges, the ellipse for the saddle. The face that holds the solution
(which hinges are at a bound, where on the ellipse the saddle is) goes into the root's Schur
complement. The model is (16) x.H x / 2 + g.x in absolute angles x = (z, y, p, q): flexion,
abduction and the hinges; g is `origin_slope`.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.faces import fix_saddle, release, slope_with_root
from handtrack.kernels.limits import inverse_squares
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    FLEXION,
    HINGE_1,
    HINGE_2,
)

# where a hinge is
LOWER, FREE, UPPER = -1, 0, 1
# the active set settles in so many attempts, or all nine choices of the two hinges are tried
_SETTLE, _CHOICES = 3, 9
# the multiplier where no limit holds the saddle
INSIDE = -1.0


@inline
def solve_finger(w, f):
    """The exact minimiser of finger f's quadratic model inside its limits, for the root's step.

    Hinges are free or at a bound, an active set; for each such choice the saddle's two angles
    solve a two-dimensional problem inside the ellipse. The model is convex, so a choice whose
    multipliers all push outwards is the solution.
    """
    set_origin(w, f)
    best, value = (0.0, 0.0, 0.0, 0.0), math.inf
    best_multiplier, best_1, best_2 = INSIDE, FREE, FREE
    at_1 = at_2 = FREE
    for attempt in range(_SETTLE + _CHOICES):
        if attempt >= _SETTLE:
            # the active set did not settle
            choice = attempt - _SETTLE
            at_1, at_2 = choice % 3 - 1, choice // 3 - 1
        x, multiplier = solve_choice(w, f, at_1, at_2)
        out_1, wrong_1 = check_multipliers(w, f, HINGE_1, at_1, x, x[HINGE_1])
        out_2, wrong_2 = check_multipliers(w, f, HINGE_2, at_2, x, x[HINGE_2])
        if out_1 == FREE and out_2 == FREE:
            new = model_value(w, f, x)
            if new < value:
                value, best = new, x
                best_multiplier, best_1, best_2 = multiplier, at_1, at_2
            if not (wrong_1 or wrong_2):
                break
        at_1 = out_1 if out_1 != FREE else (FREE if wrong_1 else at_1)
        at_2 = out_2 if out_2 != FREE else (FREE if wrong_2 else at_2)
    if value == math.inf:
        best = (w.angle[0, f], w.angle[1, f], w.angle[2, f], w.angle[3, f])
    take_answer(w, f, best, best_multiplier, best_1, best_2)


@inline
def set_origin(w, f):
    """(16) g = slope - H x_0: the gradient of the model carried to zero angles."""
    for a in range(ANGLES):
        g = slope_with_root(w, a, f)
        for b in range(ANGLES):
            g -= w.hessian[a, b, f] * w.angle[b, f]
        w.origin_slope[a] = g


@inline
def model_slope(w, f, a, x):
    """The model's derivative by angle a at x."""
    h = w.hessian
    v = h[a, 0, f] * x[0] + h[a, 1, f] * x[1] + h[a, 2, f] * x[2] + h[a, 3, f] * x[3]
    return w.origin_slope[a] + v


@inline
def model_value(w, f, x):
    """Twice the model at x."""
    g = w.origin_slope
    value = x[0] * (model_slope(w, f, 0, x) + g[0]) + x[1] * (model_slope(w, f, 1, x) + g[1])
    value += x[2] * (model_slope(w, f, 2, x) + g[2]) + x[3] * (model_slope(w, f, 3, x) + g[3])
    return value


@inline
def eliminate_hinges(w, f, at_1, at_2):
    """How the hinges answer the saddle (17): p = p_0 + p_z z + p_y y, and q alike.

    A hinge at a bound stays; a free one minimises the model, so its row of H x + g is zero.
    Returns (p_0, p_z, p_y), (q_0, q_z, q_y).
    """
    h, g = w.hessian, w.origin_slope
    hz1, hz2 = h[FLEXION, HINGE_1, f], h[FLEXION, HINGE_2, f]
    hy1, hy2 = h[ABDUCTION, HINGE_1, f], h[ABDUCTION, HINGE_2, f]
    h11, h12, h22 = h[HINGE_1, HINGE_1, f], h[HINGE_1, HINGE_2, f], h[HINGE_2, HINGE_2, f]
    p = w.lower[HINGE_1, f] if at_1 == LOWER else w.upper[HINGE_1, f]
    q = w.lower[HINGE_2, f] if at_2 == LOWER else w.upper[HINGE_2, f]
    first, second = (p, 0.0, 0.0), (q, 0.0, 0.0)
    if at_1 == FREE and at_2 == FREE:
        det = h11 * h22 - h12 * h12
        g1, g2 = g[HINGE_1], g[HINGE_2]
        first = (
            (h12 * g2 - h22 * g1) / det,
            (h12 * hz2 - h22 * hz1) / det,
            (h12 * hy2 - h22 * hy1) / det,
        )
        second = (
            (h12 * g1 - h11 * g2) / det,
            (h12 * hz1 - h11 * hz2) / det,
            (h12 * hy1 - h11 * hy2) / det,
        )
    elif at_1 == FREE:
        first = (-(g[HINGE_1] + h12 * q) / h11, -hz1 / h11, -hy1 / h11)
    elif at_2 == FREE:
        second = (-(g[HINGE_2] + h12 * p) / h22, -hz2 / h22, -hy2 / h22)
    return first, second


@inline
def solve_choice(w, f, at_1, at_2):
    """Least angles with the hinges as chosen, and the multiplier of the saddle's limit."""
    h, g = w.hessian, w.origin_slope
    first, second = eliminate_hinges(w, f, at_1, at_2)
    hz1, hz2 = h[FLEXION, HINGE_1, f], h[FLEXION, HINGE_2, f]
    hy1, hy2 = h[ABDUCTION, HINGE_1, f], h[ABDUCTION, HINGE_2, f]
    # (18) the saddle's own 2 x 2 model after that
    kzz = h[FLEXION, FLEXION, f] + hz1 * first[1] + hz2 * second[1]
    kzy = h[FLEXION, ABDUCTION, f] + hz1 * first[2] + hz2 * second[2]
    kyy = h[ABDUCTION, ABDUCTION, f] + hy1 * first[2] + hy2 * second[2]
    cz = -(g[FLEXION] + hz1 * first[0] + hz2 * second[0])
    cy = -(g[ABDUCTION] + hy1 * first[0] + hy2 * second[0])
    z, y, multiplier = solve_saddle(w, f, kzz, kzy, kyy, cz, cy)
    p = first[0] + first[1] * z + first[2] * y
    q = second[0] + second[1] * z + second[2] * y
    return (z, y, p, q), multiplier


@inline
def check_multipliers(w, f, hinge, at, x, angle):
    """Which bound a free hinge has left (FREE: none), and whether a held one pulls inwards."""
    if at == FREE:
        if angle < w.lower[hinge, f]:
            return LOWER, False
        return (UPPER, False) if angle > w.upper[hinge, f] else (FREE, False)
    slope = model_slope(w, f, hinge, x)
    return FREE, slope < 0.0 if at == LOWER else slope > 0.0


@inline
def take_answer(w, f, x, multiplier, at_1, at_2):
    """The answer as the finger's step, and its face."""
    w.step[FLEXION, f], w.step[ABDUCTION, f] = x[0] - w.angle[0, f], x[1] - w.angle[1, f]
    w.step[HINGE_1, f], w.step[HINGE_2, f] = x[2] - w.angle[2, f], x[3] - w.angle[3, f]
    release(w, f)
    w.free[HINGE_1, f] = 1.0 if at_1 == FREE else 0.0
    w.free[HINGE_2, f] = 1.0 if at_2 == FREE else 0.0
    if multiplier >= 0.0:
        fix_saddle(w, f, x[0], x[1], multiplier)


@inline
def solve_saddle(w, f, kzz, kzy, kyy, cz, cy):
    """Minimiser of u K u / 2 - c u inside the saddle's ellipse, and the limit's multiplier.

    (19) On the boundary (K + m diag(1/a^2, 1/b^2)) u = c with m >= 0 (More and Sorensen 1983);
    the quadrant, which sets a and b, follows the solution. Else the multiplier is INSIDE.
    """
    det = kzz * kyy - kzy * kzy
    z, y = (kyy * cz - kzy * cy) / det, (kzz * cy - kzy * cz) / det
    pz, py = inverse_squares(w, f, z, y)
    if z * z * pz + y * y * py <= 1.0:
        return z, y, INSIDE
    m = 0.0
    for _ in range(4):
        z, y, m = climb_to_boundary(kzz, kzy, kyy, cz, cy, pz, py)
        nz, ny = inverse_squares(w, f, z, y)
        if nz == pz and ny == py:
            break
        pz, py = nz, ny
    pz, py = inverse_squares(w, f, z, y)
    n = math.sqrt(z * z * pz + y * y * py)
    if n > 1.0:
        z, y = z / n, y / n
    return z, y, m


@inline
def climb_to_boundary(kzz, kzy, kyy, cz, cy, pz, py):
    """(20) The multiplier m at which |u(m)| = 1 in the ellipse's measure, and u.

    Newton on 1/|u| - 1, which is nearly linear in m and never overshoots.
    """
    z = y = m = 0.0
    for _ in range(40):
        a, b = kzz + m * pz, kyy + m * py
        det = a * b - kzy * kzy
        z, y = (b * cz - kzy * cy) / det, (a * cy - kzy * cz) / det
        q = z * z * pz + y * y * py
        dz, dy = z * pz, y * py
        slope = (b * dz * dz - 2.0 * kzy * dz * dy + a * dy * dy) / det
        step = (math.sqrt(q) - 1.0) * q / slope
        # a quadrant's ellipse may hold the point that another one's does not
        m = max(m + step, 0.0)
        if abs(step) <= 1e-12 * (m + 1e-12) or (m == 0.0 and step < 0.0):
            break
    return z, y, m
