"""How sure a mean or a standard deviation over frames is: the circular block bootstrap.

Errors of neighbouring frames are alike, so that n frames say less than n independent ones.
Resampling whole blocks of frames keeps that (Politis and Romano 1992); how long the blocks must
be is read off the series (Politis and White 2004, with the correction of Patton et al. 2009).
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.evaluation.arrays import Array

REPEATS = 2000
"""Resamples of each series."""
LEVEL = 0.95
"""Share of intervals that hold the true value, if all is well."""
MIN_FRAMES = 8
"""With fewer frames no interval is given."""
_DRAWS = 1_000_000
"""Blocks drawn in all; in longer series blocks are longer than they need be."""
_SEED = 20210


@dataclass(frozen=True)
class Uncertain:
    """A number and the interval that holds its true value with probability `LEVEL`.

    Attributes:
        value: of the series as it is.
        low, high: ends of the interval; NaN where there are too few frames.
    """

    value: float
    low: float
    high: float

    @property
    def clear(self) -> bool:
        """Whether the interval leaves out zero."""
        return self.low > 0 or self.high < 0

    def to_dict(self) -> dict[str, float | None]:
        """The three numbers; None for NaN."""
        return {
            name: value if np.isfinite(value) else None
            for name, value in (("value", self.value), ("low", self.low), ("high", self.high))
        }


@dataclass(frozen=True)
class Intervals:
    """Mean and standard deviation of a series, or of what one series has more than another.

    Attributes:
        mean, std: with their intervals.
        block: frames in each block.
    """

    mean: Uncertain
    std: Uncertain
    block: int


def intervals(values: ArrayLike) -> Intervals:
    """Intervals of the mean and of the (population's) standard deviation of a series.

    Args:
        values: (n,) in the order of time; NaN = no value in that frame.
    """
    series = _Moments(values)
    block = series.block
    mean, std = _resampled([series], block)[0]
    blocks = max(series.n / block, 2.0)
    return Intervals(
        _around(series.mean, mean, blocks), _around(series.std, std, blocks, 0.0), block
    )


def difference(a: ArrayLike, b: ArrayLike) -> Intervals:
    """How much greater mean and standard deviation of `a` are than those of `b`.

    Both are resampled by the same blocks, so that what is hard for both cancels out.

    Args:
        a, b: (n,) values of the same frames; frames in which either is NaN are left out.

    Raises:
        InputError: shapes differ.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if a.shape != b.shape or a.ndim != 1:
        raise InputError(f"series have shapes {a.shape} and {b.shape}, expected one of (frames,)")
    missing = np.isnan(a) | np.isnan(b)
    first, second = (_Moments(np.where(missing, np.nan, x)) for x in (a, b))
    block = max(
        block_length(first.values - second.values),
        block_length(first.spread_influence - second.spread_influence),
    )
    (mean_a, std_a), (mean_b, std_b) = _resampled([first, second], block)
    blocks = max(first.n / block, 2.0)
    return Intervals(
        _around(first.mean - second.mean, mean_a - mean_b, blocks),
        _around(first.std - second.std, std_a - std_b, blocks),
        block,
    )


class _Moments:
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
    def block(self) -> int:
        return max(block_length(self.values), block_length(self.spread_influence))


def block_length(values: ArrayLike) -> int:
    """Frames in a block of the circular block bootstrap of a series' mean.

    Politis and White (2004): b = (2 G^2 / D)^(1/3) n^(1/3), with G = sum_k w_k |k| R_k and
    D = 4/3 (sum_k w_k R_k)^2 of the autocovariances R_k under a flat-top window that ends where
    the autocorrelation is lost in noise.

    Args:
        values: (n,), NaN = missing.

    Returns:
        1 for a series without memory; at most 3 sqrt(n), and n / 3.
    """
    x = np.asarray(values, dtype=np.float64)
    present = ~np.isnan(x)
    n = int(present.sum())
    if n < MIN_FRAMES:
        return 1
    x = np.where(present, x - x[present].mean(), 0.0)
    few = max(5, int(np.ceil(np.sqrt(np.log10(n)))))
    reach = min(int(np.ceil(np.sqrt(n))) + few, len(x) - 1)
    size = 1 << int(np.ceil(np.log2(len(x) + reach + 1)))
    power = np.abs(np.fft.rfft(x, size)) ** 2
    covariance = np.fft.irfft(power, size)[: reach + 1] / n
    if not covariance[0] > 0:
        return 1
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
    longest = max(1.0, min(3 * np.sqrt(n), n / 3))
    if not total > 0:
        return 1
    best = (2 * g**2 / (4 / 3 * total**2)) ** (1 / 3) * n ** (1 / 3)
    return int(np.ceil(np.clip(best, 1.0, longest)))


def _resampled(series: list[_Moments], block: int) -> list[tuple[Array, Array]]:
    """(REPEATS,) means and standard deviations of each series, by the same blocks."""
    n = len(series[0].values)
    if min(s.n for s in series) < MIN_FRAMES:
        nothing = np.full(REPEATS, np.nan)
        return [(nothing, nothing)] * len(series)
    block = max(block, -(-n * REPEATS // _DRAWS))
    blocks = -(-n // block)
    rng = np.random.default_rng(_SEED)
    starts = rng.integers(0, n, (blocks, REPEATS))
    # the last block is cut so that a resample is as long as the series
    ends = starts + np.append(np.full(blocks - 1, block), n - (blocks - 1) * block)[:, None]
    return [_moments(s, starts, ends, block) for s in series]


def _moments(
    series: _Moments, starts: NDArray[np.int64], ends: NDArray[np.int64], block: int
) -> tuple[Array, Array]:
    def sums(x: Array) -> Array:
        around = np.concatenate([[0.0], np.cumsum(np.concatenate([x, x[:block]]))])
        return np.asarray((around[ends] - around[starts]).sum(0))

    count = sums(series.present.astype(np.float64)) if series.n < len(series.values) else None
    if count is None:
        count = np.full(starts.shape[1], float(series.n))
    count = np.where(count > 0, count, np.nan)
    mean = sums(series.centred) / count
    square = sums(series.centred**2) / count
    return mean + series.mean, np.sqrt(np.maximum(square - mean**2, 0.0))


def student(p: float, free: float) -> float:
    """Quantile of Student's t by Cornish and Fisher's expansion, 3 % low at 2 degrees of freedom.

    scipy's is exact, and takes half a second to import.
    """
    z = NormalDist().inv_cdf(p)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / free + second / free**2 + third / free**3


def _around(value: float, resampled: Array, blocks: float, least: float = -np.inf) -> Uncertain:
    """The basic interval: the resamples' quantiles mirrored about the value.

    Few blocks say too little of the spread: Student's t and the lost degree of freedom widen it.
    """
    known = resampled[~np.isnan(resampled)]
    if not known.size:
        return Uncertain(value, float("nan"), float("nan"))
    tail = (1 - LEVEL) / 2
    free = max(blocks - 1, 1.0)
    wider = student(1 - tail, free) / NormalDist().inv_cdf(1 - tail) * np.sqrt(blocks / free)
    low, high = np.quantile(known, [tail, 1 - tail])
    return Uncertain(
        value,
        max(least, float(value - wider * (high - value))),
        float(value + wider * (value - low)),
    )
