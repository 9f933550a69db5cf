"""The noise of a detector that errors of its landmarks show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.profile import Noise
from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS

Array = NDArray[np.float64]

# errors beyond so many deviations are no noise; the deviation is first taken without them
_OUTLIER = 4.0


# a similarity takes 7 of 63 coordinates along
_ALIGNED_SHARE = 56.0 / 63.0


# lags at which correlations are compared [frames]
_LAGS = (1, 2, 3, 5, 8)


# no detector is so near [m]
_EXACT = 1e-7


_FADES_S = np.geomspace(0.02, 3.0, 60)


# a median of squares of a normal coordinate over their mean
_MEDIAN = 0.4549


@dataclass(frozen=True, eq=False)
class Errors:
    """What the landmarks of one clip are off.

    Attributes:
        off: (T, 21, 3) [m]; frames: (T, 21, 3, 3) of the bones; time_ns: (T,).
        view: (T, 3) viewing directions in the axes of `off`, or None.
        log_scale: (T,) logarithm of the detected hand's size over the true one's.
        aligned: each frame was aligned, and so has lost some of its error.
    """

    off: Array
    frames: Array
    time_ns: NDArray[np.int64]
    view: Array | None
    log_scale: Array
    aligned: bool


def noise_of(clips: list[Errors], one_camera: bool) -> Noise:
    """The noise that errors of clips show (`Noise`).

    Raises:
        InputError: there is none.
    """
    everything = np.concatenate([c.off for c in clips])
    if not np.abs(everything).max() > _EXACT:
        raise InputError("detections do not err: is the truth (--truth) the detections themselves?")
    d2 = np.square(everything).sum(-1)
    robust = np.sqrt(np.median(d2, 0) / 3 / 0.7886)  # median of chi^2 with 3 degrees over 3
    stray = np.sqrt(d2 / 3) > _OUTLIER * robust
    share = _ALIGNED_SHARE if clips[0].aligned else 1.0
    constant, fading, white, fades = _in_time(clips, robust)
    inb = np.concatenate([np.einsum("tjik,tji->tjk", c.frames, c.off) for c in clips])
    by_bone = np.sqrt(np.where(stray[..., None], np.nan, np.square(inb))[...].T).T
    rms = np.sqrt(np.nanmean(np.square(by_bone), 0))
    bone = rms / np.sqrt(np.square(rms).mean(-1, keepdims=True))
    scales = np.concatenate([c.log_scale - c.log_scale.mean() for c in clips])
    return Noise(
        constant / np.sqrt(share),
        fading / np.sqrt(share),
        white / np.sqrt(share),
        fades,
        bone,
        _by_view(clips),
        _in_fingers(clips),
        float(stray.mean()),
        float(scales.std()) if one_camera else 0.0,
        _scale_fades(clips) if one_camera else 0.5,
        float(np.sqrt(np.mean([c.log_scale.mean() ** 2 for c in clips]))) if one_camera else 0.0,
    )


def _in_time(clips: list[Errors], robust: Array) -> tuple[Array, Array, Array, float]:
    """Deviations per coordinate of the constant, the fading and the white error, and its time.

    Of the covariances c_k of errors k frames apart, in the frames of their bones, the constant
    part is what means of clips show, the rest is fading^2 exp(-k dt / fades) for k > 0.
    """
    bound = _OUTLIER * robust[:, None]
    bones = [np.clip(np.einsum("tjik,tji->tjk", c.frames, c.off), -bound, bound) for c in clips]
    total = np.square(np.concatenate(bones)).mean((0, 2))
    constant = np.mean([np.square(b.mean(0)).mean(-1) for b in bones], 0)
    dt = float(np.median(np.concatenate([np.diff(c.time_ns) for c in clips]))) * 1e-9
    lags = [k for k in _LAGS if k < min(len(b) for b in bones) // 2]
    rest = total - constant
    if not lags or not (rest > 0).any():
        return np.sqrt(constant), np.zeros(N_JOINTS), np.sqrt(np.maximum(rest, 0)), 0.0
    found = []
    for k in lags:
        both = [(b[k:] - b.mean(0)) * (b[:-k] - b.mean(0)) for b in bones]
        found.append(np.concatenate(both).mean((0, 2)))
    shares = np.array(found).sum(1) / rest.sum()
    # one time for all joints; the best in least squares with its amplitude
    decays = np.exp(-np.array(lags)[:, None] * dt / _FADES_S)
    amplitude = (decays * shares[:, None]).sum(0) / np.square(decays).sum(0)
    misfit = np.square(shares[:, None] - amplitude * decays).sum(0)
    best = int(misfit.argmin())
    decay = decays[:, best]
    fading = (decay[:, None] * np.array(found)).sum(0) / np.square(decay).sum()
    fading = np.clip(fading, 0.0, rest)
    return np.sqrt(constant), np.sqrt(fading), np.sqrt(rest - fading), float(_FADES_S[best])


def _by_view(clips: list[Errors]) -> float:
    """Deviation along the viewing direction over that across it."""
    along, across = [], []
    for c in clips:
        if c.view is None:
            continue
        toward = np.einsum("tjk,tk->tj", c.off, c.view)
        along.append(np.square(toward).ravel())
        across.append(((np.square(c.off).sum(-1) - np.square(toward)) / 2).ravel())
    if not along:
        return 1.0
    return float(np.sqrt(np.median(np.concatenate(along)) / _MEDIAN) / _median_of_two(across))


def _median_of_two(across: list[Array]) -> float:
    """Deviation of a coordinate from halves of the squares of two."""
    return float(np.sqrt(np.median(np.concatenate(across)) / 0.6931))


def _in_fingers(clips: list[Errors]) -> float:
    """Correlation of the errors of neighbouring joints of a finger."""
    off = np.concatenate([c.off for c in clips])[:, 1:].reshape(-1, 5, 4, 3)
    off = off - off.mean(0)
    products = (off[:, :, 1:] * off[:, :, :-1]).sum()
    squares = np.sqrt(np.square(off[:, :, 1:]).sum() * np.square(off[:, :, :-1]).sum())
    return float(products / squares)


def _scale_fades(clips: list[Errors]) -> float:
    """Time after which a clip's deviation of size is correlated by 1/e [s]."""
    pairs = [(c.log_scale - c.log_scale.mean(), c.time_ns) for c in clips if len(c.log_scale) > 3]
    if not pairs:
        return 0.5
    here = sum(float((x[1:] * x[:-1]).sum()) for x, _ in pairs)
    all_of = sum(float(np.square(x).sum()) for x, _ in pairs)
    dt = float(np.median(np.concatenate([np.diff(t) for _, t in pairs]))) * 1e-9
    correlation = min(max(here / max(all_of, 1e-12), 0.01), 0.999)
    return float(-dt / np.log(correlation))
