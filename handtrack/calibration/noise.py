"""How noisy joints are, and joints freed of white noise where there is much of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.hand.skeleton import BONES

Array = NDArray[np.float64]

# windows of the smoother, frames
_WINDOWS = (5, 7, 9, 11, 13)
# a window is too wide when it takes away so much more than noise
_TOO_MUCH = 1.15
# less noise than this is not worth smoothing [m]
_LITTLE = 3e-4
# a joint that is so many standard deviations off its neighbours is a stray
_STRAY = 6.0
_FEW = 0.2
"""Share of joints that may be strays."""
# of what bones show of the noise, an estimate may be so much off
_ALLOWED = 1.2
# frames looked at together, so that sums over windows stay in the cache
_ROWS = 1000
# median of a squared normal deviate
_MEDIAN = 0.4549


def noise_level(joints: ArrayLike) -> float:
    """Standard deviation of the joints' noise per coordinate, from third differences.

    Motion hardly shows in third differences, white noise of deviation s does with
    s * sqrt(20); the median makes it robust.

    Args:
        joints: (T, 21, 3), any unit; NaN = missing.

    Returns:
        The deviation in that unit; 0 where there are fewer than four complete frames.
    """
    d = np.abs(np.diff(np.asarray(joints, dtype=np.float64), n=3, axis=0))
    d = d[np.isfinite(d)]
    # 1.4826 makes the median absolute deviation a normal's standard deviation
    return float(1.4826 * np.median(d) / np.sqrt(20.0)) if d.size else 0.0


def white_noise(joints: Array) -> float:
    """Noise of a sequence as `noise_level` has it, but no more than its bones allow.

    Noise of deviation s makes a bone's length vary by s * sqrt(2). Where lengths vary less,
    differences between frames are motion: frames are far apart, or have nothing to do with
    each other.

    Args:
        joints: (T, 21, 3), any unit; NaN = missing.

    Returns:
        The deviation per coordinate in that unit.
    """
    parent, child = np.array(BONES).T
    lengths = np.linalg.norm(joints[:, child] - joints[:, parent], axis=-1)
    lengths = lengths[:, np.isfinite(lengths).sum(0) > 3]
    if not lengths.size:
        return 0.0
    off = np.abs(lengths - np.nanmedian(lengths, 0))
    by_bones = 1.4826 * float(np.median(np.nanmedian(off, 0))) / np.sqrt(2.0)
    return float(min(noise_level(joints), _ALLOWED * by_bones))


def smoothed(time_ns: NDArray[np.int64], joints: Array, noise: float) -> tuple[Array, float]:
    """Joints with less white noise: a parabola fitted to each joint over a few frames.

    The widest window is taken that removes no more than noise (that leaves the motion). A
    joint that is missing stays missing, and one far from its neighbours becomes missing.

    Args:
        time_ns: (T,) increasing.
        joints: (T, 21, 3) [m]; NaN = missing.
        noise: standard deviation of the joints per coordinate [m].

    Returns:
        The joints, and the standard deviation of the noise that is left in them [m].
    """
    if noise < _LITTLE or len(joints) < _WINDOWS[0]:
        return joints, noise
    first, _ = _parabolas(time_ns, joints, _WINDOWS[0])
    stray = np.linalg.norm(joints - first, axis=-1) > _STRAY * noise
    if stray.sum() > _FEW * np.isfinite(joints[..., 0]).sum():
        return joints, noise  # no motion that frames sample densely
    kept = np.where(stray[..., None], np.nan, joints)
    best, left = kept, noise
    for window in _WINDOWS:
        if window > len(joints):
            break
        once, share = _parabolas(time_ns, kept, window)
        removed = np.square(kept - once) / (1.0 - share)[..., None]
        removed = removed[np.isfinite(removed)]
        if not removed.size or np.median(removed) / _MEDIAN > _TOO_MUCH * noise**2:
            break
        best, left = once, noise * float(np.sqrt(np.nanmedian(share)))
    return best, left


def _parabolas(time_ns: NDArray[np.int64], joints: Array, window: int) -> tuple[Array, Array]:
    """Each joint on its own parabola through the frames around it, by least squares.

    Returns:
        (T, 21, 3), NaN where missing; the joint as it is where too few are around it; and
        (T, 21) the share of the noise's variance that is left.
    """
    half = window // 2
    tick = float(np.median(np.diff(time_ns)))
    out, share = np.empty(joints.shape), np.empty(joints.shape[:2])
    for begin in range(0, len(joints), _ROWS):
        part = slice(begin, min(begin + _ROWS, len(joints)))
        around = slice(max(begin - half, 0), part.stop + half)
        inner = slice(begin - around.start, part.stop - around.start)
        ticks = (time_ns[around] - time_ns[begin]) / tick
        out[part], share[part] = _some_parabolas(ticks, joints[around], half, inner)
    return out, share


def _some_parabolas(ticks: Array, joints: Array, half: int, inner: slice) -> tuple[Array, Array]:
    """As `_parabolas` of the frames `inner`, of which (n,) frames around them tell."""
    n = len(joints)
    seen = np.isfinite(joints[..., 0])
    values = np.where(seen[..., None], joints, 0.0)
    weights = seen.astype(np.float64)
    # sums over the window of x^k, k = 0..4, and of x^k value, k = 0..2
    x_sums = np.zeros((5, *weights.shape))
    value_sums = np.zeros((3, *values.shape))
    for shift in range(-half, half + 1):
        here = slice(max(inner.start, -shift), min(inner.stop, n - shift))
        there = slice(here.start + shift, here.stop + shift)
        x = ticks[there] - ticks[here]
        # a pause is no neighbourhood
        near = np.abs(x) <= half + 0.5
        for k in range(5):
            power = np.where(near, x**k, 0.0)[:, None]
            x_sums[k, here] += power * weights[there]
            if k < 3:
                value_sums[k, here] += power[..., None] * values[there]
    seen, joints = seen[inner], joints[inner]
    s, right = x_sums[:, inner], value_sums[:, inner]
    enough = seen & (s[0] >= half + 2)
    # the first row of the inverse of the normal equations' matrix, by its cofactors
    first = (s[2] * s[4] - s[3] ** 2, s[2] * s[3] - s[1] * s[4], s[1] * s[3] - s[2] ** 2)
    size = np.where(enough, s[0] * first[0] + s[1] * first[1] + s[2] * first[2], 1.0)
    middle = sum(f[..., None] * right[k] for k, f in enumerate(first)) / size[..., None]
    share = np.where(enough, first[0] / size, np.where(seen, 1.0 - 1e-9, np.nan))
    return np.where(enough[..., None], middle, joints), share
