"""Frame after frame through the filter where the joints' noise lasts, in compiled code."""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.drift import (
    age_drift,
    begin_drifting,
    learn_unit,
    predict_drifting,
    update_drifting,
)
from handtrack.kernels.filter_loop import enter, keep_pose_only, load_hand, see, store_row
from handtrack.kernels.filter_state import (
    BANK,
    BEGUN,
    KEPT,
    NOTHING,
    PREDICTED,
    REST,
    UPDATED,
    FilterNumbers,
    copy_pose,
    move_pose,
)
from handtrack.kernels.frame_loop import count_seen
from handtrack.kernels.joint_noise import corrected_parts, follow_share, parts_of
from handtrack.kernels.motion_noise import (
    DENSITY,
    FACTOR,
    FIRST,
    as_scalars,
    begin_bank,
    draw_lesson,
    misfit,
)
from handtrack.kernels.smoothed_variances import (
    keep_undrifted_gain,
    keep_undrifted_spread,
    store_undrifted_spread,
)
from handtrack.kernels.workspace import N_POSE, WORK


@inline
def begin_drifting_bank(s, process):
    """Start all filters at the state; the evidence so far is kept."""
    begin_bank(s, process)
    for k in range(BANK):
        for i in range(N_POSE):
            s.bank_c[k, i] = s.bank_xc[k, i] = s.bank_vc[k, i] = 0.0
            s.bank_cc[k, i] = s.rest_rest[N_POSE + i, N_POSE + i]


@inline
def predict_drifting_bank(s, grid, process):
    """Take all filters over the time step, before the state is."""
    for k in range(BANK):
        for i in range(N_POSE):
            q = grid[FACTOR, k] * process[DENSITY, i]
            f, g, a = s.f01[i], s.f11[i], s.stays[i]
            b = a - 1.0
            new = s.renewed[i] * s.renewed[i] * s.spread[i, i]
            s.bank_x[k, i] += f * (s.bank_v[k, i] - s.velocity[i])
            s.bank_x[k, i] += b * (s.bank_c[k, i] - s.drift[i])
            s.bank_v[k, i] *= g
            s.bank_c[k, i] *= a
            xv, xc, vc = s.bank_xv[k, i], s.bank_xc[k, i], s.bank_vc[k, i]
            vv, cc = s.bank_vv[k, i], s.bank_cc[k, i]
            both = 2.0 * (f * xv + b * xc + f * b * vc)
            s.bank_xx[k, i] += both + f * f * vv + b * b * cc + q * s.q00[i] + new
            s.bank_xv[k, i] = g * (xv + f * vv + b * vc) + q * s.q01[i]
            s.bank_xc[k, i] = a * (xc + f * vc + b * cc) + new
            s.bank_vv[k, i] = g * g * vv + q * s.q11[i]
            s.bank_vc[k, i] = g * a * vc
            s.bank_cc[k, i] = a * a * cc + new


@inline
def learn_drifting(s, grid, process):
    """Weigh the filters by how well they predicted, after the state's update (see `learn`)."""
    as_scalars(s)
    for k in range(BANK):
        for i in range(N_POSE):
            v = s.bank_xx[k, i] + s.before[i]
            e = s.innovation[i] - s.bank_x[k, i]
            xx, xv, xc = s.bank_xx[k, i], s.bank_xv[k, i], s.bank_xc[k, i]
            gx, gv, gc = xx / v, xv / v, xc / v
            s.bank_x[k, i] += gx * e - s.distance[i]
            s.bank_v[k, i] += gv * e
            s.bank_c[k, i] += gc * e
            s.bank_vv[k, i] -= gv * xv
            s.bank_vc[k, i] -= gv * xc
            s.bank_cc[k, i] -= gc * xc
            s.bank_xv[k, i] = xv * (1.0 - gx)
            s.bank_xc[k, i] = xc * (1.0 - gx)
            s.bank_xx[k, i] = xx * (1.0 - gx)
            s.bank_log[k, i] = s.fade * s.bank_log[k, i] - 0.5 * misfit(e, v)
    draw_lesson(s, grid, process)


@inline
def keep_drifting(s, kept):
    """What a smoother needs of a prediction; its measurement is still to come."""
    keep_pose_only(s, kept)
    keep_undrifted_spread(s, kept)
    for i in range(N_POSE):
        for j in range(REST):
            kept.pose_rest[i, j] = s.pose_rest[i, j]
            kept.drift_rest[i, j] = s.rest_rest[N_POSE + i, j]
        kept.drift[i], kept.stays[i] = s.drift[i], s.stays[i]
        kept.f01[i], kept.f11[i] = s.f01[i], s.f11[i]
        kept.q00[i], kept.q01[i], kept.q11[i] = s.q00[i], s.q01[i], s.q11[i]


@inline
def come_to(s, works, solver, settings, motion, now, frame, note, seen):
    """What comes before a prediction: beginning, or what the time until the frame means."""
    (process, grid), (targets, weights, raw), before = motion, frame, s.time_ns
    s.lasts, dt = settings.lasts_s, (now - before) * 1e-9
    if settings.share >= 0.0:
        s.share, s.moving = settings.share, settings.moving
    else:
        follow_share(s, dt, targets, weights, raw)
        if settings.moving >= 0.0:
            s.moving = settings.moving
    if settings.corrected:
        s.white, s.colour = corrected_parts(s.share, s.moving)
    else:
        s.white, s.colour = parts_of(s.share, s.moving)
    kind = enter(s, settings, process, now, raw, note)
    age_drift(s, dt, weights)
    if kind == BEGUN:
        begin_drifting(works[0], solver, s, targets, weights, raw, process[FIRST], seen)
        if settings.follow:
            begin_drifting_bank(s, process)
    elif kind == PREDICTED and settings.follow:
        for i in range(N_POSE):
            s.density[i] = s.learnt[i]
        predict_drifting_bank(s, grid, process)
    return kind


@inline
def store_undrifted(s, works, solver, pose, out):
    """The hand's pose, without its drift, as a row of results."""
    copy_pose(s, pose)
    for i in range(N_POSE):
        s.step[i] = -s.drift[i]
    move_pose(pose, s.step)
    store_row(works[0], solver, pose, s.best_angles, s.best_root, out)
    store_undrifted_spread(s, out)


@kernel
def filter_drifting_frames(
    states, hand, solver, numbers, motion, time_ns, targets, weights, raw, out, notes, keep, kept
):
    """Filter frame after frame.

    Args:
        states: (1,) DRIFTING.
        kept: (T,) KEPT_DRIFTING.
        hand, solver, numbers, motion, time_ns, targets, weights, raw, out, notes, keep: as there.
    """
    settings = FilterNumbers(*numbers)
    works, poses = np.zeros(1, dtype=WORK), np.zeros(1, dtype=KEPT)
    load_hand(works[0], hand, settings)
    s = states[0]
    for t in range(len(time_ns)):
        frame = targets[t], weights[t], raw[t]
        seen, _ = count_seen(weights[t])
        kind = come_to(s, works, solver, settings, motion, time_ns[t], frame, notes[t], seen)
        if kind == PREDICTED:
            predict_drifting(s)
        if keep and kind != NOTHING:
            keep_drifting(s, kept[t])
        if see(s, works, solver, settings, frame, notes[t]):
            learn_unit(s, seen)
            if keep:
                rest = update_drifting(s, settings.coupled, keep, kept[t].information, kept[t].pull)
                keep_undrifted_gain(s, kept[t])
            else:
                rest = update_drifting(s, settings.coupled, keep, s.work, s.gradient)
            notes[t].likelihood -= rest
            if settings.follow:
                learn_drifting(s, motion[1], motion[0])
            if math.isfinite(raw[t].noise):
                notes[t].kind = UPDATED
        if kind != NOTHING:
            store_undrifted(s, works, solver, poses[0], out[t])
