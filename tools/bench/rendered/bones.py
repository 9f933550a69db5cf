"""Frames that go with each bone, and the constant offsets of landmarks in them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from handtrack.evaluation.alignment import procrustes
from handtrack.hand.skeleton import PARENTS
from tools.bench.rendered.layout import Array

_INDEX, _MIDDLE, _LITTLE = 5, 9, 17


def bone_frames(joints: Array, hand: str) -> Array:
    """(T, 21, 3, 3), columns: along the bone that arrives, towards the thumb's side, its normal.

    The wrist's bone is the one to the middle finger's base. A left hand's frames are the mirror
    images of a right hand's.
    """
    along = joints - joints[:, np.maximum(PARENTS, 0)]
    along[:, 0] = joints[:, _MIDDLE] - joints[:, 0]
    x = along / np.linalg.norm(along, axis=-1, keepdims=True)
    lateral = (joints[:, _INDEX] - joints[:, _LITTLE])[:, None]
    y = lateral - (lateral * x).sum(-1, keepdims=True) * x
    y = y / np.maximum(np.linalg.norm(y, axis=-1, keepdims=True), 1e-12)
    z = np.cross(x, y) * (1.0 if hand == "right" else -1.0)
    return np.stack([x, y, z], -1)


def aligned(estimate: Array, truth: Array) -> Array:
    """The estimate brought onto the truth by each frame's own similarity."""
    s, r, t = procrustes(estimate, truth)
    return np.asarray(s[:, None, None] * (estimate @ r.swapaxes(-1, -2)) + t[:, None])


def in_bones(vectors: Array, frames: Array) -> Array:
    """(T, 21, 3) of vectors in the frames of their joints."""
    return np.asarray(np.einsum("tjik,tji->tjk", frames, vectors))


def hand_size(joints: Array) -> Array:
    """(T, 1, 1) mean distance from the wrist to the four finger bases."""
    palm = np.linalg.norm(joints[:, [5, 9, 13, 17]] - joints[:, :1], axis=-1)
    return np.asarray(palm.mean(1)[:, None, None])


def learnt_offsets(pairs: Iterable[tuple[Array, Array, str]]) -> Array:
    """(21, 3) from the landmark to the joint centre in the bone's frame, in hand sizes.

    Args:
        pairs: estimate (T, 21, 3), truth (T, 21, 3) and hand of each clip.

    Returns:
        NaN where no frame has all joints.
    """
    found: list[Array] = []
    for estimate, truth, hand in pairs:
        near = aligned(estimate, truth)
        off = in_bones(truth - near, bone_frames(near, hand)) / hand_size(near)
        found.append(off[np.isfinite(off).all((1, 2))])
    whole = np.concatenate(found)
    return np.asarray(np.median(whole, axis=0)) if len(whole) else np.full((21, 3), np.nan)


def moved_by(estimate: Array, offsets: Array, hand: str) -> Array:
    """The estimate with the offsets put on."""
    step = np.einsum("tjik,jk->tji", bone_frames(estimate, hand), offsets)
    return np.asarray(estimate + hand_size(estimate) * step)
