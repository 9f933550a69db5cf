"""Clean motion of a made hand, and faults that are put into motion, with the frames they are in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import BASES, HANDS, Hand

Made = tuple[ht.Sequence, list[int]]
Fault = Callable[[ht.Sequence, np.random.Generator], Made]

N = 240


def clean(seed: int, noise_mm: float = 0.7, hand: Hand | None = None) -> ht.Sequence:
    """A hand that moves, turns and flexes, with a little noise."""
    rng = np.random.default_rng(seed)
    hand = hand or HANDS[seed % 2]
    t = np.arange(N)[:, None] / 30
    waves = np.sin(2 * np.pi * t * rng.uniform(0.1, 0.5, 26) + rng.uniform(0, 6, 26))
    angles = np.full((N, 20), 0.0)
    angles[:] = 0.35 + 0.3 * waves[:, :20]
    angles[:, 1::4] *= 0.2  # abduction
    turns = vector_to_matrix(0.5 * waves[:, 20:23] + rng.normal(0, 1, 3))
    joints = HandModel.default(hand).joints(angles, turns, 0.15 * waves[:, 23:])
    joints = joints + rng.normal(0, noise_mm * 1e-3, joints.shape)
    stamps = (np.arange(N) * 1e9 / 30).astype(np.int64)
    return ht.Sequence(stamps, joints, hand=hand, name=f"clip {seed}", source=f"clip{seed}.npz")


def with_joints(s: ht.Sequence, joints: NDArray[np.float64], **changes: Any) -> ht.Sequence:
    """The same with other joints."""
    told: dict[str, Any] = {"confidence": None, **changes}  # it is told anew
    return replace(s, joints=joints, **told)


# each: (kind, what is made of a clip, the frames that must be marked)


def bone_jumps(s: ht.Sequence, rng: np.random.Generator) -> Made:
    joints, at = s.joints.copy(), int(rng.integers(20, len(s.joints) - 20))
    joint = int(rng.integers(5, 20))
    joint = joint + 1 if joint in BASES else joint
    joints[at, joint] += 1.4 * (joints[at, joint] - joints[at, joint - 1])
    return with_joints(s, joints), [at]


def breathes(s: ht.Sequence, rng: np.random.Generator) -> Made:
    size = 1 + 0.12 * np.sin(2 * np.pi * np.arange(len(s.joints)) / 150)
    middle = s.joints.mean(1, keepdims=True)
    return with_joints(s, middle + size[:, None, None] * (s.joints - middle)), []


def other_hand(s: ht.Sequence, rng: np.random.Generator) -> Made:
    at = int(rng.integers(10, len(s.joints) - 60))
    joints = s.joints.copy()
    joints[at : at + 50] *= [-1, 1, 1]
    return with_joints(s, joints), list(range(at + 10, at + 40))


def exchanged_joints(s: ht.Sequence, rng: np.random.Generator) -> Made:
    joints = s.joints.copy()
    order = np.r_[0, 5:9, 1:5, 9:21]
    return with_joints(s, joints[:, order]), []


def in_inches(s: ht.Sequence, rng: np.random.Generator) -> Made:
    return with_joints(s, s.joints * 2.54), []


def time_jumps(s: ht.Sequence, rng: np.random.Generator) -> Made:
    at = int(rng.integers(20, len(s.joints) - 20))
    stamps = s.time_ns.copy()
    stamps[at:] += 400_000_000
    return replace(s, time_ns=stamps), [at]


def freezes(s: ht.Sequence, rng: np.random.Generator) -> Made:
    at = int(rng.integers(20, len(s.joints) - 40))
    joints = s.joints.copy()
    joints[at + 1 : at + 8] = joints[at]
    return with_joints(s, joints), list(range(at + 1, at + 8))


def repeats(s: ht.Sequence, rng: np.random.Generator) -> Made:
    joints = s.joints.copy()
    joints[150:170] = joints[30:50]
    return with_joints(s, joints), list(range(150, 170))


def hand_jumps(s: ht.Sequence, rng: np.random.Generator) -> Made:
    at = int(rng.integers(20, len(s.joints) - 20))
    joints = s.joints.copy()
    joints[at] += 0.12 * np.array([0.6, -0.8, 0.0])
    return with_joints(s, joints), [at]


def joint_jumps(s: ht.Sequence, rng: np.random.Generator) -> Made:
    joints, at = s.joints.copy(), int(rng.integers(20, len(s.joints) - 20))
    joints[at, int(rng.integers(6, 21))] += [0.04, 0.03, -0.03]
    return with_joints(s, joints), [at]


def folds(s: ht.Sequence, rng: np.random.Generator) -> Made:
    joints, at, base = (
        s.joints.copy(),
        int(rng.integers(20, len(s.joints) - 60)),
        int(rng.choice(BASES[1:])),
    )
    span = slice(at, at + 20)
    bone = joints[span, base + 1] - joints[span, base]
    side = joints[span, base + 2] - joints[span, base + 1]
    length = np.linalg.norm(side, axis=1, keepdims=True)
    back = -bone / np.linalg.norm(bone, axis=1, keepdims=True) + 0.2 * side / length
    back *= length / np.linalg.norm(back, axis=1, keepdims=True)
    rest = joints[span, base + 3] - joints[span, base + 2]
    joints[span, base + 2] = joints[span, base + 1] + back
    joints[span, base + 3] = joints[span, base + 2] + rest
    return with_joints(s, joints), list(range(at, at + 20))


def whole_hand_shakes(s: ht.Sequence, rng: np.random.Generator) -> Made:
    return with_joints(s, s.joints + rng.normal(0, 0.006, (len(s.joints), 1, 3))), []


def fingers_shake(s: ht.Sequence, rng: np.random.Generator) -> Made:
    joints = s.joints.copy()
    for base in BASES:
        joints[:, base + 2 : base + 4] += rng.normal(0, 0.006, (len(s.joints), 2, 3))
    return with_joints(s, joints), []


def slight_finger_shake(s: ht.Sequence, rng: np.random.Generator) -> Made:
    """1.7 mm an axis on the fingers' joints beyond the knuckles."""
    joints = s.joints.copy()
    for base in BASES:
        joints[:, base + 1 : base + 4] += rng.normal(0, 0.0017, (len(s.joints), 3, 3))
    return with_joints(s, joints), []


def exchanged_fingers(s: ht.Sequence, rng: np.random.Generator) -> Made:
    """Two neighbouring fingers exchanged for 8 frames."""
    joints, at = s.joints.copy(), int(rng.integers(20, len(s.joints) - 28))
    first = int(rng.integers(1, 4))
    a, b = (np.arange(4) + BASES[first + k] for k in (0, 1))
    joints[at : at + 8, np.r_[a, b]] = joints[at : at + 8, np.r_[b, a]]
    return with_joints(s, joints), list(range(at, at + 8))


def long_bone(s: ht.Sequence, rng: np.random.Generator) -> Made:
    """One bone a fifth longer for one frame, what hangs on it moved along."""
    joints, at = s.joints.copy(), int(rng.integers(20, len(s.joints) - 20))
    base, k = int(rng.choice(BASES)), int(rng.integers(1, 4))
    joint = base + k
    joints[at, joint : base + 4] += 0.2 * (joints[at, joint] - joints[at, joint - 1])
    return with_joints(s, joints), [at]


def breathes_quickly(s: ht.Sequence, rng: np.random.Generator) -> Made:
    """A tenth larger and smaller, once in 20 frames."""
    size = 1 + 0.1 * np.sin(2 * np.pi * np.arange(len(s.joints)) / 20 + rng.uniform(0, 6))
    middle = s.joints.mean(1, keepdims=True)
    return with_joints(s, middle + size[:, None, None] * (s.joints - middle)), []


SLIGHT: dict[str, tuple[str, Fault]] = {
    "fingers shake, 1.7 mm an axis": ("fingers shake", slight_finger_shake),
    "fingers exchanged for 8 frames": ("order", exchanged_fingers),
    "one bone 20 % longer for one frame": ("bone jumps", long_bone),
    "breathing by 10 % in 20 frames": ("bones breathe", breathes_quickly),
}
"""Slighter ones: the kind that names each, and what makes it."""

FAULTS: dict[str, Fault] = {
    "bone jumps": bone_jumps,
    "bones breathe": breathes,
    "other hand": other_hand,
    "order": exchanged_joints,
    "unit": in_inches,
    "time": time_jumps,
    "frozen": freezes,
    "jump": hand_jumps,
    "joint jumps": joint_jumps,
    "beyond limits": folds,
    "hand shakes": whole_hand_shakes,
    "fingers shake": fingers_shake,
}
