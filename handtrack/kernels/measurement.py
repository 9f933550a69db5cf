"""What a frame says of a pose that is predicted: the best pose under both, and its information.

(30) The objective is half the squared distances of the joints over their noise, and half the
squared distance from the prediction by its precision.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import call, inline
from handtrack.kernels.exchange import load_frame, load_pose, store_pose
from handtrack.kernels.faces import guess_faces, hold_faces, leave_faces, put_gradient
from handtrack.kernels.filter_state import pose_less
from handtrack.kernels.frame_loop import count_seen
from handtrack.kernels.limits import move_inside
from handtrack.kernels.linear_algebra import apply_matrix, factor, invert, solve_one
from handtrack.kernels.pose_steps import keep_pose, take_step
from handtrack.kernels.vectors import (
    add,
    apply_transposed,
    cross,
    matrix,
    part,
    put_part,
    put_row,
    row,
    scale,
)
from handtrack.kernels.workspace import N_ANGLES, N_POSE, SHIFT, TURN

_STEPS = 12
# [nats] a step that promises less is not worth taking; is the last; a start that is doubted
_PROMISE, _NEAR, _SURPRISE = 1e-6, 0.03, 100.0
WEAK = 1e-2
"""Least information of a measured pose [1/rad^2, 1/m^2]: ten radians, ten metres."""


@inline
def prior_gradient(s):
    """From the prior's precision times the distance to its gradient.

    (31) The turn's distance is a logarithm; its slope is the inverse left Jacobian of rotations,
    transposed 1 + [d]x / 2 + [d]x^2 / 12 to second order.
    """
    d, g = part(s.distance, N_ANGLES), part(s.pull, N_ANGLES)
    for i in range(N_POSE):
        s.gradient[i] = s.pull[i]
    m = cross(d, g)
    g = add(g, add(scale(0.5, m), scale(1.0 / 12.0, cross(d, m))))
    put_part(s.gradient, N_ANGLES, g)


@inline
def weigh(w, solver, s, precision):
    """Objective of the pose in the workspace, prior and joints together [nats]."""
    call(solver, w)
    pose_less(w, s, s.distance)
    apply_matrix(s.precision, s.distance, s.pull)
    q = precision * w.objective
    for i in range(N_POSE):
        q += s.distance[i] * s.pull[i]
    return 0.5 * q


@inline
def load_inside(w, pose):
    """Put a pose into the workspace, moved inside the limits."""
    for i in range(N_ANGLES):
        w.angle[i % 4, i // 4] = pose.angles[i]
    for i in range(3):
        put_row(w.rotation, i, row(pose.rotation, i))
        w.translation[i] = pose.translation[i]
    move_inside(w)


@inline
def load_raw(w, raw):
    """Put a raw fit's pose into the workspace."""
    load_pose(w, raw.angles, raw.root)


@inline
def begin_pose(w, solver, s, raw, precision):
    """Where to begin: at the prediction, or where the frame alone says; its objective."""
    w.full = 1
    load_inside(w, s)
    cost = weigh(w, solver, s, precision)
    if cost > _SURPRISE and math.isfinite(raw.angles[0]):
        # a hand that moved far
        load_raw(w, raw)
        other = weigh(w, solver, s, precision)
        if other > cost:
            load_inside(w, s)
            other = weigh(w, solver, s, precision)
        cost = other
    return cost


@inline
def step_with_prior(w, s, precision):
    """The step of prior and joints together from the pose in the workspace; what it promises.

    Where no limit holds it, `ready` is 1, `factor` that of the whole system.
    """
    prior_gradient(s)
    for i in range(N_POSE):
        s.gradient[i] += precision * w.gradient[i]
    for i in range(N_POSE):
        s.step[i] = -s.gradient[i]
        for j in range(N_POSE):
            s.system[i, j] = s.precision[i, j] + precision * w.information[i, j]
        s.system[i, i] += WEAK
    put_gradient(w, s.gradient)
    guess_faces(w)
    s.ready = 0 if hold_faces(w, s.system, s.step) else 1
    s.log_determinant = factor(s.system, s.factor)
    solve_one(s.factor, s.step)
    leave_faces(w, s.step)
    # the root's step in its own frame
    r = matrix(w.rotation)
    put_part(w.root_step, TURN, apply_transposed(r, part(s.step, N_ANGLES + TURN)))
    put_part(w.root_step, SHIFT, apply_transposed(r, part(s.step, N_ANGLES + SHIFT)))
    promise = 0.0
    for i in range(N_POSE):
        promise -= s.gradient[i] * s.step[i]
    return promise


@inline
def best_pose(w, solver, s, raw, precision):
    """The pose of least objective under the limits, from the prediction or the raw fit.

    On return the workspace holds the pose and its Hessian, and `distance` and `pull` are its own.
    Returns the objective [nats].
    """
    cost = begin_pose(w, solver, s, raw, precision)
    for _ in range(_STEPS):
        promise = step_with_prior(w, s, precision)
        if not promise > _PROMISE:
            break
        keep_pose(w)
        # a step so short changes neither gradient nor Hessian
        near = promise < _NEAR
        w.full = 0 if near else 1
        s.ready = s.ready if near else 0
        share = 1.0
        while True:
            take_step(w, share)
            new = weigh(w, solver, s, precision)
            if new <= cost or share == 0.0:
                break
            share = 0.3 * share if share > 1e-3 else 0.0
        cost = new
        if near or share == 0.0:
            break
    return cost


@inline
def measure_frame(w, solver, s, targets, weights, raw, coupled):
    """What a frame says: its pose's `distance` from the state's, and its information in `system`.

    Coupled, the pose is the best under prior and joints together, else the raw fit. `pull` is
    the distance times `precision`, the inverse of the prior's covariance.

    Returns the objective less the prior's normalisation [nats].
    """
    _, top = count_seen(weights)
    precision = top / (s.white * s.noise)
    load_frame(w, targets, weights, top)
    log = factor(s.pose_pose, s.factor)
    invert(s.factor, s.work, s.precision)
    if coupled:
        cost = best_pose(w, solver, s, raw, precision)
    else:
        load_raw(w, raw)
        w.full = 1
        cost = weigh(w, solver, s, precision)
    store_pose(w, s.best_angles, s.best_root)
    for i in range(N_POSE):
        for j in range(N_POSE):
            s.system[i, j] = precision * w.information[i, j]
        s.system[i, i] += WEAK
    return cost + 0.5 * log
