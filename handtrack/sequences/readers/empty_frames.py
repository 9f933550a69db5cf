"""Frames without rows in a table of numbered frames: those in which nothing was seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.clock import Stamps

_MOST_FILLED = 300


def filled(numbers: NDArray[np.int64], stamps: Stamps | None) -> bool:
    """Whether numbers without rows are frames in which nothing was seen."""
    steps = np.diff(numbers)
    if not len(steps) or (steps == 1).mean() < 0.5 or steps.max() > _MOST_FILLED:
        return False
    few = numbers[-1] - numbers[0] <= 3 * len(numbers) + 100
    return bool(few) and (stamps is None or isinstance(stamps.values, np.ndarray))


def between(stamps: Stamps, numbers: NDArray[np.int64], every: NDArray[np.int64]) -> Stamps:
    """Times of all frames, of those without rows between their neighbours'."""
    values = stamps.values
    since = values - values[0]
    between = np.interp(every, numbers, since.astype(np.float64))
    if values.dtype.kind == "i":
        full = np.round(between).astype(np.int64) + values[0]
        full[numbers - numbers[0]] = values
        return Stamps(full, stamps.name, stamps.unit)
    full = between + values[0]
    full[numbers - numbers[0]] = values
    return Stamps(full, stamps.name, stamps.unit)
