"""Bones that would sink into each other, moved apart inside the fit (Li et al. 2021).

The paper moves two capsules apart along the line between them, after the fit. Here what they
sink in enters the objective, HARD times its square, so that the joints and the limits have
their say in who gives way. Few frames need it; Gauss-Newton on all 26 unknowns does, from the
fit without it.
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.arrowhead import root_hessian
from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.derivatives import differentiate
from handtrack.kernels.faces import guess_faces, hold_faces, leave_faces, put_gradient
from handtrack.kernels.joint_objective import place
from handtrack.kernels.limits import clip
from handtrack.kernels.linear_algebra import factor, solve_one
from handtrack.kernels.pose_information import assemble
from handtrack.kernels.pose_steps import keep_pose, take_step
from handtrack.kernels.vectors import add, cross, dot, lane, scale, sub
from handtrack.kernels.workspace import BASE, N_ANGLES, N_POSE, ROOT, WRIST

HARD = 50.0
"""Weight of a depth of two capsules beside the distance of a joint."""

_STEPS = 30
# a step that promises less than this share of the objective is the last one
_ENOUGH = 1e-6
# [m^2] what keeps an angle that neither joints nor contacts move
_RIDGE = 1e-7


# capsules: three bones of each finger from its base, then the palm's, index to little finger
_FINGER_BONES, _FIRST_PALM = 15, 1


@inline
def ends(w, bone, share):
    """The ends of a capsule's axis in the root frame: that part of its bone, from the base."""
    if bone < _FINGER_BONES:
        f, i = bone // 3, bone % 3
        first, last = lane(w.joint, i, f), lane(w.joint, i + 1, f)
    else:
        first = lane(w.joint, BASE, WRIST)
        last = lane(w.joint, BASE, bone - _FINGER_BONES + _FIRST_PALM)
    return first, add(first, scale(share, sub(last, first)))


@inline
def nearest(p0, p1, q0, q1):
    """The points of segments p0-p1 and q0-q1 that are nearest to each other."""
    u, v, w = sub(p1, p0), sub(q1, q0), sub(p0, q0)
    a, b, c = dot(u, u), dot(u, v), dot(v, v)
    d, e = dot(u, w), dot(v, w)
    det = a * c - b * b
    # parallel ones: any point will do
    t = clip((a * e - b * d) / det, 0.0, 1.0) if det > 1e-12 * a * c else 0.5
    # each is nearest to the other one; a clipped end moves the other point once more
    r = clip((b * t - d) / a, 0.0, 1.0)
    t = clip((b * r + e) / c, 0.0, 1.0)
    r = clip((b * t - d) / a, 0.0, 1.0)
    return add(p0, scale(r, u)), add(q0, scale(t, v))


@inline
def slopes(w, bone, x, n, row):
    """Add to row (20,) how each angle moves point x of a capsule along n."""
    if bone >= _FINGER_BONES:
        return
    f, i = bone // 3, bone % 3
    for a in range(2 + i):
        arm = sub(x, lane(w.joint, max(a - 1, 0), f))
        row[4 * f + a] += dot(lane(w.axis, a, f), cross(arm, n))


@inline
def weigh_contacts(w, g, h, slope):
    """HARD times the sum of the squared depths, of the placed pose.

    With `slope` the gradient and Gauss-Newton Hessian of its half are added to g and h.
    """
    total = 0.0
    row = np.empty(N_ANGLES)
    for k in range(w.contacts):
        first, second, reach = int(w.contact[k, 0]), int(w.contact[k, 1]), w.contact[k, 2]
        p0, p1 = ends(w, first, w.contact[k, 3])
        q0, q1 = ends(w, second, w.contact[k, 4])
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
            for i in range(N_ANGLES):
                row[i] = 0.0
            slopes(w, first, p, n, row)
            slopes(w, second, q, scale(-1.0, n), row)
            add_square(row, HARD, depth, g, h)
    return total


@inline
def add_square(row, weight, value, g, h):
    """Add to g and h what half of weight value^2 has, where row (20,) is the value's slope."""
    for i in range(N_ANGLES):
        if row[i] != 0.0:
            v = weight * row[i]
            g[i] += v * value
            for j in range(N_ANGLES):
                h[i, j] += v * row[j]


@inline
def step_apart(w, g, h, x, u):
    """The step of joints and contacts together at the placed pose; what it promises."""
    differentiate(w, 0.0)
    root_hessian(w)
    assemble(w, g, h)
    weigh_contacts(w, g, h, True)
    put_gradient(w, g)
    guess_faces(w)
    for i in range(N_POSE):
        x[i] = -g[i]
        h[i, i] += _RIDGE
    hold_faces(w, h, x)
    factor(h, u)
    solve_one(u, x)
    leave_faces(w, x)
    promise = 0.0
    for i in range(N_POSE):
        promise -= g[i] * x[i]
    for i in range(ROOT):
        w.root_step[i] = x[N_ANGLES + i]
    return promise


@Solver
def move_apart(w):
    """From the pose in the workspace to the least of the objective with the contacts in it.

    Sets `objective` to the joints' part; adds to `steps`. The sum is never higher than before,
    and a pose without contacts stays as it is.
    """
    g, x = np.zeros(N_POSE), np.zeros(N_POSE)
    h, u = np.zeros((N_POSE, N_POSE)), np.zeros((N_POSE, N_POSE))
    joints = place(w)
    w.objective = joints
    bumps = weigh_contacts(w, g, h, False)
    if bumps == 0.0:
        return
    for _ in range(_STEPS):
        promise = step_apart(w, g, h, x, u)
        if not promise > _ENOUGH * (joints + bumps):
            break
        keep_pose(w)
        w.steps += 1.0
        share = 1.0
        while True:
            take_step(w, share)
            new = place(w)
            new_bumps = weigh_contacts(w, g, h, False)
            if share == 0.0 or new + new_bumps <= joints + bumps - 1e-4 * share * promise:
                break
            share = 0.4 * share if share > 1e-3 else 0.0
        joints, bumps = new, new_bumps
        if share == 0.0:
            break
    w.objective = joints
