"""Where angles meet their limits: what the viewer marks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.limits import SADDLE_FLEXION, Limits

INSIDE, HELD, OUTSIDE = 0, 1, 2

_NEAR = np.deg2rad(0.5)
_OVER = np.deg2rad(0.1)


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
