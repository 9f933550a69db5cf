"""Frame after frame through the Kalman filter, in compiled code."""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.compiled import call, inline, kernel
from handtrack.kernels.exchange import load_model, store_pose
from handtrack.kernels.filter_state import (
    BEGUN,
    NOTHING,
    PREDICTED,
    UPDATED,
    FilterNumbers,
    copy_pose,
    move_pose,
)
from handtrack.kernels.frame_loop import count_seen, store_pose_row
from handtrack.kernels.kalman import begin, pass_time, predict, update
from handtrack.kernels.measurement import load_inside, measure_frame
from handtrack.kernels.motion_noise import DENSITY, FIRST, begin_bank, learn, predict_bank
from handtrack.kernels.smoothed_variances import keep_gain, keep_spread, store_spread
from handtrack.kernels.workspace import N_POSE, WORK


@inline
def store_row(w, solver, pose, angles, root, out):
    """A pose, inside the limits, as a row of results (see `frame_loop`)."""
    load_inside(w, pose)
    w.full = 0
    call(solver, w)
    store_pose(w, angles, root)
    store_pose_row(w, angles, root, out)


@inline
def load_hand(w, hand, settings):
    """The hand and the loss into a workspace of zeros."""
    load_model(w, hand)
    w.loss, w.spread2 = settings.loss, settings.spread2


@inline
def keep_prediction(s, kept):
    """What a smoother needs of a prediction; its measurement is still to come."""
    keep_pose_only(s, kept)
    keep_spread(s, kept)
    for i in range(N_POSE):
        for j in range(N_POSE):
            kept.pose_speed[i, j] = s.pose_speed[i, j]


@inline
def keep_pose_only(s, kept):
    """The part of it that does not depend on what else the state holds."""
    copy_pose(s, kept)
    for i in range(N_POSE):
        for j in range(N_POSE):
            kept.pose_pose[i, j], kept.information[i, j] = s.pose_pose[i, j], 0.0
        kept.f01[i], kept.f11[i] = s.f01[i], s.f11[i]
        kept.q00[i], kept.q01[i], kept.q11[i] = s.q00[i], s.q01[i], s.q11[i]
        kept.pull[i] = 0.0


@kernel
def filter_frames(
    states, hand, solver, numbers, motion, time_ns, targets, weights, raw, out, notes, keep, kept
):
    """Filter frame after frame.

    Args:
        states: (1,) FILTER, what is remembered and room for work.
        hand: model constants, as `fit_frames` has them.
        solver: address of `information`.
        numbers: those of FilterNumbers.
        motion: process (3, 26): noise density of the accelerations, decay rate of the velocities
            [1/s], variance of the first velocities; and grid (3, K) of factors on the densities
            that are tried (see `learn`).
        time_ns: (T,); targets (T, 21, 3); weights (T, 21), 0 where missing.
        raw: (T,) RESULT the raw fits, as `fit_frames` leaves them.
        out: (T,) RESULT filtered poses, quaternions, joints and variances of angles; rows without
            a pose are left as they are.
        notes: (T,) NOTE.
        keep: 1 to fill `kept` (T,) KEPT, which the smoother needs.
    """
    settings = FilterNumbers(*numbers)
    works = np.zeros(1, dtype=WORK)
    load_hand(works[0], hand, settings)
    s = states[0]
    for t in range(len(time_ns)):
        frame = targets[t], weights[t], raw[t]
        kind = _before(s, works, solver, settings, motion, time_ns[t], frame, notes[t])
        if kind == PREDICTED:
            predict(s)
        if keep and kind != NOTHING:
            keep_prediction(s, kept[t])
        if see(s, works, solver, settings, frame, notes[t]):
            if keep:
                rest = update(s, settings.coupled, keep, kept[t].information, kept[t].pull)
                keep_gain(s, kept[t])
            else:
                rest = update(s, settings.coupled, keep, s.work, s.gradient)
            notes[t].likelihood -= rest
        _after(s, works, solver, settings, motion, raw[t], out[t], notes[t])


# The stages of a frame around prediction and update, so that another filter can do those.


@inline
def enter(s, settings, process, now, raw, note):
    """What a frame's time means (see `pass_time`); the densities as given."""
    if raw.anew:
        s.known = 0
    kind = pass_time(s, settings, process, now, raw.noise)
    note.kind, note.likelihood, note.noise = kind, 0.0, s.noise
    for i in range(N_POSE):
        s.density[i] = process[DENSITY, i]
    return kind


@inline
def _before(s, works, solver, settings, motion, now, frame, note):
    (process, grid), (targets, weights, raw), follow = motion, frame, settings.follow
    s.white = 1.0
    kind = enter(s, settings, process, now, raw, note)
    if kind == BEGUN:
        begin(works[0], solver, s, targets, weights, raw, process[FIRST])
        if follow:
            begin_bank(s, process)
    elif kind == PREDICTED and follow:
        for i in range(N_POSE):
            s.density[i] = s.learnt[i]
        predict_bank(s, grid, process)
    return kind


@inline
def see(s, works, solver, settings, frame, note):
    """What a frame says (see `measure_frame`); whether it says anything."""
    (targets, weights, raw), coupled = frame, settings.coupled
    some = math.isfinite(raw.noise)
    if coupled:
        seen, _ = count_seen(weights)
        some = some or seen > 0
    s.measured = 0
    if note.kind != PREDICTED or not some:
        return False
    note.likelihood = -measure_frame(works[0], solver, s, targets, weights, raw, coupled)
    for i in range(N_POSE):
        s.before[i] = s.pose_pose[i, i]
    s.measured = 1
    return True


@inline
def _after(s, works, solver, settings, motion, raw, out, note):
    process, grid = motion
    if note.kind == NOTHING:
        return
    if note.kind == PREDICTED and s.measured:
        if settings.follow:
            learn(s, grid, process)
        if math.isfinite(raw.noise):
            note.kind = UPDATED
    store_row(works[0], solver, s, s.best_angles, s.best_root, out)
    store_spread(s, out)


@kernel
def before_frame(states, hand, solver, numbers, motion, now, targets, weights, raw, notes):
    """What comes before a prediction; whether one is to be made. Of raw (1,), notes (1,)."""
    settings = FilterNumbers(*numbers)
    works, frame = np.zeros(1, dtype=WORK), (targets, weights, raw[0])
    load_hand(works[0], hand, settings)
    kind = _before(states[0], works, solver, settings, motion, now, frame, notes[0])
    return kind == PREDICTED


@kernel
def measure(states, hand, solver, numbers, targets, weights, raw, notes):
    """What comes between prediction and update (see `measure_frame`); whether there is one."""
    settings = FilterNumbers(*numbers)
    works, frame = np.zeros(1, dtype=WORK), (targets, weights, raw[0])
    load_hand(works[0], hand, settings)
    return see(states[0], works, solver, settings, frame, notes[0])


@kernel
def after_frame(states, hand, solver, numbers, motion, raw, out, notes):
    """What comes after an update."""
    settings = FilterNumbers(*numbers)
    works = np.zeros(1, dtype=WORK)
    load_hand(works[0], hand, settings)
    _after(states[0], works, solver, settings, motion, raw[0], out[0], notes[0])


@kernel
def shift_pose(states, d):
    """Move the state's pose by d (26,)."""
    move_pose(states[0], d)
