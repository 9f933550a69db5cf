"""What a recorder knows of each of its hands: whose place it is, and what waits to be written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
from handtrack.mcap.hand import Event, Head
from handtrack.mcap.state import ARRAYS, MARKS, SCALARS, Stretch
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.track import Part

_COLUMNS = (
    *((f.name, f.shape, bool if f.name in MARKS else float) for f in ARRAYS),
    *((name, (), kind) for name, kind in SCALARS.items() if kind is not np.str_),
)
"""Arrays of frames that wait: name, shape of one frame, type."""
_OF_FRAME = tuple(name for name, _, _ in _COLUMNS if name not in ("truth", "frame_index"))
_ROOM = 32
"""Frames that there is room for at first."""
_PALM = [0, 1, 5, 17]
"""Joints that do not move against one another, and tell a left hand from a right one."""
_SAME_M = 1e-5


def same_hand(a: HandModel, b: HandModel) -> bool:
    """Whether two models have the same joints, axes, limits and landmarks."""
    if a is b:
        return True
    pairs = (
        (a.rest_joints, b.rest_joints),
        (a.axes, b.axes),
        (a.limits.lower, b.limits.lower),
        (a.limits.upper, b.limits.upper),
        (a.landmark_offsets, b.landmark_offsets),
    )
    return a.hand == b.hand and all(np.array_equal(x, y) for x, y in pairs)


class Slot:
    """A hand's place in a recording, and whether what comes belongs there.

    Attributes:
        head: of what came first.
    """

    def __init__(self, name: str, side: str, slots: Sequence[tuple[str, str]]) -> None:
        self._name, self._side = name, side
        self._others = [slot for slot in slots if slot != (name, side)]
        self.head: Head | None = None
        self._last_ns: int | None = None

    def check(self, part: Part) -> None:
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
        if len(part) and (part.truth is not None) != head.has_truth:
            raise InputError("true joints are given with all frames of a hand, or with none")

    def take(self, part: Part) -> None:
        """Remember what was written."""
        if self.head is None:
            self.head = part.head
        if len(part):
            self._last_ns = int(part.time_ns[-1])


class FrameBuffer:
    """Frames of a hand that are not written yet, as arrays.

    Args:
        head: what does not change of the hand.
    """

    def __init__(self, head: Head) -> None:
        self._head, self.model = head, head.model
        rest = head.model.rest_joints[_PALM].tolist()
        self._palm = [[b - a for a, b in zip(rest[0], joint, strict=True)] for joint in rest[1:]]
        self._arrays: dict[str, NDArray[Any]] = {
            name: np.empty((_ROOM, *shape), kind) for name, shape, kind in _COLUMNS
        }
        self._texts: dict[str, list[str]] = {"status": [], "reason": []}
        self._next = self._size = 0
        self._last_ns: int | None = None
        self._has_truth: bool | None = None

    def __len__(self) -> int:
        return self._size

    @property
    def span_ns(self) -> int:
        """From the first frame that waits to the last [ns]."""
        times = self._arrays["time_ns"]
        return int(times[self._size - 1]) - int(times[0]) if self._size else 0

    def add(self, frame: TrackedFrame, index: int | None, truth: ArrayLike | None) -> None:
        """The next frame.

        Raises:
            InputError: it is of another hand, or truth has another shape or is missing.
            SettingsError: time does not increase.
        """
        if self._last_ns is not None and frame.time_ns <= self._last_ns:
            raise SettingsError(f"time of {self._head.name} does not increase")
        if not self._fits(frame):
            raise InputError(
                f"{self._head.name}: the frame was not fitted with the {self._head.hand} hand that"
                " is recorded"
            )
        if self._has_truth not in (None, truth is not None):
            raise InputError("true joints are given with all frames of a hand, or with none")
        row = self._size
        if row == len(self._arrays["time_ns"]):
            self._arrays = {name: _doubled(array) for name, array in self._arrays.items()}
        arrays = self._arrays
        if truth is not None:
            joints = np.array(truth, np.float64)
            if joints.shape != (N_JOINTS, 3):
                raise InputError(f"truth has shape {joints.shape}, expected (21, 3)")
            arrays["truth"][row] = joints
        for name in _OF_FRAME:
            arrays[name][row] = getattr(frame, name)
        arrays["frame_index"][row] = index = self._next if index is None else index
        self._texts["status"].append(frame.status)
        self._texts["reason"].append(frame.reason)
        self._has_truth, self._last_ns = truth is not None, frame.time_ns
        self._next, self._size = index + 1, row + 1

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

    def take(self, events: Sequence[Event]) -> Stretch:
        """The frames that wait, as a stretch with those events; none is left."""
        arrays: dict[str, Any] = {n: a[: self._size].copy() for n, a in self._arrays.items()}
        arrays |= {name: np.array(texts) for name, texts in self._texts.items()}
        if not self._has_truth:
            arrays["truth"] = None
        self._texts = {name: [] for name in self._texts}
        self._size = 0
        head = replace(self._head, has_truth=bool(self._has_truth))
        return Stretch(**arrays, head=head, events=tuple(events))


def no_frames(head: Head, events: Sequence[Event]) -> Stretch:
    """A stretch of events alone."""
    arrays: dict[str, Any] = {name: np.empty((0, *shape), kind) for name, shape, kind in _COLUMNS}
    arrays |= {name: np.empty(0, np.str_) for name in ("status", "reason")}
    return Stretch(**arrays, head=head, events=tuple(events))


def _doubled(array: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate([array, np.empty_like(array)])
