"""What a recorder knows of each of its hands: whose place it is, and what waits to be written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError, SettingsError
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
from handtrack.recording.window import rows
from handtrack.tracking.track import Event, Track
from handtrack.tracking.tracker import TrackedFrame, track_of_frames

_PALM = [0, 1, 5, 17]
"""Joints that do not move against one another, and tell a left hand from a right one."""
_SAME_M = 1e-5


def same_hand(a: HandModel, b: HandModel) -> bool:
    """Whether two models have the same joints, axes and limits."""
    if a is b:
        return True
    pairs = (
        (a.rest_joints, b.rest_joints),
        (a.axes, b.axes),
        (a.limits.lower, b.limits.lower),
        (a.limits.upper, b.limits.upper),
    )
    return a.hand == b.hand and all(np.array_equal(x, y) for x, y in pairs)


class Slot:
    """A hand's place in a recording, and whether what comes belongs there.

    Attributes:
        head: what came first, without its frames.
    """

    def __init__(self, name: str, side: str, slots: Sequence[tuple[str, str]]) -> None:
        self._name, self._side = name, side
        self._others = [slot for slot in slots if slot != (name, side)]
        self.head: Track | None = None
        self._last_ns: int | None = None

    def check(self, part: Track) -> None:
        """Raises InputError: the part belongs to another hand; SettingsError: it comes late."""
        times = part.time_ns
        late = len(part) and self._last_ns is not None and int(times[0]) <= self._last_ns
        if late or (times[1:] <= times[:-1]).any():
            raise SettingsError(f"time of {part.name} does not increase")
        if part.hand != self._side:
            raise InputError(
                f"{part.name} is a {part.hand} hand, its place is that of {self._name}, a"
                f" {self._side} one"
            )
        if (part.name, part.hand) in self._others:
            raise InputError(f"{part.name} was given the place of {self._name}")
        if self.head is None:
            return
        head = self.head
        if not same_hand(part.model, head.model):
            raise InputError(f"{part.name}: these frames were fitted with another hand")
        if part.settings is not head.settings and dict(part.settings) != dict(head.settings):
            raise InputError(f"{part.name}: these frames were made with other settings")
        if len(part) and (part.truth is None) != (head.truth is None):
            raise InputError("true joints are given with all frames of a hand, or with none")

    def take(self, part: Track) -> None:
        """Remember what was written."""
        if self.head is None:
            self.head = rows(part, slice(0))
        if len(part):
            self._last_ns = int(part.time_ns[-1])


class Waiting:
    """Frames of a hand that are not written yet, and what does not change of it."""

    def __init__(self, model: HandModel | None, name: str, about: Mapping[str, Any]) -> None:
        self.model, self._name, self._about = model, name, about
        rest = [] if model is None else model.rest_joints[_PALM].tolist()
        self._palm = [[b - a for a, b in zip(rest[0], joint, strict=True)] for joint in rest[1:]]
        self.frames: list[TrackedFrame] = []
        self.events: list[Event] = []
        self._indexes: list[int] = []
        self._truth: list[Any] = []
        self._next = 0
        self._last_ns: int | None = None
        self._has_truth: bool | None = None

    def add(self, frame: TrackedFrame, index: int | None, truth: ArrayLike | None) -> None:
        if self.model is None:
            raise SettingsError("frames need a hand model: give it to the recorder")
        if self._last_ns is not None and frame.time_ns <= self._last_ns:
            raise SettingsError(f"time of {self._name} does not increase")
        if not self._fits(frame):
            raise InputError(
                f"{self._name}: the frame was not fitted with the {self.model.hand} hand that is"
                " recorded"
            )
        if self._has_truth not in (None, truth is not None):
            raise InputError("true joints are given with all frames of a hand, or with none")
        if truth is not None:
            joints = np.array(truth, np.float64)
            if joints.shape != (N_JOINTS, 3):
                raise InputError(f"truth has shape {joints.shape}, expected (21, 3)")
            self._truth.append(joints)
        self._has_truth = truth is not None
        self.frames.append(frame)
        self._last_ns = frame.time_ns
        self._indexes.append(self._next if index is None else index)
        self._next = self._indexes[-1] + 1

    def _fits(self, frame: TrackedFrame) -> bool:
        """Whether the frame's palm is the model's: the other hand's, or another's, is not."""
        w, x, y, z = frame.quaternion_raw.tolist()
        joints = frame.fitted_joints
        (ox, oy, oz), *found = joints[_PALM].tolist()
        for (a, b, c), (px, py, pz) in zip(self._palm, found, strict=True):
            # v + 2 u x (u x v + w v)
            i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
            off = (
                a + 2 * (y * k - z * j) - (px - ox),
                b + 2 * (z * i - x * k) - (py - oy),
                c + 2 * (x * j - y * i) - (pz - oz),
            )
            # what is not fitted is NaN
            if max(map(abs, off)) > _SAME_M:
                return False
        return True

    def take(self, model: HandModel) -> Track:
        """The frames as a track; none is left."""
        part = track_of_frames(
            self.frames,
            model,
            self._about["settings"],
            name=self._name,
            frame_index=self._indexes,
            truth=np.array(self._truth) if self._has_truth else None,
            source=self._about["source"],
            subject=self._about["subject"],
            events=self.events,
        )
        self.frames, self.events, self._indexes, self._truth = [], [], [], []
        return part
