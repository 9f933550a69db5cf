"""The smoother of poses, backwards over what the filter kept.

The form of Bryson and Frazier (1963), which needs no inverse of the predicted covariance: an
adjoint r runs back through r = F^T (r + H^T S^-1 (z - H P r)), and the smoothed pose is the
predicted one plus P r. Its results are those of Rauch, Tung and Striebel (1965).
"""

from __future__ import annotations

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.filter_loop import load_hand, store_row
from handtrack.kernels.filter_state import BEGUN, KEPT, NOTHING, FilterNumbers, copy_pose, move_pose
from handtrack.kernels.linear_algebra import apply_matrix
from handtrack.kernels.smoothed_variances import (
    clear_spread,
    spread_over_measurement,
    spread_over_transition,
    store_smoothed_spread,
)
from handtrack.kernels.workspace import N_ANGLES, N_POSE, WORK

# the adjoint of the pose and of the velocity; a pose's change, and what it is made of
ADJOINT, SPEED, CHANGE, TERM = range(4)


@inline
def clear(r):
    for i in range(N_POSE):
        r[ADJOINT, i] = r[SPEED, i] = 0.0


@inline
def covary(kept, r):
    """The predicted covariance's first rows times the adjoint, in r[CHANGE]."""
    apply_matrix(kept.pose_pose, r[ADJOINT], r[CHANGE])
    apply_matrix(kept.pose_speed, r[SPEED], r[TERM])
    for i in range(N_POSE):
        r[CHANGE, i] += r[TERM, i]


@inline
def over_measurement(kept, r):
    """(35) Take the adjoint back over a frame's measurement: r + H^T S^-1 (z - H P r)."""
    covary(kept, r)
    apply_matrix(kept.information, r[CHANGE], r[TERM])
    for i in range(N_POSE):
        r[ADJOINT, i] += kept.pull[i] - r[TERM, i]


@inline
def over_transition(kept, r):
    """(35) Take the adjoint back over the transition to a frame: F^T r."""
    for i in range(N_POSE):
        r[SPEED, i] = kept.f01[i] * r[ADJOINT, i] + kept.f11[i] * r[SPEED, i]


@inline
def run_back(first, last, end, notes, kept, room, solver, out, at):
    """Smoothed poses of the frames first..last - 1 given all before `end`, from out[at] on."""
    works, r, n, poses, angles, root = room
    w, pose = works[0], poses[0]
    clear(r)
    clear_spread(n)
    for t in range(end - 1, first - 1, -1):
        if notes[t].kind == NOTHING:
            clear(r)
            clear_spread(n)
            continue
        over_measurement(kept[t], r)
        spread_over_measurement(kept[t], n)
        if t < last:
            # the smoothed pose is the predicted one plus P r
            covary(kept[t], r)
            copy_pose(kept[t], pose)
            move_pose(pose, r[CHANGE])
            store_row(w, solver, pose, angles, root, out[at + t - first])
            store_smoothed_spread(kept[t], n, out[at + t - first])
        if notes[t].kind == BEGUN:
            clear(r)
            clear_spread(n)
        else:
            over_transition(kept[t], r)
            spread_over_transition(kept[t], n)


@inline
def room_to_run():
    """A workspace, adjoints, a pose as a record and as arrays; who has it keeps it alive."""
    return (
        np.zeros(1, dtype=WORK),
        np.zeros((4, N_POSE)),
        np.zeros((3, N_ANGLES)),
        np.zeros(1, dtype=KEPT),
        np.zeros(N_ANGLES),
        np.zeros(12),
    )


@kernel
def smooth_frames(hand, solver, numbers, first, last, notes, kept, out):
    """Smoothed poses of the frames first..last - 1 from all that is kept.

    Args:
        hand, solver, numbers: as in `filter_frames`.
        first, last: which poses are wanted.
        notes: (T,) NOTE; kept: (T,) KEPT, as in `filter_frames`.
        out: (last - first,) RESULT; frames without a pose are left as they are.
    """
    settings = FilterNumbers(*numbers)
    room = room_to_run()
    load_hand(room[0][0], hand, settings)
    run_back(first, last, len(notes), notes, kept, room, solver, out, 0)


@kernel
def lag_frames(hand, solver, numbers, lag, notes, kept, out):
    """Poses of the frames 0..T - lag - 1, each smoothed by the `lag` frames after it.

    Args: as in `smooth_frames`; out (T - lag,) RESULT.
    """
    settings = FilterNumbers(*numbers)
    room = room_to_run()
    load_hand(room[0][0], hand, settings)
    for t in range(len(notes) - lag):
        run_back(t, t + 1, t + lag + 1, notes, kept, room, solver, out, t)
