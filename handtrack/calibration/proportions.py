"""A subject's proportions by medians: bone lengths and the palm's shape.

Quick and robust. Joint axes stay the model's; `calibrate` starts here, and stays here where
there is too little for more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import BASES, BONES, JOINT_NAMES, PALM

Array = NDArray[np.float64]

# a median of fewer frames is no calibration
_MIN_FRAMES = 3
# shorter than this, over what the prior says, a bone is none
_LEAST_BONE = 0.1


@dataclass(frozen=True, eq=False)
class Proportions:
    """What medians say of a hand.

    Attributes:
        scaled: the prior at the subject's size.
        model: the prior with the subject's bone lengths and palm; its axes are the prior's.
        scale: size of the subject's hand over the prior's.
        kept: names of the joints whose bone, or place in the palm, was never seen, so that
            the scaled prior's was kept.
        unseen: names of the joints whose bone was never seen.
    """

    scaled: HandModel
    model: HandModel
    scale: float
    kept: tuple[str, ...]
    unseen: tuple[str, ...]


def proportions(model: HandModel, joints: Array, noise: float, source: str = "") -> Proportions:
    """Robust medians of the bone lengths, and the palm by generalised Procrustes analysis.

    Args:
        model: the prior; what the joints do not show stays as it is there, scaled.
        joints: (T, 21, 3) of one hand [m]; NaN = missing.
        noise: standard deviation of the joints per coordinate [m].
        source: for the error.

    Raises:
        InputError: no bone was seen.
    """
    lengths = _bone_lengths(joints, noise, _MIN_FRAMES)
    # the size alone is known from a picture or two as well
    sizes = lengths if np.isfinite(lengths).any() else _bone_lengths(joints, 0.0, 1)
    known = np.isfinite(sizes) & (sizes > 0)
    if not known.any():
        raise InputError(
            "no bone is seen with both its ends, so the hand's size is unknown", source or None
        )
    ratios = sizes / model.bone_lengths
    scale = float(np.median(ratios[known]))
    # a bone of hardly any length was not seen: its ends are one joint given twice
    lengths[~(ratios > _LEAST_BONE * scale)] = np.nan
    seen = np.isfinite(lengths)
    scaled = model.scaled(scale)
    rest = scaled.rest_joints
    palm, placed = _palm_shape(joints, rest)
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
    unseen = {JOINT_NAMES[1 + b] for b in np.flatnonzero(~seen)}
    kept = unseen - {JOINT_NAMES[b] for b in BASES}
    kept |= {JOINT_NAMES[j] for j, ok in zip(PALM, placed, strict=True) if not ok}
    return Proportions(
        scaled,
        reshaped(model, new),
        scale,
        tuple(name for name in JOINT_NAMES if name in kept),
        tuple(name for name in JOINT_NAMES if name in unseen),
    )


def _bone_lengths(joints: Array, noise: float, least: int) -> Array:
    """(20,) median length of each bone, cleared of what noise adds; NaN if seen less often."""
    parent, child = np.array(BONES).T
    d2 = np.square(joints[:, child] - joints[:, parent]).sum(-1)
    out = np.full(len(BONES), np.nan)
    for b in range(len(BONES)):
        x = d2[:, b][np.isfinite(d2[:, b])]
        if len(x) >= least:
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
    # a base at the wrist was not seen: it is one joint given twice
    reach, usual = (np.linalg.norm(p - p[0], axis=1) for p in (placed, rest[PALM]))
    seen = seen & (reach >= _LEAST_BONE * usual)
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
