"""How sure a mean or a standard deviation over frames is: the circular block bootstrap.

Errors of neighbouring frames are alike, so that n frames say less than n independent ones.
Resampling whole blocks of frames keeps that (Politis and Romano 1992); how long the blocks must
be is read off the series (Politis and White 2004, with the correction of Patton et al. 2009).
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError
from handtrack.evaluation.arrays import Array, or_none
from handtrack.evaluation.resampling import MIN_FRAMES, Moments, block_length, resamples

LEVEL = 0.95
"""Share of intervals that hold the true value, if all is well."""
MIN_BLOCKS = 6.0
"""With fewer blocks no interval is given: so few say next to nothing of how much they differ."""
MIN_PAIRED = 3.0
"""The same for differences of two series, whose intervals few blocks make wide."""
MIN_INDEPENDENT = 6.0
"""Nor for errors of frames that are worth fewer independent ones."""


@dataclass(frozen=True)
class Uncertain:
    """A number and the interval that holds its true value with probability `LEVEL`.

    Attributes:
        value: of the series as it is.
        low, high: ends of the interval; NaN where there are too few frames or blocks.
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
            name: or_none(value)
            for name, value in (("value", self.value), ("low", self.low), ("high", self.high))
        }


@dataclass(frozen=True)
class Intervals:
    """Mean and standard deviation of a series, or of what one series has more than another.

    Attributes:
        mean, std: with their intervals.
        block: frames in each block.
        few: why there are no intervals, or "".
    """

    mean: Uncertain
    std: Uncertain
    block: int
    few: str = ""


def intervals(values: ArrayLike) -> Intervals:
    """Intervals of the mean and of the (population's) standard deviation of a series.

    Of values that are never below 0, as errors are, the ends are not either: the resamples'
    quantiles are taken as ratios to the value.

    Args:
        values: (n,) in the order of time; NaN = no value in that frame.
    """
    series = Moments(values)
    wanted = series.block
    worth = independent(series.values)
    few, block = _few(series.n, wanted, worth), _shortened(wanted, series.n)
    if few:
        return Intervals(_alone(series.mean), _alone(series.std), block, few)
    mean, std = resamples([series], block)[0]
    blocks = min(series.n / block, worth)
    errors = bool((series.values[series.present] >= 0).all())
    of_mean = _by_ratio(series.mean, mean, blocks) if errors else _around(series.mean, mean, blocks)
    return Intervals(of_mean, _mirrored_ratio(series.std, std, blocks), block)


def paired_difference(a: ArrayLike, b: ArrayLike) -> Intervals:
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
    first, second = (Moments(np.where(missing, np.nan, x)) for x in (a, b))
    wanted = max(
        block_length(first.values - second.values),
        block_length(first.spread_influence - second.spread_influence),
    )
    few, block = _few(first.n, wanted, least=MIN_PAIRED), _shortened(wanted, first.n)
    mean, std = first.mean - second.mean, first.std - second.std
    if few:
        return Intervals(_alone(mean), _alone(std), block, few)
    (mean_a, std_a), (mean_b, std_b) = resamples([first, second], block)
    # a difference that only swells and shrinks is still one: it widens the interval
    blocks = min(first.n / block, max(independent(first.values - second.values), 3.0))
    return Intervals(
        _around(mean, mean_a - mean_b, blocks), _around(std, std_a - std_b, blocks), block
    )


def _few(n: int, block: float, worth: float = np.inf, least: float = MIN_BLOCKS) -> str:
    """Why n frames in such blocks, worth so many independent ones, make no interval, or ""."""
    if n < MIN_FRAMES:
        return f"{n} frames are too few for an interval"
    if n < least * block:
        return (
            f"{n} frames that hang together over about {block:.0f} are too few for an interval"
            f" ({n / block:.1f} blocks, {least:.0f} are needed)"
        )
    if worth < MIN_INDEPENDENT:
        return (
            f"{n} frames so alike that they are worth {worth:.1f} are too few for an interval"
            f" ({MIN_INDEPENDENT:.0f} are needed)"
        )
    return ""


def independent(values: ArrayLike) -> float:
    """How many independent frames say as much of the mean as these do: n (1 - r) / (1 + r).

    r is the correlation of neighbouring frames, (1 + 4 r) / n greater than it looks in n frames
    (Kendall 1954): the frames' own mean hides a part of it.

    Args:
        values: (n,), NaN = missing.
    """
    x = np.asarray(values, dtype=np.float64)
    present = ~np.isnan(x)
    n = int(present.sum())
    both = present[1:] & present[:-1]
    x = np.where(present, x - x[present].mean() if n else 0.0, 0.0)
    square = float((x**2).sum() / n) if n else 0.0
    if not (square > 0 and both.any()):
        return float(n)
    r = float((x[1:] * x[:-1])[both].mean()) / square
    r = min(max(r + (1 + 4 * r) / n, 0.0), 1 - 1 / n)
    return n * (1 - r) / (1 + r)


def _shortened(block: float, n: int) -> int:
    """A block's frames: at most 3 sqrt(n), and n / 3."""
    longest = max(1.0, min(3 * np.sqrt(n), n / 3))
    return int(np.ceil(np.clip(block, 1.0, longest)))


def _alone(value: float) -> Uncertain:
    return Uncertain(value, float("nan"), float("nan"))


def interval(value: float, resampled: Array, pieces: float, positive: bool = True) -> Uncertain:
    """The interval of a value by its resamples.

    Args:
        value: of the data as they are.
        resampled: (n,) of the resamples, NaN where one says nothing.
        pieces: how many independent pieces were drawn from: few say little of how much they
            differ, which makes the interval wider.
        positive: the value cannot be below 0, and so neither can the interval.
    """
    if not np.isfinite(value) or np.isnan(resampled).all() or pieces < 2:
        return _alone(value)
    return (_by_ratio if positive else _around)(value, resampled, pieces)


def student(p: float, free: float) -> float:
    """Quantile of Student's t by Cornish and Fisher's expansion, 3 % low at 2 degrees of freedom.

    scipy's is exact, and takes half a second to import.
    """
    z = NormalDist().inv_cdf(p)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / free + second / free**2 + third / free**3


def _around(value: float, resampled: Array, blocks: float) -> Uncertain:
    """The basic interval: the resamples' quantiles mirrored about the value."""
    low, high = _quantiles(resampled)
    wider = _wider(blocks)
    return Uncertain(
        value, float(value - wider * (high - value)), float(value + wider * (value - low))
    )


def _by_ratio(value: float, resampled: Array, blocks: float) -> Uncertain:
    """The percentile interval of a mean that cannot be below 0."""
    if not value > 0:
        return Uncertain(value, value, value)
    ratio = np.maximum(_quantiles(resampled), 0.0) / value  # rounding reaches below
    low, high = ratio ** _wider(blocks) * value
    return Uncertain(value, min(float(low), value), max(float(high), value))


def _mirrored_ratio(value: float, resampled: Array, blocks: float) -> Uncertain:
    """The basic interval of a deviation's logarithm: resamples deviate too little."""
    if not value > 0:
        return Uncertain(value, value, value)
    low, high = _quantiles(resampled)
    if not low > 0:  # some resamples hold one value only: no logarithm
        plain = _around(value, resampled, blocks)
        return Uncertain(value, max(0.0, plain.low), plain.high)
    wider = _wider(blocks)
    return Uncertain(value, value * (value / high) ** wider, value * (value / low) ** wider)


def _quantiles(resampled: Array) -> tuple[float, float]:
    tail = (1 - LEVEL) / 2
    # as np.quantile, which is twenty times as slow on so few values
    known = np.sort(resampled[~np.isnan(resampled)])
    at = np.array([tail, 1 - tail]) * (len(known) - 1)
    below = at.astype(np.int64)
    above = np.minimum(below + 1, len(known) - 1)
    low, high = known[below] + (at - below) * (known[above] - known[below])
    return float(low), float(high)


def _wider(blocks: float) -> float:
    """Few blocks say too little of the spread: Student's t and the lost degree of freedom."""
    tail = (1 - LEVEL) / 2
    free = max(blocks - 1, 1.0)
    return float(student(1 - tail, free) / NormalDist().inv_cdf(1 - tail) * np.sqrt(blocks / free))
