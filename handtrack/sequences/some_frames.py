"""Frames enough to judge a clip by, evenly spread over it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import by_blocks, evenly, rows_of
from handtrack.sequences.readers.raw import Array

_TRIED = 8
"""Of so many times the frames that are wanted enough are looked for, before all are."""
HUGE = 1e12
"""No joint is so far away in any unit; damaged numbers are."""


def there(joints: Array) -> NDArray[np.bool_]:
    """(..., N) which joints (..., N, 3) have three numbers that can be places."""
    near = np.abs(joints) < HUGE
    return np.asarray(near[..., 0] & near[..., 1] & near[..., 2])


def some_frames(joints: Array, most: int, least: int) -> NDArray[np.int64]:
    """Which frames of joints (T, N, 3) to look at: at most so many, evenly spread, in order.

    Args:
        joints: (T, N, 3), NaN = missing.
        most: frames.
        least: joints that each of them has.

    Returns:
        All frames that have them where these are no more.
    """
    tried = np.arange(len(joints))
    if len(joints) > _TRIED * most:
        tried = evenly(tried, _TRIED * most)
    found = _having(joints, tried, least)
    if len(found) < most and len(tried) < len(joints):
        found = _having(joints, np.arange(len(joints)), least)
    return evenly(found, most)


def _having(joints: Array, frames: NDArray[np.int64], least: int) -> NDArray[np.int64]:
    def counted(rows: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray(there(rows_of(joints, rows)).sum(1))

    return frames[by_blocks(counted, frames) >= least] if len(frames) else frames
