"""Block coordinate descent (Li et al. 2021, Algorithm 1), on the fitter's buffer.

The blocks here are constrained minimisers, so no sweep raises the objective; the paper's own
updates are in `li2021.py`. Under a robust loss the joints are reweighted before every block,
by the slope of the loss, which keeps that true (the loss is concave in the squared distance).
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import Solver, inline
from handtrack.fitting.lanes import (
    ANGLE_2,
    ANGLE_3,
    ANGLE_Y,
    ANGLE_Z,
    B1,
    B2,
    B3,
    COLD,
    CONVERGED,
    L1,
    L2,
    L3,
    L4,
    LANES,
    LIMIT,
    LOSS,
    LOW_2,
    LOW_3,
    LOW_Y,
    LOW_Z,
    MAX_SWEEPS,
    N2,
    N3,
    NO_LOSS,
    NY,
    NZ,
    OBJECTIVE,
    ROOT,
    STATE,
    SWEEPS,
    T1,
    TOLERANCE,
    UP_2,
    UP_3,
    UP_Y,
    UP_Z,
    VECTOR,
    X1,
    X2,
    Y2,
    Y3,
    Y4,
    get,
    place,
)
from handtrack.fitting.newton import NOTHING, clear_step, keep_pose, take_step
from handtrack.fitting.procrustes import ZERO3, outer_sum, procrustes
from handtrack.fitting.vectors import (
    add,
    apply,
    cross,
    dot,
    rotate,
    scale,
    sub,
    unit_cos_sin,
)


@inline
def hinge_value(c, s, phi):
    return c * math.cos(phi) + s * math.sin(phi)


@inline
def best_hinge(c, s, lower, upper, current):
    """The angle in lower..upper that maximises c cos(phi) + s sin(phi)."""
    if c * c + s * s < 1e-300:
        return current  # nothing observes this angle
    phi = math.atan2(s, c)
    if lower <= phi <= upper:
        return phi
    # outside: the bound nearer on the circle
    return lower if hinge_value(c, s, lower) > hinge_value(c, s, upper) else upper


@inline
def semi_axis(lower, upper, positive):
    return upper if positive else -lower


@inline
def inside_ellipse(z, y, lz, uz, ly, uy):
    """Whether a saddle's angles keep the limits of eq. 3."""
    p = z / semi_axis(lz, uz, z >= 0.0)
    q = y / semi_axis(ly, uy, y >= 0.0)
    return p * p + q * q <= 1.0


@inline
def saddle_value(k, cz, sz, cy, sy):
    """sum_i w_i b_i . exp(n_z z) exp(n_y y) a_i, from its 3x3 coefficients k (rows)."""
    v = (1.0, cy, sy)
    return dot(k[0], v) + cz * dot(k[1], v) + sz * dot(k[2], v)


@inline
def boundary_slopes(k, s, lz, uz, ly, uy):
    """Value and two derivatives of the saddle's objective along its ellipse at parameter s."""
    cs, sn = math.cos(s), math.sin(s)
    a = semi_axis(lz, uz, cs >= 0.0)
    b = semi_axis(ly, uy, sn >= 0.0)
    z, y = a * cs, b * sn
    cz, sz, cy, sy = math.cos(z), math.sin(z), math.cos(y), math.sin(y)
    v, dv, ddv = (1.0, cy, sy), (0.0, -sy, cy), (0.0, -cy, -sy)
    p, q, o = dot(k[1], v), dot(k[2], v), dot(k[0], v)
    dp, dq, do = dot(k[1], dv), dot(k[2], dv), dot(k[0], dv)
    f = o + cz * p + sz * q
    fz, fzz = -sz * p + cz * q, -cz * p - sz * q
    fy, fzy = do + cz * dp + sz * dq, -sz * dp + cz * dq
    fyy = dot(k[0], ddv) + cz * dot(k[1], ddv) + sz * dot(k[2], ddv)
    z1, y1 = -a * sn, b * cs
    first = fz * z1 + fy * y1
    second = fzz * z1 * z1 + 2 * fzy * z1 * y1 + fyy * y1 * y1 - fz * z - fy * y
    return f, first, second


@inline
def best_on_ellipse(k, lz, uz, ly, uy):
    """The angles on the ellipse's boundary that maximise the saddle's objective."""
    n = 16
    h = 2 * math.pi / n
    best, best_f = 0.0, -math.inf
    for i in range(n):
        f, _, _ = boundary_slopes(k, h * i, lz, uz, ly, uy)
        if f > best_f:
            best, best_f = h * i, f
    low, high, s = best - h, best + h, best
    for _ in range(50):
        _, first, second = boundary_slopes(k, s, lz, uz, ly, uy)
        if first > 0.0:
            low = s
        else:
            high = s
        # Newton where it stays in the bracket, else halve it
        new = s - first / second if second < 0.0 else high + 1.0
        if not low < new < high:
            new = 0.5 * (low + high)
        done = abs(new - s) < 1e-13
        s = new
        if done:
            break
    cs, sn = math.cos(s), math.sin(s)
    return semi_axis(lz, uz, cs >= 0.0) * cs, semi_axis(ly, uy, sn >= 0.0) * sn


@inline
def best_saddle(k, z, y, lz, uz, ly, uy):
    """The angles inside the ellipse that maximise the saddle's objective, from (z, y).

    Each angle has a closed form for the other one fixed; the two alternate. Both moves climb
    a sinusoid, so where they leave the ellipse its boundary holds a better point.
    """
    cz, sz, cy, sy = math.cos(z), math.sin(z), math.cos(y), math.sin(y)
    before = saddle_value(k, cz, sz, cy, sy)
    for _ in range(50):
        oz, oy = sz, sy
        v = (1.0, cy, sy)
        cz, sz = unit_cos_sin(dot(k[1], v), dot(k[2], v))
        cy, sy = unit_cos_sin(
            k[0][1] + cz * k[1][1] + sz * k[2][1], k[0][2] + cz * k[1][2] + sz * k[2][2]
        )
        if abs(sz - oz) + abs(sy - oy) < 1e-12:
            break
    new_z, new_y = math.atan2(sz, cz), math.atan2(sy, cy)
    if not inside_ellipse(new_z, new_y, lz, uz, ly, uy):
        new_z, new_y = best_on_ellipse(k, lz, uz, ly, uy)
    after = saddle_value(k, math.cos(new_z), math.sin(new_z), math.cos(new_y), math.sin(new_y))
    return (new_z, new_y) if after > before else (z, y)


@inline
def saddle_coefficients(nz, ny, w, b, a, k):
    """k + the coefficients that one pair of vectors adds to the saddle's objective.

    exp(n phi) = n n^T + cos(phi) (1 - n n^T) + sin(phi) [n]x on both sides of the product.
    """
    az = scale(dot(ny, a), ny)
    a1, a2 = sub(a, az), cross(ny, a)
    bz = scale(dot(nz, b), nz)
    b1, b2 = sub(b, bz), cross(b, nz)
    return (
        add(k[0], scale(w, (dot(bz, az), dot(bz, a1), dot(bz, a2)))),
        add(k[1], scale(w, (dot(b1, az), dot(b1, a1), dot(b1, a2)))),
        add(k[2], scale(w, (dot(b2, az), dot(b2, a1), dot(b2, a2)))),
    )


@inline
def saddle_exact(nz, ny, w, t, a, z, y, limits):
    """Angles of a saddle that bring vectors a onto targets t, inside its ellipse."""
    k = saddle_coefficients(nz, ny, w[0], t[0], a[0], ZERO3)
    k = saddle_coefficients(nz, ny, w[1], t[1], a[1], k)
    k = saddle_coefficients(nz, ny, w[2], t[2], a[2], k)
    return best_saddle(k, z, y, limits[0], limits[1], limits[2], limits[3])


@inline
def hinge_exact(n, w, t, a, lower, upper, current):
    """Angle of a hinge about n that brings vectors a onto targets t, inside its limits."""
    c = w[0] * (dot(t[0], a[0]) - dot(t[0], n) * dot(a[0], n))
    c += w[1] * (dot(t[1], a[1]) - dot(t[1], n) * dot(a[1], n))
    s = w[0] * dot(t[0], cross(n, a[0])) + w[1] * dot(t[1], cross(n, a[1]))
    return best_hinge(c, s, lower, upper, current)


def finger_pass(update_saddle, update_hinge):
    """A compiled pass over one finger in tree order, with these updates of its joints."""

    @inline
    def update_finger(s, f):
        nz, ny, n2, n3 = get(s, NZ + f), get(s, NY + f), get(s, N2 + f), get(s, N3 + f)
        x1, b1, b2, b3 = get(s, X1 + f), get(s, B1 + f), get(s, B2 + f), get(s, B3 + f)
        w1, w2, w3 = s[L2 + f], s[L3 + f], s[L4 + f]
        y1, y2, y3 = get(s, Y2 + f), get(s, Y3 + f), get(s, Y4 + f)
        if w1 + w2 + w3 <= 0.0:
            return

        # saddle: all three joints beyond it turn rigidly with it
        p, q = s[ANGLE_2 + f], s[ANGLE_3 + f]
        v3 = rotate(n3, math.cos(q), math.sin(q), b3)
        c2, s2 = math.cos(p), math.sin(p)
        a2 = add(b1, rotate(n2, c2, s2, b2))
        a3 = add(b1, rotate(n2, c2, s2, add(b2, v3)))
        t1, t2, t3 = sub(y1, x1), sub(y2, x1), sub(y3, x1)
        z, y = s[ANGLE_Z + f], s[ANGLE_Y + f]
        limits = (s[LOW_Z + f], s[UP_Z + f], s[LOW_Y + f], s[UP_Y + f])
        z, y = update_saddle(nz, ny, (w1, w2, w3), (t1, t2, t3), (b1, a2, a3), z, y, limits)
        s[ANGLE_Z + f], s[ANGLE_Y + f] = z, y
        if w2 + w3 <= 0.0:
            return

        # first hinge, in the frame that the saddle now gives it
        cz, sz, cy, sy = math.cos(z), math.sin(z), math.cos(y), math.sin(y)
        x2 = add(x1, rotate(nz, cz, sz, rotate(ny, cy, sy, b1)))
        t2 = rotate(ny, cy, -sy, rotate(nz, cz, -sz, sub(y2, x2)))
        t3 = rotate(ny, cy, -sy, rotate(nz, cz, -sz, sub(y3, x2)))
        low, up = s[LOW_2 + f], s[UP_2 + f]
        p = update_hinge(n2, (w2, w3), (t2, t3), (b2, add(b2, v3)), low, up, p)
        s[ANGLE_2 + f] = p
        if w3 <= 0.0:
            return

        # second hinge
        t3 = sub(rotate(n2, math.cos(p), -math.sin(p), t3), b2)
        low, up = s[LOW_3 + f], s[UP_3 + f]
        s[ANGLE_3 + f] = update_hinge(n3, (w3, 0.0), (t3, t3), (b3, b3), low, up, q)

    return update_finger


@inline
def update_root(s):
    """The best rigid transform of the placed joints onto the targets (Kabsch, barycentres)."""
    total = 0.0
    a0 = b0 = (0.0, 0.0, 0.0)
    for j in range(4):
        x = X1 if j == 0 else X2 + (j - 1) * VECTOR
        for f in range(6):
            w = s[L1 + j * LANES + f]
            total += w
            a0 = add(a0, scale(w, get(s, x + f)))
            b0 = add(b0, scale(w, get(s, T1 + j * VECTOR + f)))
    a0 = scale(1.0 / total, a0)
    b0 = scale(1.0 / total, b0)
    m = ZERO3
    for j in range(4):
        x = X1 if j == 0 else X2 + (j - 1) * VECTOR
        for f in range(6):
            b = sub(get(s, T1 + j * VECTOR + f), b0)
            m = outer_sum(m, s[L1 + j * LANES + f], b, sub(get(s, x + f), a0))
    r = procrustes(m)
    t = sub(b0, apply(r, a0))
    for i in range(3):
        for j in range(3):
            s[ROOT + 3 * i + j] = r[i][j]
        s[ROOT + 9 + i] = t[i]


def descent(update_finger):
    """Algorithm 1, compiled with this pass over a finger."""

    @inline
    def descend(s):
        best = last = math.inf
        state = LIMIT
        sweeps = 0.0
        clear_step(s)
        if s[COLD]:
            # a root that means nothing yet must not weigh the joints
            loss, s[LOSS] = s[LOSS], NO_LOSS
            place(s)
            update_root(s)
            s[LOSS] = loss
            s[COLD] = 0.0
        place(s)
        while True:
            update_root(s)
            cost = place(s)
            if cost < best:
                best = cost
                keep_pose(s)
            if last - cost <= s[TOLERANCE] * cost or cost < NOTHING:
                state = CONVERGED
                break
            if sweeps == s[MAX_SWEEPS]:
                break
            last = cost
            for f in range(5):
                update_finger(s, f)
            place(s)
            sweeps += 1.0
        # the paper's updates may have raised the objective since
        take_step(s, 0.0)
        s[OBJECTIVE] = best
        s[STATE] = state
        s[SWEEPS] += sweeps

    return descend


update_finger_exact = finger_pass(saddle_exact, hinge_exact)
_descend = descent(update_finger_exact)


@Solver
def bcd_exact(s):
    """Algorithm 1 with exact updates, from the pose in the buffer.

    In the buffer: MAX_SWEEPS at most; TOLERANCE, to stop when a sweep improves the objective
    by less than this share of it. Adds to SWEEPS; sets OBJECTIVE and STATE to CONVERGED or
    LIMIT. The best pose seen stays.
    """
    _descend(s)
