"""Block coordinate descent (Li et al. 2021, Algorithm 1), on the workspace.

The blocks here are constrained minimisers, so no sweep raises the objective; the paper's own
updates are in `li2021.py`. Under a robust loss the joints are reweighted before every block,
by the slope of the loss, which keeps that true (the loss is concave in the squared distance).
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.joint_objective import NOTHING, place
from handtrack.kernels.limits import inside_ellipse, saddle_limits, semi_axes
from handtrack.kernels.losses import NO_LOSS
from handtrack.kernels.pose_steps import clear_step, keep_pose, take_step
from handtrack.kernels.procrustes import procrustes
from handtrack.kernels.vectors import (
    ZERO,
    ZERO3,
    add,
    apply,
    cross,
    dot,
    lane,
    outer_sum,
    put_part,
    put_row,
    rotate,
    scale,
    sub,
    unit_cos_sin,
)
from handtrack.kernels.workspace import (
    ABDUCTION,
    BASE,
    CONVERGED,
    FINGERS,
    FLEXION,
    HINGE_1,
    HINGE_2,
    JOINTS,
    LIMIT,
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
def saddle_value(k, cz, sz, cy, sy):
    """sum_i w_i b_i . exp(n_z z) exp(n_y y) a_i, from its 3x3 coefficients k (rows)."""
    v = (1.0, cy, sy)
    return dot(k[0], v) + cz * dot(k[1], v) + sz * dot(k[2], v)


@inline
def boundary_slopes(k, s, limits):
    """Value and two derivatives of the saddle's objective along its ellipse at parameter s."""
    cs, sn = math.cos(s), math.sin(s)
    a, b = semi_axes(limits, cs, sn)
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
def best_on_ellipse(k, limits):
    """The angles on the ellipse's boundary that maximise the saddle's objective."""
    n = 16
    h = 2 * math.pi / n
    best, best_f = 0.0, -math.inf
    for i in range(n):
        f, _, _ = boundary_slopes(k, h * i, limits)
        if f > best_f:
            best, best_f = h * i, f
    low, high, s = best - h, best + h, best
    for _ in range(50):
        _, first, second = boundary_slopes(k, s, limits)
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
    a, b = semi_axes(limits, cs, sn)
    return a * cs, b * sn


@inline
def best_saddle(k, z, y, limits):
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
    if not inside_ellipse(limits, new_z, new_y):
        new_z, new_y = best_on_ellipse(k, limits)
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
    k = ZERO3
    for i in range(3):
        k = saddle_coefficients(nz, ny, w[i], t[i], a[i], k)
    return best_saddle(k, z, y, limits)


@inline
def hinge_exact(n, w, t, a, lower, upper, current):
    """Angle of a hinge about n that brings vectors a onto targets t, inside its limits."""
    c = s = 0.0
    for i in range(2):
        c += w[i] * (dot(t[i], a[i]) - dot(t[i], n) * dot(a[i], n))
        s += w[i] * dot(t[i], cross(n, a[i]))
    return best_hinge(c, s, lower, upper, current)


@inline
def seen_from_saddle(w, f, j, x):
    """Target j from joint x, in the frame that the saddle gives it."""
    z, y = w.angle[FLEXION, f], w.angle[ABDUCTION, f]
    t = sub(lane(w.seen, j, f), x)
    t = rotate(lane(w.rest_axis, FLEXION, f), math.cos(z), -math.sin(z), t)
    return rotate(lane(w.rest_axis, ABDUCTION, f), math.cos(y), -math.sin(y), t)


def finger_pass(update_saddle, update_hinge):
    """A compiled pass over one finger in tree order, with these updates of its joints."""

    @inline
    def turn_saddle(w, f):
        """The saddle: all three joints beyond it turn rigidly with it."""
        x, pulls = lane(w.joint, BASE, f), (w.pull[1, f], w.pull[2, f], w.pull[3, f])
        p, q = w.angle[HINGE_1, f], w.angle[HINGE_2, f]
        first, second = lane(w.rest_axis, HINGE_1, f), lane(w.rest_axis, HINGE_2, f)
        b1, b2, b3 = lane(w.rest_bone, 0, f), lane(w.rest_bone, 1, f), lane(w.rest_bone, 2, f)
        o1, o2, o3 = lane(w.rest_offset, 1, f), lane(w.rest_offset, 2, f), lane(w.rest_offset, 3, f)
        c, s = math.cos(p), math.sin(p)
        a1, a2 = add(b1, o1), add(b1, rotate(first, c, s, add(b2, o2)))
        a3 = add(b2, rotate(second, math.cos(q), math.sin(q), add(b3, o3)))
        a3 = add(b1, rotate(first, c, s, a3))
        targets = (
            sub(lane(w.seen, 1, f), x),
            sub(lane(w.seen, 2, f), x),
            sub(lane(w.seen, 3, f), x),
        )
        nz, ny = lane(w.rest_axis, FLEXION, f), lane(w.rest_axis, ABDUCTION, f)
        z, y = w.angle[FLEXION, f], w.angle[ABDUCTION, f]
        z, y = update_saddle(nz, ny, pulls, targets, (a1, a2, a3), z, y, saddle_limits(w, f))
        w.angle[FLEXION, f], w.angle[ABDUCTION, f] = z, y

    @inline
    def turn_hinges(w, f):
        """The two hinges, one after the other."""
        z, y = w.angle[FLEXION, f], w.angle[ABDUCTION, f]
        first, second = lane(w.rest_axis, HINGE_1, f), lane(w.rest_axis, HINGE_2, f)
        b1, b2, b3 = lane(w.rest_bone, 0, f), lane(w.rest_bone, 1, f), lane(w.rest_bone, 2, f)
        b1 = rotate(lane(w.rest_axis, ABDUCTION, f), math.cos(y), math.sin(y), b1)
        b1 = rotate(lane(w.rest_axis, FLEXION, f), math.cos(z), math.sin(z), b1)
        o2, o3 = lane(w.rest_offset, 2, f), lane(w.rest_offset, 3, f)
        x = add(lane(w.joint, BASE, f), b1)
        t2, t3 = seen_from_saddle(w, f, 2, x), seen_from_saddle(w, f, 3, x)
        p, q = w.angle[HINGE_1, f], w.angle[HINGE_2, f]
        e3 = add(b3, o3)
        a2, a3 = add(b2, o2), add(b2, rotate(second, math.cos(q), math.sin(q), e3))
        pulls, low, up = (w.pull[2, f], w.pull[3, f]), w.lower[HINGE_1, f], w.upper[HINGE_1, f]
        p = update_hinge(first, pulls, (t2, t3), (a2, a3), low, up, p)
        w.angle[HINGE_1, f] = p
        if pulls[1] <= 0.0:
            return
        t3 = sub(rotate(first, math.cos(p), -math.sin(p), t3), b2)
        low, up = w.lower[HINGE_2, f], w.upper[HINGE_2, f]
        q = update_hinge(second, (pulls[1], 0.0), (t3, t3), (e3, e3), low, up, q)
        w.angle[HINGE_2, f] = q

    @inline
    def update_finger(w, f):
        if w.pull[1, f] + w.pull[2, f] + w.pull[3, f] <= 0.0:
            return
        turn_saddle(w, f)
        if w.pull[2, f] + w.pull[3, f] > 0.0:
            turn_hinges(w, f)

    return update_finger


@inline
def update_root(w):
    """The best rigid transform of the placed landmarks onto the targets (Kabsch, barycentres)."""
    total, x0, y0 = 0.0, ZERO, ZERO
    for j in range(JOINTS):
        for f in range(FINGERS + 1):
            pull = w.pull[j, f]
            total += pull
            x0 = add(x0, scale(pull, lane(w.mark, j, f)))
            y0 = add(y0, scale(pull, lane(w.target, j, f)))
    x0, y0 = scale(1.0 / total, x0), scale(1.0 / total, y0)
    m = ZERO3
    for j in range(JOINTS):
        for f in range(FINGERS + 1):
            y, x = sub(lane(w.target, j, f), y0), sub(lane(w.mark, j, f), x0)
            m = outer_sum(m, w.pull[j, f], y, x)
    r = procrustes(m)
    for i in range(3):
        put_row(w.rotation, i, r[i])
    put_part(w.translation, 0, sub(y0, apply(r, x0)))


def descent(update_finger):
    """Algorithm 1, compiled with this pass over a finger."""

    @inline
    def find_root(w):
        """A first root: one that means nothing yet must not weigh the joints."""
        loss, w.loss = w.loss, NO_LOSS
        place(w)
        update_root(w)
        w.loss = loss
        w.cold = 0

    @inline
    def descend(w):
        best = last = math.inf
        state, sweeps = LIMIT, 0.0
        clear_step(w)
        if w.cold:
            find_root(w)
        place(w)
        while True:
            update_root(w)
            cost = place(w)
            if cost < best:
                best = cost
                keep_pose(w)
            if last - cost <= w.tolerance * cost or cost < NOTHING:
                state = CONVERGED
                break
            if sweeps == w.max_sweeps:
                break
            last = cost
            for f in range(FINGERS):
                update_finger(w, f)
            place(w)
            sweeps += 1.0
        # the paper's updates may have raised the objective since
        take_step(w, 0.0)
        w.objective = best
        w.state = state
        w.sweeps += sweeps

    return descend


update_finger_exact = finger_pass(saddle_exact, hinge_exact)
_descend = descent(update_finger_exact)


@Solver
def bcd_exact(w):
    """Algorithm 1 with exact updates, from the pose in the workspace.

    In the workspace: `max_sweeps` at most; `tolerance`, to stop when a sweep improves the
    objective by less than this share of it. Adds to `sweeps`; sets `objective`, and `state` to
    CONVERGED or LIMIT. The best pose seen stays.
    """
    _descend(w)
