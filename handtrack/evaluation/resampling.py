"""Resamples of series by whole blocks of frames, and how long the blocks must be.

The circular block bootstrap (Politis and Romano 1992), with the block length of Politis and White
(2004) as Patton et al. (2009) corrected it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.evaluation.arrays import Array

REPEATS = 2000
"""Resamples of each series."""
MIN_FRAMES = 8
"""With fewer frames no interval is given."""
_DRAWS = 1_000_000
"""Blocks drawn in all; in longer series blocks are longer than they need be."""
_DRAWN = 64
"""Blocks of each resample summed at a time."""
_SEED = 20210


class Moments:
    """A series with what its mean and its standard deviation need."""

    def __init__(self, values: ArrayLike):
        self.values = np.asarray(values, dtype=np.float64).ravel()
        self.present = ~np.isnan(self.values)
        known = self.values[self.present]
        self.n = len(known)
        self.mean = float(known.mean()) if self.n else float("nan")
        self.std = float(known.std()) if self.n else float("nan")
        self.centred = np.where(self.present, self.values - self.mean, 0.0)

    @property
    def spread_influence(self) -> Array:
        """How much each frame moves the standard deviation."""
        scale = 2 * self.std if self.std > 0 else 1.0
        return np.where(self.present, (self.centred**2 - self.std**2) / scale, np.nan)

    @property
    def block(self) -> float:
        return max(block_length(self.values), block_length(self.spread_influence))


def block_length(values: ArrayLike) -> float:
    """Frames in a block of the circular block bootstrap of a series' mean.

    Politis and White (2004): b = (2 G^2 / D)^(1/3) n^(1/3), with G = sum_k w_k |k| R_k and
    D = 4/3 (sum_k w_k R_k)^2 of the autocovariances R_k under a flat-top window that ends where
    the autocorrelation is lost in noise.

    Args:
        values: (n,), NaN = missing.

    Returns:
        At least 1, as for a series without memory; at most n.
    """
    x = np.asarray(values, dtype=np.float64)
    present = ~np.isnan(x)
    n = int(present.sum())
    if n < MIN_FRAMES:
        return 1.0
    x = np.where(present, x - x[present].mean(), 0.0)
    few = max(5, int(np.ceil(np.sqrt(np.log10(n)))))
    reach = min(int(np.ceil(np.sqrt(n))) + few, len(x) - 1)
    size = 1 << int(np.ceil(np.log2(len(x) + reach + 1)))
    waves = np.fft.rfft(x, size)
    np.multiply(waves, waves.conj(), out=waves)
    covariance = np.fft.irfft(waves, size)[: reach + 1] / n
    if not covariance[0] > 0:
        return 1.0
    quiet = np.abs(covariance[1:] / covariance[0]) < 2 * np.sqrt(np.log10(n) / n)
    runs = np.lib.stride_tricks.sliding_window_view(quiet, min(few, len(quiet))).all(1)
    if runs.any():
        memory = int(np.argmax(runs))
    else:
        loud = np.flatnonzero(~quiet)
        memory = int(loud[-1]) + 1 if loud.size else 0
    lags = np.arange(1, min(2 * max(memory, 1), reach) + 1)
    window = np.minimum(1.0, 2.0 * (1.0 - lags / lags[-1]))  # 1 up to the middle, 0 at the end
    weighted = window * covariance[lags]
    g, total = 2 * (weighted * lags).sum(), covariance[0] + 2 * weighted.sum()
    if not total > 0:
        return 1.0
    best = (2 * g**2 / (4 / 3 * total**2)) ** (1 / 3) * n ** (1 / 3)
    return float(np.clip(best, 1.0, n))


def resamples(series: list[Moments], block: int) -> list[tuple[Array, Array]]:
    """(REPEATS,) means and standard deviations of each series, by the same blocks."""
    n = len(series[0].values)
    block = max(block, -(-n * REPEATS // _DRAWS))
    blocks = -(-n // block)
    rng = np.random.default_rng(_SEED)
    starts = rng.integers(0, n, (blocks, REPEATS))
    # the last block is cut so that a resample is as long as the series
    ends = starts + np.append(np.full(blocks - 1, block), n - (blocks - 1) * block)[:, None]
    return [_moments(s, starts, ends, block) for s in series]


def _moments(
    series: Moments, starts: NDArray[np.int64], ends: NDArray[np.int64], block: int
) -> tuple[Array, Array]:
    def sums(x: Array) -> Array:
        around = np.zeros(len(x) + block + 1)
        np.cumsum(x, out=around[1 : len(x) + 1])
        around[len(x) + 1 :] = around[len(x)] + np.cumsum(x[:block])
        found = np.zeros(starts.shape[1])
        for i in range(0, len(starts), _DRAWN):
            found += (around[ends[i : i + _DRAWN]] - around[starts[i : i + _DRAWN]]).sum(0)
        return found

    count = sums(series.present.astype(np.float64)) if series.n < len(series.values) else None
    if count is None:
        count = np.full(starts.shape[1], float(series.n))
    count = np.where(count > 0, count, np.nan)
    mean = sums(series.centred) / count
    square = sums(series.centred**2) / count
    return mean + series.mean, np.sqrt(np.maximum(square - mean**2, 0.0))
