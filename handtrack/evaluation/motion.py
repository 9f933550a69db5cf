"""How a sequence moves: acceleration, jitter, acceleration error and lag."""

from __future__ import annotations

from math import factorial, prod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.evaluation.arrays import Array, lengths, nan_mean, pair, sequence_of_points
from handtrack.files.long_arrays import Growing, by_blocks, release

GAP = 1.5
"""A time step above this many medians (or below 1/2 of one) breaks every difference over it."""

_BLOCK = 2000
"""Frames handled at once, so that temporaries stay in the cache."""


def acceleration(x: ArrayLike, fps: float | None = None, time_ns: ArrayLike | None = None) -> Array:
    """Mean size of the second time derivative of the points, per frame.

    On even steps this is mean_j |x_{t+1} - 2 x_t + x_{t-1}| fps^2. Uneven stamps go through
    divided differences, which are exact for motion of constant acceleration.

    Args:
        x: (T, J, 3), NaN = missing.
        fps: frames per second of an even sequence; or
        time_ns: (T,) increasing stamps [ns]. A step above 1.5 or below 0.5 medians counts
            as missing frames.

    Returns:
        (T,) in the unit of x per s^2; the value at t is made of frames t-1..t+1, NaN where
        one of them is missing for every joint. A missing joint drops out by itself.

    Raises:
        InputError: shapes do not fit, or time does not increase.
        SettingsError: not exactly one of fps and time_ns is given, or fps is not positive.
    """
    return _mean_derivative(x, 2, fps, time_ns)


def jitter(x: ArrayLike, fps: float | None = None, time_ns: ArrayLike | None = None) -> Array:
    """Mean size of the third time derivative of the points (jerk), per frame.

    TransPose (Yi et al. 2021) reports its mean: mean_j |third difference| fps^3.

    Args and errors: as `acceleration`.

    Returns:
        (T,) in the unit of x per s^3; the value at t is made of frames t-1..t+2.
    """
    return _mean_derivative(x, 3, fps, time_ns)


def jitter_within(x: Array, time_ns: ArrayLike, broken: NDArray[np.bool_]) -> Array:
    """`jitter` of points (T, J, 3) where it is known which steps (T-1,) are gaps."""
    return _in_blocks(sequence_of_points(x), 3, _steps(time_ns, len(x)), broken)


def acceleration_error(a: ArrayLike, b: ArrayLike, time_ns: ArrayLike | None = None) -> Array:
    """Mean size of the difference of second differences of estimate and reference, per frame.

    VIBE's and SmoothNet's definition: mean_j |D2 a - D2 b| with D2 x = x_{t+1} - 2 x_t +
    x_{t-1}, *not* divided by the squared time step. Multiply by fps^2 for a true acceleration.

    Args:
        a, b: estimate and reference (T, J, 3), same unit; NaN = missing.
        time_ns: (T,) stamps [ns], only to find gaps.

    Returns:
        (T,) in the unit of a per squared frame; NaN at the ends and beside missing frames.
    """
    a, b = pair(a, b)
    difference = sequence_of_points(by_blocks(np.subtract, a, b))
    broken = None if time_ns is None else _gaps(_steps(time_ns, len(a)))
    return _in_blocks(difference, 2, np.ones(max(0, len(a) - 1)), broken)


def lag(a: ArrayLike, b: ArrayLike, max_lag: int = 15, time_ns: ArrayLike | None = None) -> float:
    """How many frames the estimate comes after the reference, to a fraction of a frame.

    The shift at which the correlation of the two (pooled over all coordinates, each about
    its mean over the overlap) is greatest, refined by a parabola through the greatest value
    and its neighbours. Positive: the estimate is late.

    Args:
        a, b: estimate and reference, (T, ...) of one shape: joints, angles or anything else.
        max_lag: greatest shift that is tried [frames].
        time_ns: (T,) stamps [ns]; frames are put on the even grid that they suggest, so
            that a gap in time stays one.

    Returns:
        frames; NaN if nothing moves or the greatest correlation lies at the end of the range.

    Raises:
        InputError: shapes differ, or time does not increase.
    """
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    if a.shape != b.shape or a.ndim < 1:
        raise InputError(f"the estimate has shape {a.shape}, the reference {b.shape}")
    columns = prod(a.shape[1:])
    x, y = a.reshape(len(a), columns), b.reshape(len(b), columns)
    if time_ns is not None and len(x) > 2:
        steps = _steps(time_ns, len(x))
        # a clock that jumps by hours must not make a grid of hours
        slots = np.clip(np.rint(steps / np.median(steps)), 1, 2 * max_lag + 1)
        index = np.concatenate([[0], np.cumsum(slots)]).astype(np.int64)
        if index[-1] >= len(x):
            x, y = _on_grid(x, index), _on_grid(y, index)
    reach = min(max_lag, len(x) - 3)
    if reach < 1:
        return float("nan")
    shifts = np.arange(-reach, reach + 1)
    scores = np.array([_correlation(x, y, int(k)) for k in shifts])
    if np.isnan(scores).any():
        return float("nan")
    best = int(np.argmax(scores))
    if best in (0, len(scores) - 1):
        return float("nan")
    left, top, right = scores[best - 1 : best + 2]
    bend = left - 2 * top + right
    fraction = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(shifts[best] + fraction)


def _on_grid(x: Array, index: NDArray[np.int64]) -> Array:
    out = np.full((index[-1] + 1, x.shape[1]), np.nan)
    out[index] = x
    return out


def _correlation(x: Array, y: Array, shift: int) -> float:
    """Correlation of x[t + shift] with y[t] over all columns, each about its own mean."""
    n = len(x) - abs(shift)
    p = x[max(shift, 0) :][:n]
    q = y[max(-shift, 0) :][:n]
    missing = np.isnan(p) | np.isnan(q)
    count = np.maximum(n - missing.sum(0), 1)
    p, q = np.where(missing, 0.0, p), np.where(missing, 0.0, q)
    p = np.where(missing, 0.0, p - p.sum(0) / count)
    q = np.where(missing, 0.0, q - q.sum(0) / count)

    def product(u: Array, v: Array) -> float:
        return float(np.einsum("ij,ij->", u, v))  # BLAS would wait for its threads

    size = np.sqrt(product(p, p) * product(q, q))
    return product(p, q) / size if size > 0 else float("nan")


def _mean_derivative(
    x: ArrayLike, order: int, fps: float | None, time_ns: ArrayLike | None
) -> Array:
    x = sequence_of_points(x)
    if (fps is None) == (time_ns is None):
        raise SettingsError("give either fps or time_ns")
    broken = None
    if time_ns is not None:
        steps = _steps(time_ns, len(x))
        broken = _gaps(steps)
    else:
        if fps is None or not (np.isfinite(fps) and fps > 0):
            raise SettingsError(f"fps is {fps}, expected a positive number")
        steps = np.full(max(0, len(x) - 1), 1.0 / fps)
    return _in_blocks(x, order, steps, broken)


def _in_blocks(x: Array, order: int, steps: Array, broken: NDArray[np.bool_] | None) -> Array:
    """(T,) mean over joints of the size of a derivative."""
    out = Growing(())
    out.append(np.full(min(len(x), 1), np.nan))
    for i in range(0, len(x) - order, _BLOCK):
        part = x[i : i + _BLOCK + order]
        inner = slice(i, i + len(part) - 1)
        gaps = None if broken is None else broken[inner]
        values = nan_mean(lengths(_derivative(part, order, steps[inner], gaps)))
        n = len(part) - order
        out.append(values[1 : 1 + n])
        release()
    out.append(np.full(len(x) - len(out), np.nan))
    return out.whole()


def _steps(time_ns: ArrayLike, n: int) -> Array:
    """(n-1,) time steps [s]."""
    time = np.asarray(time_ns, dtype=np.int64)
    if time.shape != (n,):
        raise InputError(f"{time.shape} time stamps for {n} frames")
    steps = np.diff(time)
    if (steps <= 0).any():
        raise InputError(f"time does not increase after frame {int(np.argmax(steps <= 0))}")
    return np.asarray(steps * 1e-9)


def gaps_between(time_ns: ArrayLike, n: int) -> NDArray[np.bool_]:
    """(n-1,) which steps between stamps are gaps (see `GAP`).

    Raises:
        InputError: not n stamps, or time does not increase.
    """
    return _gaps(_steps(time_ns, n))


def _gaps(steps: Array) -> NDArray[np.bool_]:
    if not steps.size:
        return np.zeros(0, dtype=bool)
    median = np.median(steps)
    return np.asarray((steps > GAP * median) | (steps < 0.5 * median))


def _derivative(x: Array, order: int, steps: Array, broken: NDArray[np.bool_] | None) -> Array:
    """Derivative (T, J, 3) by divided differences, centred: frames t-1..t+order-1 make t's.

    f^(n) = n! f[t_0, ..., t_n], f[t_0..t_k] = (f[t_1..t_k] - f[t_0..t_k-1]) / (t_k - t_0).
    """
    out = np.full(x.shape, np.nan)
    n = len(x) - order
    if n <= 0:
        return out
    level = x
    span = np.zeros(len(x))
    for k in range(1, order + 1):
        span = span[:-1] + steps[k - 1 :]  # t_{i+k} - t_i
        level = (level[1:] - level[:-1]) / span[:, None, None]
    level = level * factorial(order)
    if broken is not None:
        windows = np.lib.stride_tricks.sliding_window_view(broken, order)
        level[windows.any(1)] = np.nan
    out[1 : 1 + n] = level
    return out
