"""Medians, slow parts and runs: what the checks of an audit share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation.arrays import Array
from handtrack.sequences.skeleton_check import median

SLOW = 31
"""Frames whose median is a slow part."""


def spread(x: Array) -> Array:
    """Standard deviation (n,) of what is not far off, from the median of distances (T, n)."""
    return np.asarray(1.4826 * median(np.abs(x - median(x, 0)), 0))


def slow(x: Array, frames: int = SLOW) -> Array:
    """Median (T, n) over the frames about each; fewer at the ends; NaN of nothing."""
    half = frames // 2
    edge = np.full((half, x.shape[1]), np.nan)
    padded = np.concatenate([edge, x, edge])
    out = np.empty(x.shape)
    for start in range(0, len(x), _BLOCK):  # windows are copied when sorted
        part = padded[start : min(start + _BLOCK, len(x)) + 2 * half]
        windows = np.lib.stride_tricks.sliding_window_view(part, frames, axis=0)
        out[start : start + _BLOCK] = median(np.ascontiguousarray(windows), 2)
    return out


def runs_of(marks: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """First and last frame of every run of at least so many marked frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marks, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2) if b - a >= least]


_BLOCK = 4000
