"""Text lines of hands as Hand Tracking Streamer and its like send them.

    Right wrist:, x, y, z, qx, qy, qz, qw
    Right landmarks:, 63 numbers          21 joints in the wrist's frame [m], MediaPipe's order
    Right landmarks | f = 12 | t = 5000:, ...    with a frame's number and a time [ns]

The world is Unity's, left-handed, and is turned round in z here. The wrist's last pose places the
landmarks; without one they stay about the wrist. Other lines (`Head pose:`) are passed over.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.columns_at_once import LARGE
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.landmark_numbers import joints_of_lines
from handtrack.sequences.readers.raw import Array, Raw, stem

_LINE = re.compile(rb"\s*(left|right)\s+(wrist|landmarks)\b([^:]{0,200}):", re.IGNORECASE)
_OTHER = re.compile(rb"\s*[A-Za-z][A-Za-z ]{2,30}(\|[^:]{0,200})?:\s*,?\s*-?\d")
_ABOUT = re.compile(rb"\|\s*([a-z_]+)\s*=\s*(-?\d{1,19})\s*", re.IGNORECASE)
_WITHIN = 10
"""A hand that none of so many lines tells of is gone: nothing waits for it."""
_MIRROR = np.array([1.0, 1.0, -1.0])
_LOOKED_AT = 100_000
_MOST = 10_000_000
"""Lines of a file."""


def is_landmark_line(data: bytes) -> bool:
    """Whether text begins with such a line."""
    return _LINE.match(data) is not None


def is_text_line(data: bytes) -> bool:
    """Whether text begins with a line that may come among such."""
    return is_landmark_line(data) or _OTHER.match(data) is not None


class Moment(NamedTuple):
    """What lines tell of one moment.

    Attributes:
        hands: (21, 3) joints [m] of each.
        stamp: what the lines say of it: "t" [ns], "f" the frame's number.
    """

    hands: dict[Hand, Array]
    stamp: dict[str, int]

    def record(self) -> dict[str, Any]:
        """It as a line of JSON would be."""
        hands = [{"hand": h, "joints_m": x.tolist()} for h, x in sorted(self.hands.items())]
        frame: dict[str, Any] = {"hands": hands}
        if "t" in self.stamp:
            frame["time_ns"] = self.stamp["t"]
        if "f" in self.stamp:
            frame["frame"] = self.stamp["f"]
        return frame


@dataclass
class LandmarkLines:
    """Frames in lines that come one after the other, of one hand or of both in turn.

    Attributes:
        where: what messages call the source.
    """

    where: Path
    _wrists: dict[Hand, tuple[Array, Array]] = field(default_factory=dict)
    _waiting: dict[Hand, Array] = field(default_factory=dict)
    _stamp: dict[str, int] = field(default_factory=dict)
    _lately: deque[Hand] = field(default_factory=lambda: deque(maxlen=_WITHIN))

    def expect(self, data: bytes) -> None:
        """Wait for the hands that these first lines tell of, from the start."""
        for line in data[:_LOOKED_AT].splitlines():
            found = _LINE.match(line)
            if found is not None and found[2].lower() == b"landmarks":
                self._lately.append("left" if found[1].lower() == b"left" else "right")

    @property
    def begun(self) -> bool:
        """Whether lines of landmarks came."""
        return bool(self._lately)

    def take(self, data: bytes) -> list[dict[str, Any]]:
        """The frames that a line, or some, complete.

        Raises:
            InputError: a line that is none, or with other than 7 or 63 numbers.
        """
        return [moment.record() for moment in self.moments(data)]

    def moments(self, data: bytes) -> list[Moment]:
        """The same as `take`, as arrays."""
        found: list[Moment] = []
        for line in data.splitlines():
            if line.strip():
                found += self.line(line)
        return found

    def rest(self) -> list[dict[str, Any]]:
        """The frame of a hand that still waits for the other, at the end."""
        return [moment.record() for moment in self.last()]

    def last(self) -> list[Moment]:
        """The same as `rest`, as arrays."""
        return self._frame() if self._waiting else []

    def line(self, line: bytes, placed: Array | None = None) -> list[Moment]:
        """The moments that a line completes.

        Args:
            line: it.
            placed: its joints (21, 3), empty of other lines; None: they are read from it.

        Raises:
            InputError: as `take`.
        """
        found = _LINE.match(line)
        if found is None:
            if _OTHER.match(line):
                return []
            text = shown(line[:40].decode("latin-1"), 40)
            raise InputError(
                f"{text} is no line such as 'Right landmarks:, 63 numbers'", self.where
            )
        hand: Hand = "left" if found[1].lower() == b"left" else "right"
        if placed is not None:
            return self._joints(hand, placed, found[3]) if len(placed) else []
        values = line[found.end() :].split(b",")
        if found[2].lower() == b"wrist":
            # some add the fist's state
            pose = self._numbers(
                [v for v in values if b":" not in v and not v.strip().isalpha()], 7
            )
            if not 1e-6 < np.abs(pose[3:]).max() < 1e6:
                raise InputError("a wrist's quaternion is 0: no rotation", self.where)
            self._wrists[hand] = pose[:3], quaternion_to_matrix(np.roll(pose[3:], 1))
            return []
        joints = self._numbers(values, 3 * N_JOINTS).reshape(N_JOINTS, 3)
        if hand in self._wrists:
            place, turn = self._wrists[hand]
            joints = joints @ turn.T + place
        return self._joints(hand, joints, found[3])

    def _joints(self, hand: Hand, joints: Array, about: bytes) -> list[Moment]:
        said = {key.lower()[:1].decode(): int(value) for key, value in _ABOUT.findall(about)}
        other = self._waiting and (hand in self._waiting or said != self._stamp)
        frames = self._frame() if other else []
        joining = bool(self._lately) and hand not in self._lately
        self._lately.append(hand)
        if joining:  # the other hand of this moment has gone out already
            return frames
        self._waiting[hand], self._stamp = joints * _MIRROR, said
        if set(self._lately) <= self._waiting.keys():
            frames += self._frame()
        return frames

    def _numbers(self, values: list[bytes], count: int) -> Array:
        try:
            numbers = np.array(list(map(float, values)))
        except ValueError:
            try:
                numbers = np.array([float(v) for v in values if v.strip()])
            except ValueError:
                numbers = np.empty(0)
        if len(numbers) != count or not np.isfinite(numbers).all():
            there = sum(1 for v in values if v.strip())
            raise InputError(f"a line has {there} values, expected {count} numbers", self.where)
        return numbers

    def _frame(self) -> list[Moment]:
        """What waits."""
        moment = Moment(self._waiting, self._stamp)
        self._waiting, self._stamp = {}, {}
        return [moment]


def read_landmark_lines(data: bytes, path: Path) -> list[Raw]:
    """The hands of a file of such lines.

    Raises:
        InputError: a line that is none (with its number).
    """
    stream = LandmarkLines(path)
    stream.expect(data)
    moments: list[Moment] = []
    places: list[str] = []
    lines = data.splitlines()
    if len(lines) > _MOST:
        raise InputError(f"has {len(lines)} lines", path)
    together = joints_of_lines(list(map(_LINE.match, lines))) if len(data) > LARGE else None
    placed: Items[Array | None] = together or [None] * len(lines)
    for n, (line, joints) in enumerate(zip(lines, placed, strict=True), 1):
        try:
            new = stream.line(line, joints) if line.strip() else []
        except InputError as error:
            text = str(error).removeprefix(f"{path}: ")
            raise InputError(text, Path(f"{path}, line {n}")) from None
        moments += new
        places += [f"line {n}"] * len(new)
    last = stream.last()
    moments, places = moments + last, places + [f"line {len(lines)}"] * len(last)
    if not moments:
        raise InputError("no line of landmarks in it", path)
    seen = {hand for moment in moments for hand in moment.hands}
    return [_raw(hand, moments, places, path) for hand in HANDS if hand in seen]


def _raw(hand: Hand, moments: list[Moment], places: list[str], path: Path) -> Raw:
    """One hand in all moments."""
    joints = np.full((len(moments), N_JOINTS, 3), np.nan)
    for row, moment in zip(joints, moments, strict=True):
        if hand in moment.hands:
            row[:] = moment.hands[hand]
    raw = Raw(joints, path, stem(path), hand=hand, unit="m")
    times = [m.stamp.get("t") for m in moments]
    if any(t is not None for t in times):
        raw.stamps = Stamps(times, "time_ns", "ns", places)
    numbers = [m.stamp["f"] for m in moments if "f" in m.stamp]
    if len(numbers) == len(moments):
        raw.frame_index = frame_numbers(numbers, len(numbers), path, "f")
    return raw


FORMATS = (
    Format(
        "Hand Tracking Streamer (Quest, PICO)",
        "lines `Right wrist:, 7 numbers` and `Right landmarks:, 63 numbers`; a file of them, or"
        " `live --udp PORT`, `live --stdin`",
        "handtrack",
        "m, turned out of Unity's left-handed world",
        "both",
        "its text",
        ways=(Way("text", lambda data, path: is_landmark_line(data), read_landmark_lines),),
    ),
)
