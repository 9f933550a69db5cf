"""Bones that would sink into each other, moved apart inside the fit (Li et al. 2021).

The paper moves two capsules apart along the line between them, after the fit. Here what they
sink in enters the objective, HARD times its square, so that the joints and the limits have
their say in who gives way. Few frames need it; Gauss-Newton on all 26 unknowns does, from the
fit without it.
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.fitting.arrowhead import root_hessian
from handtrack.fitting.compiled import Solver, inline
from handtrack.fitting.dense import factor, hold_faces, leave_faces, solve_one
from handtrack.fitting.fingers import guess_faces
from handtrack.fitting.information import assemble
from handtrack.fitting.lanes import (
    CONTACTS,
    NZ,
    OBJECTIVE,
    PAIR,
    RHO,
    ROW,
    ROW_Z,
    STEPS,
    TWIST,
    U2,
    U3,
    UX,
    UY,
    VECTOR,
    WRIST,
    X1,
    X2,
    X3,
    G,
    differentiate,
    get,
    place,
)
from handtrack.fitting.newton import keep_pose, take_step
from handtrack.fitting.vectors import add, cross, dot, scale, sub

HARD = 50.0
"""Weight of a depth of two capsules beside the distance of a joint."""

_STEPS = 30
# a step that promises less than this share of the objective is the last one
_ENOUGH = 1e-6
# [m^2] what keeps an angle that neither joints nor contacts move
_RIDGE = 1e-7


@inline
def ends(s, bone, share):
    """The ends of a capsule's axis in the root frame: that part of its bone, from the base."""
    first, last = X1 + WRIST, X1 + bone - 14
    if bone < 15:
        f, i = bone // 3, bone % 3
        first = X1 + f if i == 0 else X2 + (i - 1) * VECTOR + f
        last = X2 + i * VECTOR + f
    x = get(s, first)
    return x, add(x, scale(share, sub(get(s, last), x)))


@inline
def unit_clip(x):
    return min(max(x, 0.0), 1.0)


@inline
def nearest(p0, p1, q0, q1):
    """The points of segments p0-p1 and q0-q1 that are nearest to each other."""
    u, v, w = sub(p1, p0), sub(q1, q0), sub(p0, q0)
    a, b, c = dot(u, u), dot(u, v), dot(v, v)
    d, e = dot(u, w), dot(v, w)
    det = a * c - b * b
    # parallel ones: any point will do
    t = unit_clip((a * e - b * d) / det) if det > 1e-12 * a * c else 0.5
    # each is nearest to the other one; a clipped end moves the other point once more
    r = unit_clip((b * t - d) / a)
    t = unit_clip((b * r + e) / c)
    r = unit_clip((b * t - d) / a)
    return add(p0, scale(r, u)), add(q0, scale(t, v))


@inline
def slopes(s, bone, x, n, row):
    """Add to row (20,) how each angle moves point x of a capsule along n."""
    if bone >= 15:
        return
    f, i = bone // 3, bone % 3
    x1 = cross(sub(x, get(s, X1 + f)), n)
    row[4 * f] += dot(get(s, NZ + f), x1)
    row[4 * f + 1] += dot(add(get(s, UY + f), scale(s[TWIST + f], get(s, UX + f))), x1)
    if i > 0:
        row[4 * f + 2] += dot(get(s, U2 + f), cross(sub(x, get(s, X2 + f)), n))
    if i > 1:
        row[4 * f + 3] += dot(get(s, U3 + f), cross(sub(x, get(s, X3 + f)), n))


@inline
def weigh_contacts(s, g, h, slope):
    """HARD times the sum of the squared depths, of the placed pose.

    With `slope` the gradient and Gauss-Newton Hessian of its half are added to g and h.
    """
    total = 0.0
    row = np.empty(20)
    for c in range(int(s[CONTACTS])):
        k = CONTACTS + 1 + PAIR * c
        first, second, reach = int(s[k]), int(s[k + 1]), s[k + 2]
        p0, p1 = ends(s, first, s[k + 3])
        q0, q1 = ends(s, second, s[k + 4])
        p, q = nearest(p0, p1, q0, q1)
        away = sub(p, q)
        distance = math.sqrt(dot(away, away))
        depth = reach - distance
        if depth <= 0.0:
            continue
        total += HARD * depth * depth
        if slope:
            if distance < 1e-9:
                # bones that cross: apart at right angles to both
                away = cross(sub(p1, p0), sub(q1, q0))
                distance = math.sqrt(dot(away, away)) + 1e-300
            n = scale(-1.0 / distance, away)
            for i in range(20):
                row[i] = 0.0
            slopes(s, first, p, n, row)
            slopes(s, second, q, scale(-1.0, n), row)
            for i in range(20):
                if row[i] != 0.0:
                    v = HARD * row[i]
                    g[i] += v * depth
                    for j in range(20):
                        h[i, j] += v * row[j]
    return total


@Solver
def move_apart(s):
    """From the pose in the buffer to the least of the objective with the contacts in it.

    Sets OBJECTIVE to the joints' part; adds to STEPS. The sum is never higher than before, and
    a pose without contacts stays as it is.
    """
    g, x = np.zeros(26), np.zeros(26)
    h, u = np.zeros((26, 26)), np.zeros((26, 26))
    joints = place(s)
    s[OBJECTIVE] = joints
    bumps = weigh_contacts(s, g, h, False)
    if bumps == 0.0:
        return
    for _ in range(_STEPS):
        differentiate(s, 0.0)
        root_hessian(s)
        assemble(s, g, h)
        weigh_contacts(s, g, h, True)
        for f in range(5):
            for i in range(4):
                s[ROW_Z + i * ROW + G + f] = g[4 * f + i]
        guess_faces(s)
        for i in range(26):
            x[i] = -g[i]
            h[i, i] += _RIDGE
        hold_faces(s, h, x)
        factor(h, u)
        solve_one(u, x)
        leave_faces(s, x)
        promise = 0.0
        for i in range(26):
            promise -= g[i] * x[i]
        if not promise > _ENOUGH * (joints + bumps):
            break
        for i in range(6):
            s[RHO + i] = x[20 + i]
        keep_pose(s)
        s[STEPS] += 1.0
        share = 1.0
        while True:
            take_step(s, share)
            new = place(s)
            new_bumps = weigh_contacts(s, g, h, False)
            if share == 0.0 or new + new_bumps <= joints + bumps - 1e-4 * share * promise:
                break
            share = 0.4 * share if share > 1e-3 else 0.0
        joints, bumps = new, new_bumps
        if share == 0.0:
            break
    s[OBJECTIVE] = joints
