"""Where angles meet their limits: what the viewer marks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.limits import SADDLE_FLEXION, Limits
from handtrack.hand.skeleton import PARENTS

INSIDE, HELD, OUTSIDE = 0, 1, 2

_NEAR = np.deg2rad(0.5)
_OVER = np.deg2rad(0.1)
_CORNERS = 25
_RING = 0.28  # of the length of the bone that arrives at a joint
_LEAST_M, _MOST_M = 0.0055, 0.013


def limit_marks(limits: Limits, angles: NDArray[np.float64]) -> NDArray[np.uint8]:
    """INSIDE, HELD (within 0.5 degrees of a limit) or OUTSIDE (0.1 degrees and more).

    The two angles of a saddle share a mark, as they share an ellipse.

    Args:
        limits: the limits to look at.
        angles: (T, 20) [rad].

    Returns:
        (T, 20); INSIDE where an angle is NaN.
    """
    lower, upper = limits.lower, limits.upper
    room = np.minimum(angles - lower, upper - angles)
    flexion, abduction = SADDLE_FLEXION, SADDLE_FLEXION + 1
    saddles = np.stack([angles[:, flexion], angles[:, abduction]], -1)
    axes = np.where(
        saddles < 0,
        -np.stack([lower[flexion], lower[abduction]], -1),
        np.stack([upper[flexion], upper[abduction]], -1),
    )
    inside = 1 - np.sqrt(((saddles / axes) ** 2).sum(-1))
    room[:, flexion] = room[:, abduction] = inside * axes.min(-1)
    over = limits.violation(angles) if len(angles) else np.zeros_like(room)
    over[:, flexion] = over[:, abduction] = np.maximum(over[:, flexion], over[:, abduction])
    with np.errstate(invalid="ignore"):
        marks = np.where(room < _NEAR, HELD, INSIDE)
        return np.where(over > _OVER, OUTSIDE, marks).astype(np.uint8)


def rings(joints: NDArray[np.float64], at: NDArray[np.int64]) -> NDArray[np.float64]:
    """A ring about a joint, as on a finger: square to the bone that arrives there.

    Args:
        joints: (n, 21, 3) [m].
        at: (n,) a joint of each, not the wrist.

    Returns:
        (n, 25, 3) points of closed lines.
    """
    rows = np.arange(len(at))
    centre = joints[rows, at]
    bone = centre - joints[rows, PARENTS[at]]
    length = np.linalg.norm(bone, axis=-1, keepdims=True)
    along = bone / np.maximum(length, 1e-9)
    aside = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=-1)])
    aside /= np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-9)
    other = np.cross(along, aside)
    turn = np.linspace(0, 2 * np.pi, _CORNERS)[:, None]
    radius = np.clip(_RING * length, _LEAST_M, _MOST_M)[:, None]
    circle = np.cos(turn) * aside[:, None] + np.sin(turn) * other[:, None]
    return np.asarray(centre[:, None] + radius * circle)
