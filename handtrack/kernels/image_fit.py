"""Fitting a hand to what cameras see of it: damped steps under the same limits.

Levenberg-Marquardt on the 26 unknowns of a pose, held to the limits' active faces. A step is
taken only where it lowers the objective.
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.exchange import load_model, load_pose, store_joints, store_pose
from handtrack.kernels.faces import (
    fix_saddle,
    guess_faces,
    hold_faces,
    hold_vector,
    leave_faces,
    put_gradient,
)
from handtrack.kernels.limits import inverse_squares
from handtrack.kernels.linear_algebra import factor, is_lifted, solve_one
from handtrack.kernels.pixel_objective import differentiate_pixels, weigh_pixels
from handtrack.kernels.pose_steps import keep_pose, take_step
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    CONVERGED,
    FINGERS,
    FLEXION,
    HINGE_1,
    LIMIT,
    N_ANGLES,
    N_POSE,
    NORMAL,
    ROOT,
    WORK,
)

# the damping of the first step, at least, and where there is no step to be found
_FIRST, _LEAST, _MOST = 1e-4, 1e-9, 1e12
# [px^2] keeps what nothing observes in place
_RIDGE = 1e-9


@inline
def hold_leaving(w, g, x):
    """Hold what is at a limit and would leave it by the step (26,); returns whether any is."""
    found = False
    for f in range(FINGERS):
        k = ANGLES * f
        z, y = w.angle_before[FLEXION, f], w.angle_before[ABDUCTION, f]
        pz, py = inverse_squares(w, f, z, y)
        nz, ny = z * pz, y * py
        out = x[k] * nz + x[k + 1] * ny
        at_edge = z * z * pz + y * y * py > 1.0 - 1e-9
        if w.free[NORMAL, f] == 1.0 and at_edge and out > 1e-12:
            push = max(-(g[k] * nz + g[k + 1] * ny), 0.0)
            fix_saddle(w, f, z, y, push / (nz * nz + ny * ny))
            found = True
        for a in range(HINGE_1, ANGLES):
            angle, d = w.angle_before[a, f], x[k + a]
            leaves = (angle <= w.lower[a, f] and d < 0.0) or (angle >= w.upper[a, f] and d > 0.0)
            if w.free[a, f] == 1.0 and leaves:
                w.free[a, f] = 0.0
                found = True
    return found


@inline
def factor_held(w, room, damping):
    """The Hessian and the negative gradient held to the faces, damped and factored."""
    g, h, a, u, x = room
    for i in range(N_POSE):
        x[i] = -g[i]
        for j in range(N_POSE):
            a[i, j] = h[i, j]
    hold_faces(w, a, x)
    for i in range(N_POSE):
        a[i, i] += damping * a[i, i] + _RIDGE
    factor(a, u)


@inline
def damped_step(w, room, damping):
    """The step that leaves no limit, in `step` and `root_step`; what it promises."""
    g, _, _, u, x = room
    while True:
        factor_held(w, room, damping)
        solve_one(u, x)
        leave_faces(w, x)
        if not hold_leaving(w, g, x):
            break
    promise = 0.0
    for i in range(N_POSE):
        promise -= g[i] * x[i]
    for i in range(ROOT):
        w.root_step[i] = x[N_ANGLES + i]
    return promise


@inline
def differentiate_on_faces(w, seen, room):
    differentiate_pixels(w, seen, room[0], room[1])
    put_gradient(w, room[0])
    guess_faces(w)


@inline
def improve(w, seen, room, cost, damping, tolerance):
    """One step that lowers the objective; the new objective and damping, the old where none does.

    The pose in the workspace is the better one, placed.
    """
    differentiate_on_faces(w, seen, room)
    keep_pose(w)
    while damping < _MOST:
        promise = damped_step(w, room, damping)
        if promise <= tolerance * cost + 1e-20:
            break
        take_step(w, 1.0)
        new = weigh_pixels(w, seen)
        if new < cost:
            return new, max(0.1 * damping, _LEAST)
        damping *= 10.0
    take_step(w, 0.0)
    return weigh_pixels(w, seen), damping


@inline
def view_covariance(w, seen, room, out):
    """Covariance (26, 26) at unit noise, by angles, omega and v, on the active faces."""
    differentiate_on_faces(w, seen, room)
    factor_held(w, room, 0.0)
    _, _, a, u, x = room
    sound = not is_lifted(a, u)
    for k in range(N_POSE):
        for i in range(N_POSE):
            x[i] = 0.0
        x[k] = 1.0
        hold_vector(w, x)
        solve_one(u, x)
        leave_faces(w, x)
        for i in range(N_POSE):
            out[i, k] = x[i] if sound else math.inf


@inline
def fit_views_in(
    works, cameras, pixels, weights, spread, prior, stiffness, starts, roots, settings, out
):
    """`fit_views`, in a workspace (1,) with the hand that the caller keeps alive."""
    w, (most, tolerance) = works[0], settings
    out_joints, out_objective, out_steps, out_state, out_covariance = out
    square = (N_POSE, N_POSE)
    room = np.empty(N_POSE), np.empty(square), np.empty(square), np.empty(square), np.empty(N_POSE)
    for t in range(len(pixels)):
        seen = cameras, pixels[t], weights[t], spread * spread, prior[t], stiffness
        load_pose(w, starts[t], roots[t])
        cost, damping = weigh_pixels(w, seen), _FIRST
        steps, state = 0, LIMIT
        while steps < most:
            new, damping = improve(w, seen, room, cost, damping, tolerance)
            if not new < cost:
                state = CONVERGED
                break
            steps += 1
            cost = new
        out_objective[t], out_steps[t], out_state[t] = cost, steps, state
        store_pose(w, starts[t], roots[t])
        store_joints(w, out_joints[t])
        view_covariance(w, seen, room, out_covariance[t])


@kernel
def fit_views(
    hand, cameras, pixels, weights, spread, prior, stiffness, starts, roots, settings, out
):
    """Fit frames to what cameras see, each from its own start, which is overwritten.

    Args:
        hand: as `load_model` takes it.
        cameras: (C,) LENS; pixels: (T, C, 21, 2); weights: (T, C, 21), 0 where not seen.
        spread: distance at which the loss bends from square to linear [px]; 0: never.
        prior: (T, 20) angles; stiffness: (20,) [px^2/rad^2] of the pull towards them.
        starts: (T, 20), inside the limits; roots: (T, 12). Both take the results.
        settings: (steps at most, relative promise of a step at which to stop).
        out: joints (T, 21, 3), objective (T,), steps (T,), state (T,) CONVERGED or LIMIT, and
            covariance (T, 26, 26) at unit noise, by angles, omega and v on the active faces.
    """
    works = np.zeros(1, dtype=WORK)
    load_model(works[0], hand)
    fit_views_in(
        works, cameras, pixels, weights, spread, prior, stiffness, starts, roots, settings, out
    )
