"""What an unknown detector does to joints: errors that last, jump, and are lost for a while.

All are of true joints (T, 21, 3) [m] at a frame rate, by a random generator: `KINDS` by name.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation.arrays import nan_mean
from handtrack.hand.skeleton import BASES, N_JOINTS, PARENTS

Array = NDArray[np.float64]
Laid = Callable[[Array, float, np.random.Generator], Array]

_ALONG = 0.6
"""Of a joint's noise that is its parent's in the finger."""


def along_fingers(noise: Array) -> Array:
    """The same deviations (T, 21, ...), neighbours in a finger related."""
    noise = noise.copy()
    for joint in range(1, N_JOINTS):
        if joint not in BASES:
            own = np.sqrt(1 - _ALONG**2) * noise[:, joint]
            noise[:, joint] = _ALONG * noise[:, joint - 1] + own
    return noise


def fading(shape: tuple[int, ...], kept: float, rng: np.random.Generator) -> Array:
    """Noise of deviation 1 of which each frame keeps so much."""
    noise = rng.normal(size=shape)
    for t in range(1, len(noise)):
        noise[t] = kept * noise[t - 1] + np.sqrt(1 - kept**2) * noise[t]
    return noise


def lasting(
    truth: Array,
    fps: float,
    rng: np.random.Generator,
    *,
    lasts_s: float,
    deviation_mm: float,
    white_mm: float = 1.0,
) -> Array:
    """Noise that fades over a time, shared along fingers, and white noise on top."""
    noise = along_fingers(fading(truth.shape, float(np.exp(-1 / (fps * lasts_s))), rng))
    return np.asarray(
        truth + 1e-3 * (deviation_mm * noise + white_mm * rng.normal(size=noise.shape))
    )


def bone_frames(truth: Array) -> Array:
    """(T, 21, 3, 3) a frame at each joint, in columns: along its bone, across it in the palm's
    plane, and the rest; of what is missing, the world's."""
    bone = truth - truth[:, PARENTS.clip(0)]
    bone[:, 0] = truth[:, 9] - truth[:, 5]
    across = np.broadcast_to((truth[:, 5] - truth[:, 17])[:, None], bone.shape)
    z = np.cross(bone, across)
    y = np.cross(z, bone)
    made = np.stack([bone, y, z], axis=-1)
    length = np.linalg.norm(made, axis=-2, keepdims=True)
    good = np.isfinite(length).all((2, 3), keepdims=True) & (length > 1e-9).all(3, keepdims=True)
    return np.where(good, made / np.where(good, length, 1.0), np.eye(3))


def _aside(bias_mm: float, rng: np.random.Generator) -> Array:
    """(21, 3) where landmarks of a detector lie [m], so far in the mean."""
    way = rng.normal(size=(N_JOINTS, 3))
    return np.asarray(1e-3 * bias_mm * rng.uniform(0.5, 1.5, (N_JOINTS, 1)) * _unit(way))


def _unit(way: Array) -> Array:
    return np.asarray(way / np.linalg.norm(way, axis=-1, keepdims=True))


def biased(truth: Array, fps: float, rng: np.random.Generator, *, bias_mm: float) -> Array:
    """Landmarks that lie aside in their bones' frames, and noise as 3 mm over .1 s."""
    aside = np.einsum("tjxc,jc->tjx", bone_frames(truth), _aside(bias_mm, rng))
    return np.asarray(lasting(truth, fps, rng, lasts_s=0.1, deviation_mm=3) + aside)


def flickering(truth: Array, fps: float, rng: np.random.Generator) -> Array:
    """As biased by 5 mm, of two biases of which each finger has one for half a second or so."""
    two = np.stack([_aside(5, rng), _aside(5, rng)])
    jumps = rng.random((len(truth), N_JOINTS)) < 2 / fps
    jumps[:, 1:] = np.repeat(jumps[:, BASES], 4, axis=1)
    state = jumps.cumsum(0) % 2
    now = np.where(state[..., None] == 0, two[0], two[1])
    aside = np.einsum("tjxc,tjc->tjx", bone_frames(truth), now)
    return np.asarray(lasting(truth, fps, rng, lasts_s=0.1, deviation_mm=2) + aside)


def dropping(truth: Array, fps: float, rng: np.random.Generator) -> Array:
    """The hand is lost now and then for a tenth to a half of a second, and found with other
    biases of 5 mm."""
    out = lasting(truth, fps, rng, lasts_s=0.1, deviation_mm=3)
    frames = bone_frames(truth)
    begin = 0
    while begin < len(truth):
        end = begin + int(fps * rng.uniform(1.0, 3.0))
        aside = np.einsum("tjxc,jc->tjx", frames[begin:end], _aside(5, rng))
        out[begin:end] += aside
        begin = end + int(fps * rng.uniform(0.1, 0.5))
        out[end:begin] = np.nan
    return out


def in_depth(truth: Array, fps: float, rng: np.random.Generator) -> Array:
    """Noise along one direction, 8 mm over .2 s and 3 mm white; a millimetre across."""
    depth = _unit(rng.normal(size=3))
    noise = along_fingers(fading(truth.shape[:2], float(np.exp(-1 / (fps * 0.2))), rng))
    along = 8 * noise + 3 * rng.normal(size=noise.shape)
    return np.asarray(truth + 1e-3 * (along[..., None] * depth + rng.normal(size=truth.shape)))


def straying(truth: Array, fps: float, rng: np.random.Generator) -> Array:
    """Single joints 2-5 cm off for 1 to 10 frames, in 2 % of frames each; 3 mm over .1 s."""
    out = lasting(truth, fps, rng, lasts_s=0.1, deviation_mm=3)
    for t, joint in zip(*np.nonzero(rng.random(truth.shape[:2]) < 0.02 / 5.5), strict=True):
        way = _unit(rng.normal(size=3))
        out[t : t + rng.integers(1, 11), joint] += rng.uniform(0.02, 0.05) * way
    return out


def mirrored(truth: Array, fps: float, rng: np.random.Generator) -> Array:
    """Taken for the other hand for 2 to 8 frames now and then: mirrored in depth about its middle;
    3 mm over .1 s."""
    out = lasting(truth, fps, rng, lasts_s=0.1, deviation_mm=3)
    depth = _unit(rng.normal(size=3))
    t = int(fps * rng.uniform(0.5, 2.0))
    while t < len(truth):
        part = slice(t, t + int(rng.integers(2, 9)))
        middle = nan_mean(out[part], 1)[:, None]
        out[part] -= 2 * ((out[part] - middle) @ depth)[..., None] * depth
        t = part.stop + int(fps * rng.uniform(0.5, 2.0))
    return out


KINDS: dict[str, Laid] = {
    **{
        f"lasts {s:g} s, {mm} mm": partial(lasting, lasts_s=s, deviation_mm=mm)
        for s in (0.1, 0.3, 1.0)
        for mm in (3, 8)
    },
    "landmarks 5 mm aside": partial(biased, bias_mm=5),
    "landmarks 15 mm aside": partial(biased, bias_mm=15),
    "two biases in turn": flickering,
    "lost, found with another bias": dropping,
    "noise in depth": in_depth,
    "single joints 2-5 cm off": straying,
    "taken for the other hand": mirrored,
}
