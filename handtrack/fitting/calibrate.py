"""A subject's own hand, from a sequence: bone lengths and the palm's shape.

First version: robust medians of the bone lengths, and the palm (wrist and the five finger
bases) by generalised Procrustes analysis. Joint axes stay the model's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import BASES, BONES, JOINT_NAMES, PALM
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

# a median of fewer frames is no calibration
_MIN_FRAMES = 3


@dataclass(frozen=True, eq=False)
class Calibration:
    """What a sequence says of a hand.

    Attributes:
        model: the hand with the subject's proportions.
        scale: size of the subject's hand over the prior's.
        noise: noise of the joints seen in the sequence [m per coordinate]; 0 if too short.
        frames: frames that were used.
        kept: names of the joints whose bone, or place in the palm, was never seen, so that
            the scaled prior's was kept.
    """

    model: HandModel
    scale: float
    noise: float
    frames: int
    kept: tuple[str, ...]


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


def scale_to(model: HandModel, sequence: Sequence) -> Calibration:
    """The model scaled to a sequence's hand, its proportions kept.

    Raises:
        InputError: no bone was seen in at least three frames.
    """
    noise = noise_level(sequence.joints)
    lengths = _bone_lengths(sequence.joints, noise)
    return _scaled(model, sequence, lengths, noise)


def _scaled(model: HandModel, sequence: Sequence, lengths: Array, noise: float) -> Calibration:
    seen = np.isfinite(lengths)
    if not seen.any():
        raise InputError(
            f"no bone is seen in {_MIN_FRAMES} frames or more, so the hand's size is unknown",
            sequence.source or None,
        )
    scale = float(np.median(lengths[seen] / model.bone_lengths[seen]))
    kept = tuple(JOINT_NAMES[1 + b] for b in np.flatnonzero(~seen))
    return Calibration(model.scaled(scale), scale, noise, len(sequence), kept)


def calibrate(model: HandModel, sequence: Sequence) -> Calibration:
    """Bone lengths and palm of the hand in a sequence.

    Args:
        model: the prior; what the sequence does not show stays as it is there, scaled.
        sequence: frames of one hand; joints may be missing.

    Returns:
        The calibrated hand, in the prior's root frame, with the prior's axes and limits.

    Raises:
        InputError: no bone was seen in at least three frames.
    """
    noise = noise_level(sequence.joints)
    lengths = _bone_lengths(sequence.joints, noise)
    prior = _scaled(model, sequence, lengths, noise)
    rest = prior.model.rest_joints
    palm, seen = _palm_shape(sequence.joints, rest)
    new = rest.copy()
    new[PALM] = palm
    # each finger keeps its direction and takes the measured lengths
    for base in BASES:
        for k in range(base + 1, base + 4):
            bone = rest[k] - rest[k - 1]
            length = lengths[k - 1]
            if np.isfinite(length):
                bone = bone * (length / np.linalg.norm(bone))
            new[k] = new[k - 1] + bone
    unseen = set(prior.kept) - {JOINT_NAMES[b] for b in BASES}
    unseen |= {JOINT_NAMES[j] for j, ok in zip(PALM, seen, strict=True) if not ok}
    kept = tuple(name for name in JOINT_NAMES if name in unseen)
    return Calibration(reshaped(model, new), prior.scale, noise, len(sequence), kept)


def _bone_lengths(joints: Array, noise: float) -> Array:
    """(20,) median length of each bone, cleared of what noise adds; NaN if hardly seen."""
    parent, child = np.array(BONES).T
    d2 = np.square(joints[:, child] - joints[:, parent]).sum(-1)
    out = np.full(len(BONES), np.nan)
    for b in range(len(BONES)):
        x = d2[:, b][np.isfinite(d2[:, b])]
        if len(x) >= _MIN_FRAMES:
            m = float(np.median(x))
            # noise across the bone lengthens it: 2 coordinates x 2 ends x noise^2
            out[b] = np.sqrt(max(m - 4 * noise**2, 0.25 * m))
    return out


def _palm_shape(joints: Array, rest: Array, rounds: int = 20) -> tuple[Array, Array]:
    """Mean palm in the prior's frame by generalised Procrustes, robust to stray frames.

    Args:
        joints: (T, 21, 3).
        rest: (21, 3) rest joints of the scaled prior.

    Returns:
        (6, 3) palm joints with the wrist where the prior has it, and (6,) which were seen.
    """
    points = joints[:, PALM]
    present = np.isfinite(points[..., 0])
    seen = present.sum(0) >= _MIN_FRAMES
    use = (present & seen).sum(1) >= 3
    shape = rest[PALM].copy()
    if seen.sum() < 3 or use.sum() < _MIN_FRAMES:
        return shape, np.zeros(len(PALM), dtype=bool)
    p, ok = np.where(present[use, :, None], points[use], 0.0), (present & seen)[use]
    trust = np.ones(len(p))
    for _ in range(rounds):
        aligned = _align(p, np.broadcast_to(shape, p.shape), ok)
        residual = np.where(ok, np.linalg.norm(aligned - shape, axis=-1), 0.0)
        spread = np.sqrt(np.square(residual).sum(1) / ok.sum(1))
        scale = max(float(np.median(spread)), 1e-9)
        trust = 1.0 / (1.0 + (spread / (2.0 * scale)) ** 2)
        w = ok * trust[:, None]
        mean = (w[..., None] * aligned).sum(0) / np.maximum(w.sum(0), 1e-12)[:, None]
        new = np.where(seen[:, None], mean, shape)
        step = float(np.abs(new - shape).max())
        shape = new
        if step < 1e-8:
            break
    # Procrustes leaves the shape's place open: lay it onto the prior, wrist on wrist
    placed = _align(shape[None], rest[PALM][None], seen[None])[0]
    if seen[0]:
        placed = placed - placed[0] + rest[0]
    placed[~seen] = rest[PALM][~seen]
    return placed, seen


def _align(points: Array, target: Array, use: NDArray[np.bool_]) -> Array:
    """points (T, n, 3) moved rigidly onto target (T, n, 3), by the joints in use (T, n)."""
    w = use[..., None] / use.sum(1)[:, None, None]
    a, b = (w * points).sum(1, keepdims=True), (w * target).sum(1, keepdims=True)
    m = np.einsum("tni,tnj->tij", w * (target - b), points - a)
    u, _, vt = np.linalg.svd(m)
    u[..., -1] *= np.sign(np.linalg.det(u @ vt))[:, None]
    return np.asarray(np.einsum("tij,tnj->tni", u @ vt, points - a) + b)
