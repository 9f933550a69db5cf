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
    n, half = len(joints), window // 2
    seen = np.isfinite(joints[..., 0])
    values = np.where(seen[..., None], joints, 0.0)
    tick = float(np.median(np.diff(time_ns)))
    normal = np.zeros((*seen.shape, 3, 3))
    right = np.zeros((*seen.shape, 3, 3))
    count = np.zeros(seen.shape)
    for shift in range(-half, half + 1):
        here = np.arange(max(0, -shift), min(n, n - shift))
        there = here + shift
        x = (time_ns[there] - time_ns[here]) / tick
        # a pause is no neighbourhood
        w = seen[there] * (np.abs(x) <= half + 0.5)[:, None]
        powers = x[:, None] ** np.arange(3)
        normal[here] += w[..., None, None] * (powers[:, :, None] * powers[:, None])[:, None]
        right[here] += w[..., None, None] * powers[:, None, :, None] * values[there][:, :, None, :]
        count[here] += w
    enough = seen & (count >= half + 2)
    normal[~enough] = np.eye(3)
    inverse = np.linalg.inv(normal)
    out = np.where(enough[..., None], (inverse[..., :1, :] @ right)[..., 0, :], joints)
    return out, np.where(enough, inverse[..., 0, 0], np.where(seen, 1.0 - 1e-9, np.nan))
