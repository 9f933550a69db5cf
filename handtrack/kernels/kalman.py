"""The compiled Kalman filter of poses: 26 pose numbers and their velocities, full covariance."""

from __future__ import annotations

import math

from handtrack.kernels.compiled import call, inline
from handtrack.kernels.exchange import load_frame
from handtrack.kernels.filter_state import (
    BEGUN,
    NOTHING,
    PREDICTED,
    move_pose,
    set_pose,
)
from handtrack.kernels.frame_loop import count_seen
from handtrack.kernels.joint_noise import follow_noise
from handtrack.kernels.linear_algebra import (
    apply_matrix,
    divide,
    factor,
    invert,
    multiply,
    subtract_square,
)
from handtrack.kernels.measurement import load_raw
from handtrack.kernels.motion_noise import (
    DECAY,
    unit_process,
)
from handtrack.kernels.workspace import N_POSE

VAGUE = 1.0
"""Information of a first pose that no joint gives [1/rad^2, 1/m^2]."""


@inline
def predict(s):
    """(32) x = F x, P = F P F^T + Q: velocities that decay, white noise in the acceleration."""
    for i in range(N_POSE):
        s.step[i] = s.f01[i] * s.velocity[i]
    move_pose(s, s.step)
    for i in range(N_POSE):
        s.velocity[i] *= s.f11[i]
    for i in range(N_POSE):
        # F P F^T by blocks; only the transition of row and column differ
        f, g = s.f01[i], s.f11[i]
        for j in range(N_POSE):
            b, c = s.pose_speed[i, j], s.speed_speed[i, j]
            h, k = s.f01[j], s.f11[j]
            s.work[i, j] = s.pose_pose[i, j] + b * h + f * s.pose_speed[j, i] + f * c * h
            s.work_2[i, j] = (b + f * c) * k
            s.speed_speed[i, j] = g * c * k
    for i in range(N_POSE):
        for j in range(N_POSE):
            s.pose_pose[i, j] = s.work[i, j]
            s.pose_speed[i, j] = s.work_2[i, j]
    for i in range(N_POSE):
        s.pose_pose[i, i] += s.density[i] * s.q00[i]
        s.pose_speed[i, i] += s.density[i] * s.q01[i]
        s.speed_speed[i, i] += s.density[i] * s.q11[i]


@inline
def correct_raw(s):
    """An uncoupled frame's update of the pose: P+ M z, with M the frame's information.

    Turns `distance` from the innovation z into the update; returns z L z - z L (P+ M z), L being
    the prior's precision.
    """
    before = after = 0.0
    for i in range(N_POSE):
        before += s.distance[i] * s.pull[i]
        s.innovation[i] = s.distance[i]
    apply_matrix(s.posterior, s.gradient, s.distance)
    apply_matrix(s.precision, s.distance, s.pull)
    for i in range(N_POSE):
        after += s.innovation[i] * s.pull[i]
    return before - after


@inline
def take_in(s, coupled, keep, information, pull):
    """What `measure_frame` found as the pose's covariance in `posterior`, by inverses.

    (33) P+ = (P^-1 + M)^-1; the rest of the state follows by its regression on the pose.

    Args:
        keep: whether to leave H^T S^-1 H and H^T S^-1 z in information and pull, for a smoother.

    Returns what the logarithm of the likelihood has less than what `measure_frame` returned.
    """
    if not coupled:
        apply_matrix(s.system, s.distance, s.gradient)
    log = s.log_determinant
    if not coupled or s.ready == 0:
        # else `best_pose` has left it
        for i in range(N_POSE):
            for j in range(N_POSE):
                s.system[i, j] += s.precision[i, j]
        log = factor(s.system, s.factor)
    invert(s.factor, s.work, s.posterior)
    surplus = 0.0
    if not coupled:
        surplus = correct_raw(s)
    if keep:
        # prior's precision less what the posterior keeps of it
        for i in range(N_POSE):
            for j in range(N_POSE):
                s.work[i, j] = information[i, j] = s.precision[i, j]
            pull[i] = s.pull[i]
        divide(s.factor, s.work)
        subtract_square(s.work, information)
    # the objective had the prior's distance where the innovation's belongs
    return 0.5 * (log - surplus)


@inline
def take_pose(s, coupled):
    """Move the state's pose to what was found."""
    if coupled:
        set_pose(s, s.best_angles, s.best_root)
    else:
        move_pose(s, s.distance)


@inline
def update(s, coupled, keep, information, pull):
    """Take in what `measure_frame` found; arguments and result as of `take_in`."""
    less = take_in(s, coupled, keep, information, pull)
    update_rest(s, s.pose_speed, s.speed_speed, s.work, s.work_2)
    for i in range(N_POSE):
        d = s.distance[i]
        for j in range(N_POSE):
            s.velocity[j] += s.work[i, j] * d
    take_pose(s, coupled)
    return less


@inline
def update_rest(s, pose_rest, rest, slopes, room):
    """(34) The regression of the state's rest on the pose, P^-1 P_xr; the covariance after it.

    Args:
        pose_rest, rest: the covariance's blocks P_xr and P_rr.
        slopes: (26, R) takes the regression; room: (26, R) is overwritten.
    """
    columns = pose_rest.shape[1]
    multiply(s.precision, pose_rest, slopes)
    multiply(s.posterior, slopes, room)
    for k in range(0, N_POSE, 2):
        for i in range(columns):
            d = pose_rest[k, i] - room[k, i]
            e = pose_rest[k + 1, i] - room[k + 1, i]
            for j in range(i, columns):
                rest[i, j] -= d * slopes[k, j] + e * slopes[k + 1, j]
    for i in range(columns):
        for j in range(i):
            rest[i, j] = rest[j, i]
    for i in range(N_POSE):
        for j in range(N_POSE):
            s.pose_pose[i, j] = s.posterior[i, j]
        for j in range(columns):
            pose_rest[i, j] = room[i, j]


@inline
def begin(w, solver, s, targets, weights, raw, speed):
    """Start from a raw fit; the velocities are zero, with variances `speed`."""
    start_pose(w, solver, s, targets, weights, raw)
    for i in range(N_POSE):
        s.velocity[i] = 0.0
        for j in range(N_POSE):
            s.pose_speed[i, j] = s.speed_speed[i, j] = 0.0
        s.speed_speed[i, i] = speed[i]


@inline
def start_pose(w, solver, s, targets, weights, raw):
    """The pose of a raw fit and its covariance."""
    set_pose(s, raw.angles, raw.root)
    _, top = count_seen(weights)
    load_frame(w, targets, weights, top)
    load_raw(w, raw)
    w.full = 1
    call(solver, w)
    for i in range(N_POSE):
        for j in range(N_POSE):
            s.system[i, j] = top / (s.white * s.noise) * w.information[i, j]
        s.system[i, i] += VAGUE
    factor(s.system, s.factor)
    invert(s.factor, s.work, s.pose_pose)
    s.known = 1


@inline
def pass_time(s, settings, process, now, raw_noise):
    """What a frame's time means: whether the state still holds, transition, joints' noise.

    Returns NOTHING where there is no state, BEGUN where this frame begins one, or PREDICTED.
    """
    fitted = math.isfinite(raw_noise)
    if s.known and now - s.fitted_ns > settings.coast_ns:
        s.known = 0
    follow_noise(s, raw_noise, settings.noise, settings.gain)
    dt = (now - s.time_ns) * 1e-9
    s.fade = math.exp(-dt / settings.forget_s)
    s.time_ns = now
    if fitted:
        s.fitted_ns = now
    if s.known == 0:
        return BEGUN if fitted else NOTHING
    for i in range(N_POSE):
        s.f01[i], s.f11[i], s.q00[i], s.q01[i], s.q11[i] = unit_process(process[DECAY, i], dt)
    return PREDICTED
