"""Smoothing of raw joints, at its best: the parameters that suit the truth best are taken.

No user knows these parameters; what a fit with a filter gains over them is not a matter of tuning.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOWS = (3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 25, 29, 35, 41, 51, 61, 81)
"""Windows of the Savitzky-Golay filter that are tried [frames]."""
ORDERS = (0, 2, 4)
"""Degrees of its polynomial; odd ones give the same in the middle of a window."""
CUTOFFS = (0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0, 7.5, 11.0, 17.0, 25.0)
"""Least cut-off frequencies of the One-Euro filter [Hz]."""
BETAS = (0.0, 0.3, 1.0, 3.0, 6.0, 10.0, 20.0, 40.0, 80.0, 160.0)
"""Its gains by speed [Hz s / m]."""
DERIVATIVE_CUTOFF = 1.0
"""Cut-off of its derivative [Hz], as its authors fix it."""


class Best(NamedTuple):
    """joints (T, 21, 3) [m] that came nearest to the truth, and the parameters, to be read."""

    joints: Array
    parameters: str


def best_savgol(noisy: Array, clean: Array) -> Best:
    """The Savitzky-Golay filter with the window and degree that suit the truth best."""
    return _nearest(savgols(noisy), noisy, clean)


def savgols(noisy: Array, windows: Items[int] = WINDOWS) -> list[Best]:
    """The joints smoothed with every window and degree that there are frames for."""
    return [
        Best(savgol(noisy, window, order), f"window {window}, degree {order}")
        for order in ORDERS
        for window in windows
        if order < window <= len(noisy)
    ]


def nearer(of_raw: Items[float]) -> str:
    """A cell of a table: the mean of clips' errors over those of raw joints, and the share of
    clips that are nearer to the truth."""
    values = np.array(of_raw)
    return f"{values.mean():.3f} ({100 * (values < 1).mean():.0f} %)"


def best_one_euro(noisy: Array, clean: Array, time_ns: NDArray[np.int64]) -> Best:
    """The One-Euro filter with the cut-off and gain that suit the truth best."""
    cutoffs, betas = (grid.ravel() for grid in np.meshgrid(CUTOFFS, BETAS))
    smoothed = one_euro(noisy, time_ns, cutoffs, betas)
    tried = [
        Best(joints, f"{cutoff:g} Hz, beta {beta:g}")
        for joints, cutoff, beta in zip(smoothed, cutoffs, betas, strict=True)
    ]
    return _nearest(tried, noisy, clean)


def _nearest(tried: list[Best], noisy: Array, clean: Array) -> Best:
    """The best by its mean error where there was an input, so that filling gaps costs nothing."""
    seen = ~np.isnan(noisy[..., 0]) & ~np.isnan(clean[..., 0])

    def error(best: Best) -> float:
        off = np.linalg.norm(best.joints - clean, axis=-1)[seen]
        return float(off.mean()) if np.isfinite(off).all() else np.inf

    return min(tried, key=error)


def savgol(x: Array, window: int, order: int) -> Array:
    """Savitzky-Golay smoothing that passes over missing samples.

    At each frame a polynomial is fitted to the samples present in the window, by least squares;
    its value there is the result. Windows are cut at the ends of the sequence. Equal to
    `scipy.signal.savgol_filter` where the window is complete.

    Args:
        x: (T, ...), NaN = missing.
        window: odd number of frames.
        order: degree of the polynomial. With fewer samples than it needs (in the whole window
            or on the frame itself and one side of it) the result is missing.

    Returns:
        A new (T, ...).
    """
    frames, half = len(x), window // 2
    y = x.reshape(frames, -1)
    present = ~np.isnan(y)
    padded = np.zeros((frames + 2 * half, y.shape[1]))
    weight = np.zeros_like(padded)
    padded[half : half + frames] = np.where(present, y, 0.0)
    weight[half : half + frames] = present
    # moments of the samples' places (scaled to -1..1) and of their values
    steps = np.arange(-half, half + 1) / max(half, 1)
    n = order + 1
    moments = np.zeros((2 * order + 1, *y.shape))
    values = np.zeros((n, *y.shape))
    before, after = np.zeros(y.shape), np.zeros(y.shape)
    for i, u in enumerate(steps):
        w, z = weight[i : i + frames], padded[i : i + frames]
        if u <= 0:
            before += w
        if u >= 0:
            after += w
        power = np.ones_like(z)
        for k in range(2 * order + 1):
            moments[k] += power * w
            if k < n:
                values[k] += power * z
            power = power * u
    # extrapolation over more than a gap's edge is no smoothing
    usable = (before + after - present >= n) & (before > 0) & (after > 0)
    normal = np.moveaxis(moments[np.add.outer(np.arange(n), np.arange(n))], (0, 1), (-2, -1))
    normal = np.where(usable[..., None, None], normal, np.eye(n))
    right = np.moveaxis(values, 0, -1)[..., None]
    # a window with just enough samples may still be close to singular
    smooth = np.linalg.solve(normal + 1e-12 * np.eye(n), right)[..., 0, 0]
    return np.where(usable, smooth, np.nan).reshape(x.shape)


def one_euro(x: Array, time_ns: NDArray[np.int64], cutoff: Array, beta: Array) -> Array:
    """One-Euro filters (Casiez et al. 2012), several parameters at once, each coordinate alone.

    A missing sample stays missing; the filter goes on from the last one that was seen.

    Args:
        x: (T, J, 3) [m], NaN = missing.
        time_ns: (T,) increasing [ns].
        cutoff, beta: (N,) least cut-off frequencies [Hz] and gains by speed [Hz s / m].

    Returns:
        (N, T, J, 3).
    """
    out = np.full((len(cutoff), *x.shape), np.nan)
    cutoff, beta = cutoff[:, None, None], beta[:, None, None]
    value = np.full(out[:, 0].shape, np.nan)
    speed = np.zeros_like(value)
    last = np.full(x.shape[1:], np.nan)
    seen_at = np.zeros(x.shape[1:], dtype=np.int64)
    for t in range(len(x)):
        seen = ~np.isnan(x[t])
        first = seen & np.isnan(last)
        dt = np.where(seen & ~first, (time_ns[t] - seen_at) * 1e-9, 1.0)
        raw_speed = np.where(seen & ~first, (x[t] - last) / dt, 0.0)
        smoothing = _share(np.full_like(dt, DERIVATIVE_CUTOFF), dt)
        new_speed = speed + smoothing * (raw_speed - speed)
        a = _share(cutoff + beta * np.abs(new_speed), dt)
        new = np.where(first, x[t], value + a * (x[t] - value))
        value = np.where(seen, new, value)
        speed = np.where(seen & ~first, new_speed, speed)
        last = np.where(seen, x[t], last)
        seen_at = np.where(seen, time_ns[t], seen_at)
        out[:, t] = np.where(seen, value, np.nan)
    return out


def _share(cutoff: Array, dt: Array) -> Array:
    """What a new sample makes up in exponential smoothing: 1 / (1 + tau / dt)."""
    return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * dt))
