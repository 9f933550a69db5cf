"""What the metrics share: checking of joint arrays, means over what is present, blocks."""

from __future__ import annotations

from collections.abc import Callable
from math import prod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import ROWS, blocks, by_blocks

Array = NDArray[np.float64]

_BLOCK = 100_000
"""Numbers handled at once: temporaries stay in the cache, and small on long mesh sequences."""


def points(x: ArrayLike, name: str = "points") -> Array:
    """x as float64 (..., J, 3); a point with one missing (NaN) coordinate is wholly NaN.

    Raises:
        InputError: the last axis is not 3, there is no point axis, or a value is infinite.
    """
    out = np.asarray(x, dtype=np.float64)
    if out.ndim < 2 or out.shape[-1] != 3:
        raise InputError(f"{name} have shape {out.shape}, expected (frames, joints, 3)")
    partly = False
    for part in blocks(len(out)):
        finite = np.isfinite(out[part])
        if finite.all():
            continue
        missing = np.isnan(out[part])
        if np.count_nonzero(missing) + np.count_nonzero(finite) < missing.size:
            raise InputError(f"{name} hold infinite values, expected numbers or NaN for missing")
        x, y, z = (missing[..., i] for i in range(3))  # NumPy reduces an axis of three slowly
        partly = partly or bool(((x | y | z) & ~(x & y & z)).any())
    return by_blocks(_whole, out) if partly else out


def _whole(x: Array) -> Array:
    return np.where(np.isnan(x).any(-1, keepdims=True), np.nan, x)


def pair(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Estimate and reference as `points` of one shape.

    Raises:
        InputError: as `points`, or the shapes differ.
    """
    a, b = points(a, "the estimate's points"), points(b, "the reference's points")
    if a.shape != b.shape:
        raise InputError(f"the estimate has shape {a.shape}, the reference {b.shape}")
    return a, b


def sequence_of_points(x: ArrayLike, name: str = "points") -> Array:
    """`points` with exactly one frame axis, (T, J, 3)."""
    out = points(x, name)
    if out.ndim != 3:
        raise InputError(f"{name} have shape {out.shape}, expected (frames, joints, 3)")
    return out


def nan_mean(values: ArrayLike, axis: int | tuple[int, ...] | None = -1) -> Array:
    """Mean over what is not NaN; NaN, without a warning, where nothing is left."""
    values = np.asarray(values, dtype=np.float64)
    present = ~np.isnan(values)
    if values.size and present.all():
        return np.asarray(values.mean(axis))
    count = present.sum(axis)
    total = np.where(present, values, 0.0).sum(axis)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def mean_of_frames(values: Array) -> Array:
    """`nan_mean` over the first axis, of arrays of any length."""
    if len(values) <= ROWS:
        return nan_mean(values, 0)
    total, count = np.zeros(values.shape[1:]), np.zeros(values.shape[1:], np.int64)
    for part in blocks(len(values)):
        total += np.nansum(values[part], axis=0)
        count += (~np.isnan(values[part])).sum(0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def in_blocks(function: Callable[..., Array], *arrays: Array) -> Array:
    """function(*arrays) computed over blocks of the first axis, one value per leading index."""
    first = arrays[0]
    if first.ndim == 2:
        return function(*arrays)
    rows = max(1, _BLOCK // max(1, prod(first.shape[1:])))
    return by_blocks(function, *arrays, rows=rows)


def lengths(vectors: Array) -> Array:
    """Euclidean length (...) of vectors (..., 3)."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def or_none(value: float) -> float | None:
    """The number, or None, which JSON has, for one that is not known (NaN) or infinite."""
    return value if np.isfinite(value) else None
