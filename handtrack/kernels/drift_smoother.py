"""The smoother where the joints' noise lasts; as `smoother`, with the drift in the adjoint."""

from __future__ import annotations

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.filter_loop import load_hand, store_row
from handtrack.kernels.filter_state import (
    BEGUN,
    KEPT,
    NOTHING,
    REST,
    FilterNumbers,
    copy_pose,
    move_pose,
)
from handtrack.kernels.linear_algebra import apply_matrix
from handtrack.kernels.smoothed_variances import (
    clear_spread,
    spread_over_measurement,
    spread_over_transition,
    store_smoothed_spread,
)
from handtrack.kernels.workspace import N_ANGLES, N_POSE, WORK

# the adjoint of the seen pose; a pose's change, and what it is made of
ADJOINT, CHANGE, TERM = range(3)


@inline
def clear(r, rest):
    for i in range(N_POSE):
        r[ADJOINT, i] = 0.0
    for i in range(REST):
        rest[i] = 0.0


@inline
def covary(kept, r, rest):
    """The predicted covariance's first rows times the adjoint, in r[CHANGE]."""
    apply_matrix(kept.pose_pose, r[ADJOINT], r[CHANGE])
    for i in range(N_POSE):
        v = 0.0
        for j in range(REST):
            v += kept.pose_rest[i, j] * rest[j]
        r[CHANGE, i] += v


@inline
def over_measurement(kept, r, rest):
    """(35) over a frame's measurement. Leaves what is added, the noise's adjoint, in r[TERM]."""
    covary(kept, r, rest)
    apply_matrix(kept.information, r[CHANGE], r[TERM])
    for i in range(N_POSE):
        r[TERM, i] = kept.pull[i] - r[TERM, i]
        r[ADJOINT, i] += r[TERM, i]


@inline
def over_transition(kept, r, rest):
    """(35) over the transition to a frame: F^T r."""
    for i in range(N_POSE):
        k = N_POSE + i
        rest[i] = kept.f01[i] * r[ADJOINT, i] + kept.f11[i] * rest[i]
        rest[k] = (kept.stays[i] - 1.0) * r[ADJOINT, i] + kept.stays[i] * rest[k]


@inline
def smoothed_pose(kept, r, rest, pose):
    """The hand's pose: the seen one and the drift as predicted, each with P r, one less the other.

    r and rest are as before the frame's measurement is taken over, going back.
    """
    covary(kept, r, rest)
    copy_pose(kept, pose)
    move_pose(pose, r[CHANGE])
    for i in range(N_POSE):
        v = kept.drift[i]
        for j in range(N_POSE):
            v += kept.pose_rest[j, N_POSE + i] * r[ADJOINT, j]
        for j in range(REST):
            v += kept.drift_rest[i, j] * rest[j]
        r[TERM, i] = -v
    move_pose(pose, r[TERM])


@inline
def run_back(first, last, end, notes, kept, room, solver, out, at):
    """Smoothed poses of the frames first..last - 1 given all before `end`, from out[at] on."""
    works, r, rest, n, poses, angles, root = room
    w, pose = works[0], poses[0]
    clear(r, rest)
    clear_spread(n)
    for t in range(end - 1, first - 1, -1):
        if notes[t].kind == NOTHING:
            clear(r, rest)
            clear_spread(n)
            continue
        over_measurement(kept[t], r, rest)
        spread_over_measurement(kept[t], n)
        if t < last:
            smoothed_pose(kept[t], r, rest, pose)
            store_row(w, solver, pose, angles, root, out[at + t - first])
            store_smoothed_spread(kept[t], n, out[at + t - first])
        if notes[t].kind == BEGUN:
            clear(r, rest)
            clear_spread(n)
        else:
            over_transition(kept[t], r, rest)
            spread_over_transition(kept[t], n)


@inline
def room_to_run():
    """A workspace, adjoints, a pose as a record and as arrays; who has it keeps it alive."""
    return (
        np.zeros(1, dtype=WORK),
        np.zeros((3, N_POSE)),
        np.zeros(REST),
        np.zeros((3, N_ANGLES)),
        np.zeros(1, dtype=KEPT),
        np.zeros(N_ANGLES),
        np.zeros(12),
    )


@kernel
def smooth_drifting_frames(hand, solver, numbers, first, last, notes, kept, out):
    """As `smooth_frames`, of kept (T,) KEPT_DRIFTING."""
    settings = FilterNumbers(*numbers)
    room = room_to_run()
    load_hand(room[0][0], hand, settings)
    run_back(first, last, len(notes), notes, kept, room, solver, out, 0)


@kernel
def lag_drifting_frames(hand, solver, numbers, lag, notes, kept, out):
    """As `lag_frames`, of kept (T,) KEPT_DRIFTING."""
    settings = FilterNumbers(*numbers)
    room = room_to_run()
    load_hand(room[0][0], hand, settings)
    for t in range(len(notes) - lag):
        run_back(t, t + 1, t + lag + 1, notes, kept, room, solver, out, t)
