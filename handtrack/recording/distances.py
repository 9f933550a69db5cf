"""Distances of a frame's joints, summed up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def mean_and_max(distance: Array) -> tuple[Array, Array]:
    """(T,) mean and greatest of the known values in each row (T, n), NaN where there is none."""
    known = np.isfinite(distance)
    count = known.sum(1)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, distance, 0).sum(1) / count
    greatest = np.where(known, distance, -np.inf).max(1)
    return mean, np.where(count > 0, greatest, np.nan)
