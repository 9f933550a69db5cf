"""A hand whose joints and angles are known, and what a user has of it before saving it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ORDERS
from tools.make import sample as make_sample

FPS = 25.0
"""Of files with a clock; not what is assumed of the others."""
FRAMES = 45
NOISE_M = 0.0001


@dataclass(frozen=True)
class Clip:
    """A made hand: joints (T, 21, 3) [m] with little noise, and the truth."""

    hand: str
    joints: np.ndarray
    truth: np.ndarray
    angles: np.ndarray


@cache
def clip(hand: str = "right", frames: int = FRAMES, seed: int = 3) -> Clip:
    """A hand that opens, closes, pinches and counts, each finger in its own way."""
    rng = np.random.default_rng(seed)
    angles, rotation, translation = (x[20:290:3] for x in make_sample.motion(10.0, 30.0, rng))
    angles, rotation, translation = (x[:frames] for x in (angles, rotation, translation))
    if hand == "left":
        rotation, translation = make_sample.mirrored(rotation, translation)
    truth = HandModel.default(hand).joints(angles, rotation, translation)
    joints = truth + rng.normal(0.0, NOISE_M, truth.shape)
    for array in (joints, truth, angles):
        array.setflags(write=False)
    return Clip(hand, joints, truth, angles)


@dataclass(frozen=True)
class Brought:
    """What is written into a file, and what should come out of it.

    Attributes:
        joints: (T, N, 3) in the user's unit and order; NaN = missing.
        expected: (T, 21, 3) [m] in our order; NaN = to be taken as missing.
        angles: (T, 20) [rad] true angles.
        hand: the true hand.
        label: what the file calls it, None: nothing.
        times: one for each frame, None: none; `time_name`: their name.
        fps: frames a second that must come out; None: any.
        mark: number that stands three times for a missing joint; None: NaN, null or empty.
        confidence: (T, N), or None.
        other: the other hand of the same file.
        extra: more fields of the file.
        options: what the user passes, by the name of `load`'s argument.
    """

    joints: np.ndarray
    expected: np.ndarray
    angles: np.ndarray
    hand: str = "right"
    label: Any = None
    times: list[Any] | None = None
    time_name: str = "time"
    fps: float | None = None
    mark: float | None = None
    confidence: np.ndarray | None = None
    other: Brought | None = None
    extra: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)

    def but(self, **changes: Any) -> Brought:
        return replace(self, **changes)

    @property
    def written(self) -> np.ndarray:
        """(T, N, 3) joints with the mark where they are missing."""
        if self.mark is None:
            return self.joints
        return np.where(np.isnan(self.joints), self.mark, self.joints)

    def each(self) -> list[Brought]:
        return [self] if self.other is None else [self, self.other]


def brought(hand: str = "right", frames: int = FRAMES) -> Brought:
    made = clip(hand)
    return Brought(
        made.joints[:frames].copy(), made.joints[:frames].copy(), made.angles[:frames], hand
    )


def both(frames: int = FRAMES) -> Brought:
    """Left and right, labelled as such."""
    left, right = (brought(h, frames).but(label=h) for h in ("left", "right"))
    return left.but(other=right)


# ---- distortions: each takes what a user has and gives what else a user might have ----


def every(b: Brought, change: Any) -> Brought:
    """The change made to each hand."""
    done = change(b)
    return done if b.other is None else done.but(other=change(b.other))


def missing(b: Brought, mark: float | None, seed: int = 5, part: float = 0.06) -> Brought:
    """Single joints that were not seen, two frames in which nothing was, the first of all."""

    def change(one: Brought) -> Brought:
        gone = np.random.default_rng(seed).random(one.joints.shape[:2]) < part
        gone[[0, 20]] = True
        joints, expected = one.joints.copy(), one.expected.copy()
        joints[gone], expected[gone] = np.nan, np.nan
        return one.but(joints=joints, expected=expected, mark=mark)

    return every(b, change)


def finger_missing(b: Brought, finger: int, mark: float | None = None) -> Brought:
    """A finger that no frame saw."""

    def change(one: Brought) -> Brought:
        joints, expected = one.joints.copy(), one.expected.copy()
        joints[:, 4 * finger + 1 : 4 * finger + 5] = np.nan
        expected[:, 4 * finger + 1 : 4 * finger + 5] = np.nan
        return one.but(joints=joints, expected=expected, mark=mark)

    return every(b, change)


def joined(one: Brought, child: int, parent: int) -> Brought:
    """A bone of no length: its end counts as not seen."""
    joints = one.joints.copy()
    joints[:, child] = joints[:, parent]
    expected = one.expected.copy()
    expected[:, child] = np.nan
    return one.but(joints=joints, expected=expected)


def unsure(b: Brought, seed: int = 6) -> Brought:
    """Confidence 0 where the joint is five centimetres off."""

    def change(one: Brought) -> Brought:
        gone = np.random.default_rng(seed).random(one.joints.shape[:2]) < 0.06
        joints, expected = one.joints.copy(), one.expected.copy()
        joints[gone] += 0.05
        expected[gone] = np.nan
        return one.but(joints=joints, expected=expected, confidence=np.where(gone, 0.0, 0.9))

    return every(b, change)


def scaled(b: Brought, factor: float) -> Brought:
    return every(b, lambda one: one.but(joints=one.joints * factor))


OTHER_ORDERS: dict[str, list[int]] = {
    "wrist_last": [*range(1, 21), 0],
    "tip_to_base": [0, *(4 * f + j for f in range(5) for j in (4, 3, 2, 1))],
    "little_first": [0, *(4 * f + j for f in (4, 3, 2, 1, 0) for j in (1, 2, 3, 4))],
    "index_first_thumb_last": [0, *(4 * f + j for f in (1, 2, 3, 4, 0) for j in (1, 2, 3, 4))],
    "bases_first": [0, *(4 * f + j for j in (1, 2, 3, 4) for f in range(5))],
    "tips_first": [4, 8, 12, 16, 20, 0, *(4 * f + j for f in range(5) for j in (1, 2, 3))],
}
"""Orders of 21 joints that people have; which of ours stands at each place."""


def ordered(b: Brought, order: str) -> Brought:
    """In an order of ours (`ORDERS`, 21 joints) or one of `OTHER_ORDERS`."""
    pick = np.array(OTHER_ORDERS[order]) if order in OTHER_ORDERS else np.argsort(ORDERS[order])

    def change(one: Brought) -> Brought:
        sure = None if one.confidence is None else one.confidence[:, pick]
        return one.but(joints=one.joints[:, pick], confidence=sure)

    return every(b, change)


def mirrored(b: Brought, axis: int) -> Brought:
    """A left-handed world: one axis the other way round; labels stay."""
    return every(b, lambda one: one.but(joints=one.joints * np.where(np.arange(3) == axis, -1, 1)))


def seconds(b: Brought) -> np.ndarray:
    return np.arange(len(b.joints)) / FPS


def timed(b: Brought, name: str, start: float = 0.0, per_second: float = 1.0) -> Brought:
    """Times under that name, in whole numbers where a second has a million parts or more."""

    def change(one: Brought) -> Brought:
        values = start * per_second + seconds(one) * per_second
        whole = per_second >= 1e6
        times = [int(v) for v in np.round(values)] if whole else [float(v) for v in values]
        if per_second == 1e9:
            exact = np.round(seconds(one) * 1e9).astype(np.int64) + int(start * 1e9)
            times = [int(v) for v in exact]
        return one.but(times=times, time_name=name, fps=FPS)

    return every(b, change)


def late(b: Brought, frames: int = 8) -> Brought:
    """Nothing is seen in the first frames."""

    def change(one: Brought) -> Brought:
        joints, expected = one.joints.copy(), one.expected.copy()
        joints[:frames], expected[:frames] = np.nan, np.nan
        return one.but(joints=joints, expected=expected)

    return every(b, change)
