"""Clips that are converted."""

from __future__ import annotations

import dataclasses

import numpy as np

import handtrack as ht
from handtrack.hand.rotations import vector_to_matrix

FPS = 30


def poses(frames: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles, rotations and translations of a hand that moves through its range."""
    t = np.arange(frames)[:, None] / FPS
    rng = np.random.default_rng(seed)
    speed, shift = rng.uniform(1.5, 4, (1, 20)), rng.uniform(0, 6, (1, 20))
    middle = np.tile([0.4, 0.02, 0.5, 0.4], 5)
    angles = middle + np.tile([0.4, 0.08, 0.4, 0.3], 5) * np.sin(speed * t + shift)
    turn = vector_to_matrix(np.concatenate([0.8 * np.sin(t), 0.5 * t, np.cos(2 * t)], 1))
    move = np.concatenate([0.2 * np.sin(t), 0.1 * t, 0.4 + 0.1 * np.cos(t)], 1)
    return angles, turn, move


def moving(hand: str = "right", frames: int = 40, start_ns: int = 5_000_000_000) -> ht.Sequence:
    """The default hand in such poses."""
    model = ht.HandModel.default(hand)
    time = start_ns + np.round(np.arange(frames) * 1e9 / FPS).astype(np.int64)
    joints = model.joints(*poses(frames))
    return ht.Sequence(time, joints, hand=hand, frame_index=np.arange(100, 100 + frames))


def exact(sequence: ht.Sequence) -> tuple[ht.HandModel, str]:
    return ht.HandModel.default(sequence.hand), "none"


def holed(sequence: ht.Sequence) -> ht.Sequence:
    """With a thumb's base that is never seen, a tip that is not for a while."""
    joints = sequence.joints.copy()
    joints[:, 1] = np.nan
    joints[10:13, 12] = np.nan
    return dataclasses.replace(sequence, joints=joints, confidence=None)
