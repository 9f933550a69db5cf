"""What the Kalman filter of poses remembers, and what it leaves for a smoother.

The state holds a pose, 26 numbers with a small turn of the world away from a reference that is
moved along, so that there is no wrap-around; their velocities; and the covariance of both as
three blocks of 26 x 26. Where the joints' noise lasts, what it does to the pose is in the state
too: the drift (see `drift`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import (
    add,
    column,
    log_turn,
    part,
    put_column,
    put_part,
    put_row,
    row,
    sub,
    turn_of,
    turned,
)
from handtrack.kernels.workspace import N_ANGLES, N_POSE

# filters of the bank that learns the motion's noise (see `motion_noise`)
BANK = 7
# what a state with drift holds beside its pose: velocities, then the drift (see `drift`)
REST = 2 * N_POSE
# what happened to a frame
NOTHING, PREDICTED, UPDATED, BEGUN = range(4)

_Fields = list[tuple[str, str, tuple[int, ...]]]
_PAIR, _ROW, _BANK = (N_POSE, N_POSE), (N_POSE,), (BANK, N_POSE)
_POSE: _Fields = [
    ("angles", "f8", (N_ANGLES,)),
    ("rotation", "f8", (3, 3)),
    ("translation", "f8", (3,)),
]
_MOTION: _Fields = [
    # transition of a number from its velocity and of the velocity; noise at unit density:
    # variance, covariance with the velocity, variance of the velocity (see `unit_process`)
    ("f01", "f8", _ROW),
    ("f11", "f8", _ROW),
    ("q00", "f8", _ROW),
    ("q01", "f8", _ROW),
    ("q11", "f8", _ROW),
]
_COMMON: _Fields = [
    *_POSE,
    ("velocity", "f8", _ROW),
    # the covariance of poses
    ("pose_pose", "f8", _PAIR),
    # whether there is a state; the last frame's time, and the last fitted one's
    ("known", "i8", ()),
    ("time_ns", "i8", ()),
    ("fitted_ns", "i8", ()),
    # variance of the joints [m^2], of how many frames, what share of the past counts
    ("noise", "f8", ()),
    ("noise_count", "f8", ()),
    ("fade", "f8", ()),
    # what part of that variance is new in every frame
    ("white", "f8", ()),
    # the motion since the last frame, and the densities of its noise
    *_MOTION,
    ("density", "f8", _ROW),
    # the bank: its filters' numbers, logarithms of their weights, and what all have learnt
    ("bank_x", "f8", _BANK),
    ("bank_v", "f8", _BANK),
    ("bank_xx", "f8", _BANK),
    ("bank_xv", "f8", _BANK),
    ("bank_vv", "f8", _BANK),
    ("bank_log", "f8", _BANK),
    ("learnt", "f8", _ROW),
    # a frame's measurement: whether there was one; the pose that it gives; its distance from the
    # prediction, and that times the prediction's precision; its information
    ("measured", "i8", ()),
    ("best_angles", "f8", (N_ANGLES,)),
    ("best_root", "f8", (12,)),
    ("distance", "f8", _ROW),
    ("pull", "f8", _ROW),
    ("precision", "f8", _PAIR),
    ("system", "f8", _PAIR),
    # `factor` is the whole system's, with the logarithm of its determinant
    ("ready", "i8", ()),
    ("log_determinant", "f8", ()),
    # variances before the update; innovations
    ("before", "f8", _ROW),
    ("innovation", "f8", _ROW),
    # room for work
    ("gradient", "f8", _ROW),
    ("step", "f8", _ROW),
    ("factor", "f8", _PAIR),
    ("posterior", "f8", _PAIR),
    ("work", "f8", _PAIR),
    ("work_2", "f8", _PAIR),
]
_STATE: _Fields = [
    *_COMMON,
    # further blocks of the covariance: poses with velocities, velocities
    ("pose_speed", "f8", _PAIR),
    ("speed_speed", "f8", _PAIR),
]
_DRIFTING: _Fields = [
    *_COMMON,
    # the drift; further blocks of the covariance: poses with the rest, the rest
    ("drift", "f8", _ROW),
    ("pose_rest", "f8", (N_POSE, REST)),
    ("rest_rest", "f8", (REST, REST)),
    # the joints' noise that lasts: its share; what part of residuals is not their mean; its
    # variance over that of `noise`, and how long it lasts [s]
    ("share", "f8", ()),
    ("moving", "f8", ()),
    ("colour", "f8", ()),
    ("lasts", "f8", ()),
    # what the share is learnt from (see `joint_noise`): what a joint's residual is on the whole and
    # of how many frames, what it was in the last frame, if any; sums of their products
    ("usual", "f8", (21, 3)),
    ("usual_count", "f8", (21,)),
    ("residual", "f8", (21, 3)),
    ("had", "i8", (21,)),
    ("pairs", "f8", ()),
    ("products", "f8", ()),
    ("squares", "f8", ()),
    ("whole", "f8", ()),
    # what of the drift stays until the frame, and what share of its deviation is new; its
    # covariance; that of a pose for unit noise of the joints, and how many they were
    ("stays", "f8", _ROW),
    ("renewed", "f8", _ROW),
    ("spread", "f8", _PAIR),
    ("unit", "f8", _PAIR),
    ("unit_seen", "i8", ()),
    # joints of each finger that the last frame had
    ("fingers_seen", "i8", (5,)),
    # the bank: its filters' drifts and their covariances
    ("bank_c", "f8", _BANK),
    ("bank_xc", "f8", _BANK),
    ("bank_vc", "f8", _BANK),
    ("bank_cc", "f8", _BANK),
    ("wide", "f8", (N_POSE, REST)),
    ("wide_2", "f8", (N_POSE, REST)),
]
_SEEN: _Fields = [
    # of a frame: its motion, the predicted pose, its predicted covariance
    *_MOTION,
    *_POSE,
    ("pose_pose", "f8", _PAIR),
    # H^T S^-1 H and H^T S^-1 z of its measurement
    ("information", "f8", _PAIR),
    ("pull", "f8", _ROW),
    # of each angle: predicted variance, covariance with its velocity, and what the measurement
    # takes (see `smoothed_variances`)
    ("prior", "f8", (N_ANGLES,)),
    ("cross", "f8", (N_ANGLES,)),
    ("gain", "f8", (N_ANGLES,)),
]
_KEPT: _Fields = [*_SEEN, ("pose_speed", "f8", _PAIR)]
_KEPT_DRIFTING: _Fields = [
    *_SEEN,
    ("pose_rest", "f8", (N_POSE, REST)),
    # the predicted drift, the rows of its covariance with the rest, and how much of it stays
    ("drift", "f8", _ROW),
    ("drift_rest", "f8", (N_POSE, REST)),
    ("stays", "f8", _ROW),
]

FILTER = np.dtype(_STATE, align=True)
DRIFTING = np.dtype(_DRIFTING, align=True)
"""A state with drift."""
KEPT = np.dtype(_KEPT, align=True)
"""What a smoother needs of a frame."""
KEPT_DRIFTING = np.dtype(_KEPT_DRIFTING, align=True)
"""The same of a state with drift."""
NOTE = np.dtype([("kind", "i8"), ("likelihood", "f8"), ("noise", "f8")], align=True)
"""What happened to a frame, its log likelihood [nats], the joints' noise variance [m^2]."""


class FilterNumbers(NamedTuple):
    """How frames are filtered. Compiled code is given plain tuples: those it takes faster.

    Attributes:
        coupled: 1 to couple pose and prediction.
        follow: 1 to follow the motion's noise.
        noise: variance of the joints [m^2], or 0 to follow it with `gain`.
        coast_ns: how long a state holds without a fit [ns].
        forget_s: time over which the bank forgets [s].
        loss, spread2: the robust loss, the square of its spread [m^2].
        share: what share of the joints' noise lasts, negative to follow it.
        moving: what part of the residuals is not their mean, negative to follow it.
        lasts_s: how long the noise lasts [s].
        corrected: 1 where the noise is that of joints corrected by a profile.
    """

    coupled: int
    follow: int
    noise: float
    gain: float
    coast_ns: int
    forget_s: float
    loss: int
    spread2: float
    share: float = 0.0
    moving: float = 1.0
    lasts_s: float = 0.1
    corrected: int = 0


@inline
def turn_by(rotation, w):
    """Turn a rotation (3, 3) by the vector w on the left, in place."""
    turn = turn_of(w)
    for j in range(3):
        put_column(rotation, j, turned(turn, column(rotation, j)))


@inline
def move_pose(pose, d):
    """Add d (26,) to a pose: angles, turn on the left, translation."""
    for i in range(N_ANGLES):
        pose.angles[i] += d[i]
    turn_by(pose.rotation, part(d, N_ANGLES))
    put_part(pose.translation, 0, add(part(pose.translation, 0), part(d, N_ANGLES + 3)))


@inline
def copy_pose(source, target):
    for i in range(N_ANGLES):
        target.angles[i] = source.angles[i]
    for i in range(3):
        put_row(target.rotation, i, row(source.rotation, i))
        target.translation[i] = source.translation[i]


@inline
def set_pose(pose, angles, root):
    """A pose from angles (20,) and root (12,)."""
    for i in range(N_ANGLES):
        pose.angles[i] = angles[i]
    for i in range(3):
        put_row(pose.rotation, i, part(root, 3 * i))
        pose.translation[i] = root[9 + i]


@inline
def pose_less(w, pose, d):
    """d (26,): how far the pose in the workspace is from another."""
    for i in range(N_ANGLES):
        d[i] = w.angle[i % 4, i // 4] - pose.angles[i]
    put_part(d, N_ANGLES, log_turn(w.rotation, pose.rotation))
    shift = sub(part(w.translation, 0), part(pose.translation, 0))
    put_part(d, N_ANGLES + 3, shift)
