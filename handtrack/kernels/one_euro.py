"""The One-Euro filter of poses: low-pass filters whose cut-off rises with the speed."""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.exchange import load_pose, load_skeleton
from handtrack.kernels.filter_state import copy_pose, move_pose, set_pose
from handtrack.kernels.frame_loop import store_pose_row
from handtrack.kernels.kinematics import place_fingers
from handtrack.kernels.limits import clamp_all
from handtrack.kernels.vectors import log_turn, part, put_part, sub
from handtrack.kernels.workspace import N_ANGLES, N_POSE, WORK

POSE = np.dtype(
    [
        ("angles", "f8", (N_ANGLES,)),
        ("rotation", "f8", (3, 3)),
        ("translation", "f8", (3,)),
    ],
    align=True,
)
# poses: the last fitted one, the filtered one, and the one that comes in
FITTED, STEADY, NEW = range(3)
STATE = np.dtype(
    [
        ("pose", POSE, (3,)),
        # of the pose numbers [rad/s, m/s], smoothed
        ("speed", "f8", (N_POSE,)),
        ("known", "i8"),
        ("fitted_ns", "i8"),
    ],
    align=True,
)
"""What the filter remembers."""


@kernel
def steady_frames(states, skeleton, limits, cutoffs, coast_ns, times_ns, raw, out, known):
    """Filter frames; where nothing is fitted the pose stays.

    Args:
        states: (1,) STATE, which is carried on.
        skeleton: rest joints (21, 3) [m], axes (20, 3), twist of the thumb.
        limits: lower and upper (20,) [rad].
        cutoffs: least cut-off frequencies (26,) [Hz], their gains by speed (26,), and the
            speed's own cut-off frequency.
        coast_ns: how long a pose is held [ns].
        times_ns, raw: (T,) times and fits, RESULT.
        out, known: (T,) RESULT and whether there is a pose; rows without one stay as they are.
    """
    s, works = states[0], np.zeros(1, dtype=WORK)
    w, room = works[0], (np.empty(N_POSE), np.empty((1, N_ANGLES)), np.empty(12))
    load_skeleton(w, *skeleton)
    for t in range(len(raw)):
        since = times_ns[t] - s.fitted_ns
        if since > coast_ns or raw[t].anew:
            s.known = 0
        if not math.isnan(raw[t].noise):
            take(s, raw[t], since * 1e-9, limits, cutoffs, room)
            s.fitted_ns = times_ns[t]
        if s.known:
            known[t] = True
            store(w, s.pose[STEADY], room, out[t])


@inline
def take(s, row, dt, limits, cutoffs, room):
    """A share of the way from the filtered pose to the fitted one."""
    (cutoff, gain, speed_cutoff), (step, angles, _) = cutoffs, room
    set_pose(s.pose[NEW], row.angles, row.root)
    if not s.known:
        copy_pose(s.pose[NEW], s.pose[STEADY])
        for i in range(N_POSE):
            s.speed[i] = 0.0
    else:
        step_between(s.pose[FITTED], s.pose[NEW], step)
        for i in range(N_POSE):
            s.speed[i] += share_of(speed_cutoff, dt) * (step[i] / dt - s.speed[i])
        step_between(s.pose[STEADY], s.pose[NEW], step)
        for i in range(N_POSE):
            step[i] *= share_of(cutoff[i] + gain[i] * abs(s.speed[i]), dt)
        move_pose(s.pose[STEADY], step)
        put_inside(s.pose[STEADY], limits, angles)
    copy_pose(s.pose[NEW], s.pose[FITTED])
    s.known = 1


@inline
def share_of(cutoff, dt):
    """What a new sample makes up in exponential smoothing: 1 / (1 + tau / dt)."""
    return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * cutoff * dt))


@inline
def step_between(before, after, d):
    """d (26,): angles, turn of the world on the left, shift."""
    for i in range(N_ANGLES):
        d[i] = after.angles[i] - before.angles[i]
    put_part(d, N_ANGLES, log_turn(after.rotation, before.rotation))
    shift = sub(part(after.translation, 0), part(before.translation, 0))
    put_part(d, N_ANGLES + 3, shift)


@inline
def put_inside(pose, limits, angles):
    """Angles at the nearest ones that the limits allow."""
    for i in range(N_ANGLES):
        angles[0, i] = pose.angles[i]
    clamp_all(limits[0], limits[1], angles)
    for i in range(N_ANGLES):
        pose.angles[i] = angles[0, i]


@inline
def store(w, pose, room, out):
    """A pose as a row of results; how near it is to the truth is not known."""
    _, angles, root = room
    for i in range(N_ANGLES):
        angles[0, i], out.variance[i] = pose.angles[i], math.nan
    for i in range(3):
        for j in range(3):
            root[3 * i + j] = pose.rotation[i, j]
        root[9 + i] = pose.translation[i]
    load_pose(w, angles[0], root)
    place_fingers(w)
    store_pose_row(w, angles[0], root, out)
