"""Numbers of many clips, and how sure they are: sums by clip, resampled by subjects, then clips.

Clips of one person are not independent: who moves gently does so in all of them. So resamples
draw subjects first, and then clips of each subject drawn (the two-stage bootstrap of clustered
data, Davison and Hinkley 1997, section 3.8).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation.bootstrap import Uncertain, interval

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SUMS = (
    *("errors", "error", "square", "input_errors", "input_error"),
    *("moved", "jitter", "input_moved", "input_jitter", "explained", "residual", "bound"),
    *("frames", "lost"),
)
"""What is added up over frames: counts, and values times counts."""
MEASURES = (
    *("pa_mpjpe_mm", "pa_mpjpe_std_mm", "jitter_m_s3", "input_jitter_m_s3"),
    *("input_pa_mpjpe_mm", "residual_mm", "bound_mm", "lost_percent"),
)
"""What the sums say."""
_REPEATS = 1000
"""Resamples of the whole."""
_BANK, _FEWEST, _DRAWS = 400, 100, 20_000_000
"""Resamples of each subject's clips, fewer where there are very many clips."""
_CHUNK = 4_000_000
_SEED = 20210
_ROUNDING = 1e-12
"""Of sums over many frames, as a share: nothing is known below it."""


class Units(NamedTuple):
    """Sums by clip.

    Attributes:
        sums: (U, len(SUMS)), or those of several runs side by side.
        subject: (U,) whose clip it is, 0..S-1.
        subjects: how many there are.
        known: whether subjects are known; else all clips are taken for independent.
    """

    sums: Array
    subject: Index
    subjects: int
    known: bool

    def of(self, chosen: NDArray[np.bool_]) -> Units:
        """Some of the clips."""
        names, subject = np.unique(self.subject[chosen], return_inverse=True)
        return Units(self.sums[chosen], subject, len(names), self.known)


def row_sums(columns: Mapping[str, Array]) -> Array:
    """(N, len(SUMS)) of the rows of a table, by its columns."""
    frames, compared = columns["frames"], columns["compared"]

    def weighed(name: str, weight: Array) -> tuple[Array, Array]:
        value = columns[name]
        known = np.where(np.isfinite(value), weight, 0.0)
        return known, np.where(known > 0, known * np.nan_to_num(value), 0.0)

    errors, error = weighed("pa_mpjpe_mean_mm", compared)
    mean, std = columns["pa_mpjpe_mean_mm"], columns["pa_mpjpe_std_mm"]
    square = np.where(errors > 0, errors * np.nan_to_num(std**2 + mean**2), 0.0)
    input_errors, input_error = weighed("input_pa_mpjpe_mean_mm", compared)
    moved, jitter = weighed("jitter_m_s3", frames)
    input_moved, input_jitter = weighed("input_jitter_m_s3", frames)
    explained, residual = weighed("residual_mm", frames)
    _, bound = weighed("bound_mm", frames)
    return np.stack(
        [
            *(errors, error, square, input_errors, input_error),
            *(moved, jitter, input_moved, input_jitter, explained, residual, bound),
            *(frames, columns["lost"]),
        ],
        axis=1,
    )


def measures(sums: Array) -> dict[str, Array]:
    """What sums (..., len(SUMS)) say, by the names of `MEASURES`; NaN where nothing is known."""
    at = {name: sums[..., i] for i, name in enumerate(SUMS)}

    def mean(total: str, count: str) -> Array:
        known = at[count] > 0
        return np.asarray(np.where(known, at[total] / np.where(known, at[count], 1.0), np.nan))

    error = mean("error", "errors")
    square = mean("square", "errors")
    return {
        "pa_mpjpe_mm": error,
        "pa_mpjpe_std_mm": np.sqrt(np.maximum(square - error**2, 0.0)),
        "jitter_m_s3": mean("jitter", "moved"),
        "input_jitter_m_s3": mean("input_jitter", "input_moved"),
        "input_pa_mpjpe_mm": mean("input_error", "input_errors"),
        "residual_mm": mean("residual", "explained"),
        "bound_mm": mean("bound", "explained"),
        "lost_percent": 100 * mean("lost", "frames"),
    }


def resamples(units: Units) -> tuple[Array, list[Array], float]:
    """Sums of resamples.

    Returns:
        (R, K) of the whole; of each subject (B, K) or, of one clip, (1, K); and how many
        independent pieces were drawn from.
    """
    rng = np.random.default_rng(_SEED)
    n = len(units.sums)
    repeats = int(np.clip(_DRAWS // max(n, 1), _FEWEST, _BANK))
    order = np.argsort(units.subject, kind="stable")
    ends = np.searchsorted(units.subject[order], np.arange(units.subjects + 1))
    banks = [_drawn(units.sums[order[a:b]], repeats, rng) for a, b in pairwise(ends)]
    if units.subjects == 1:
        return _drawn(units.sums, _REPEATS if n < 20_000 else repeats, rng), banks, float(n)
    whole = np.zeros((_REPEATS, units.sums.shape[1]))
    sizes = np.array([len(bank) for bank in banks])
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    flat = np.concatenate(banks)
    step = max(1, _CHUNK // (flat.shape[1] * max(units.subjects, 1)))
    for begin in range(0, _REPEATS, step):
        part = slice(begin, min(begin + step, _REPEATS))
        who = rng.integers(0, units.subjects, (part.stop - begin, units.subjects))
        which = (rng.random(who.shape) * sizes[who]).astype(np.int64)
        whole[part] = flat[starts[who] + which].sum(1)
    return whole, banks, float(units.subjects)


def _drawn(sums: Array, repeats: int, rng: np.random.Generator) -> Array:
    """(repeats, K) sums of as many clips drawn from these."""
    n = len(sums)
    if n == 1:
        return sums
    out = np.empty((repeats, sums.shape[1]))
    step = max(1, _CHUNK // n)
    for begin in range(0, repeats, step):
        part = slice(begin, min(begin + step, repeats))
        rows = part.stop - begin
        index = rng.integers(0, n, (rows, n)) + n * np.arange(rows)[:, None]
        # how often each clip was drawn: adding up is then a product of matrices
        times = np.bincount(index.ravel(), minlength=rows * n).reshape(rows, n)
        out[part] = times.astype(np.float64) @ sums
    return out


class Sure(NamedTuple):
    """Measures with their intervals.

    Attributes:
        values: by name.
        clips, frames, subjects: how many they are of.
    """

    values: dict[str, Uncertain]
    clips: int
    frames: int
    subjects: int


def sure(units: Units) -> tuple[Sure, list[Sure]]:
    """The measures of all clips, and of each subject's."""
    whole, banks, pieces = resamples(units)
    total = _sure(units.sums, whole, pieces, units.subjects)
    order = np.argsort(units.subject, kind="stable")
    ends = np.searchsorted(units.subject[order], np.arange(units.subjects + 1))
    each = [
        _sure(units.sums[order[a:b]], bank, float(b - a), 1)
        for bank, a, b in zip(banks, ends[:-1], ends[1:], strict=True)
    ]
    return total, each


def _sure(sums: Array, resampled: Array, pieces: float, subjects: int) -> Sure:
    total = sums.sum(0)
    values, spread = measures(total), measures(resampled)
    found = {
        name: interval(float(values[name]), spread[name], pieces if len(resampled) > 1 else 1)
        for name in MEASURES
    }
    frames = int(total[SUMS.index("frames")])
    return Sure(found, len(sums), frames, subjects)


def differences(units: Units) -> dict[str, Uncertain]:
    """What a second run has more than a first, of clips that both have, by the same resamples.

    Args:
        units: sums of the first run and of the second, side by side.
    """
    k = len(SUMS)
    whole, _, pieces = resamples(units)
    total = units.sums.sum(0)
    first, second = measures(total[:k]), measures(total[k:])
    a, b = measures(whole[:, :k]), measures(whole[:, k:])
    found = {}
    for name in MEASURES:
        value = float(second[name] - first[name])
        if abs(value) < _ROUNDING * abs(float(first[name])):
            found[name] = Uncertain(0.0, 0.0, 0.0)
        else:
            found[name] = interval(value, b[name] - a[name], pieces, False)
    return found
