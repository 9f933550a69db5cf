"""CDR, ROS 2's encoding of messages, and ROS 1's: those that carry hands.

geometry_msgs/msg/PoseArray, PoseStamped, PoseWithCovarianceStamped, PointStamped
foxglove_msgs/msg/PosesInFrame
visualization_msgs/msg/MarkerArray, visualization_msgs/msg/Marker
tf2_msgs/msg/TFMessage, geometry_msgs/msg/TransformStamped
"""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np

from handtrack.sequences.readers.robot_messages import (
    Array,
    Marker,
    Message,
    Poses,
    Transform,
    Transforms,
)

_MOST = 100_000
"""Poses, markers or points of a message."""


_SIZES = {kind: struct.calcsize(kind) for kind in "BiIfd"}


@lru_cache(64)
def _plain(kinds: str) -> struct.Struct:
    return struct.Struct(kinds)


class Cdr:
    """Reads values one after the other; numbers lie at multiples of their size.

    Args:
        data: a message, with CDR's four bytes before it.
        packed: it is ROS 1's: without them, numbers close together, headers with a number first.

    Raises:
        ValueError: no CDR, or a length that cannot be.
        struct.error: the message is too short.
    """

    def __init__(self, data: bytes, packed: bool = False) -> None:
        self._packed = packed
        if packed:
            self._data, self._at, self._order = data, 0, "<"
            return
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise ValueError("not in plain CDR")
        self._data, self._at, self._order = data, 4, "<>"[1 - data[1]]

    def number(self, kind: str) -> int:
        """One number, by its letter of `struct`."""
        return int(self.numbers(kind)[0])

    def numbers(self, kinds: str) -> tuple[float, ...]:
        """Numbers of one size each, by their letters."""
        read = _plain(self._order + kinds)
        self._align(_SIZES[kinds[0]])
        found = read.unpack_from(self._data, self._at)
        self._at += read.size
        return found

    def doubles(self, count: int) -> Array:
        """(count,) of 8 bytes each."""
        if not count:
            return np.empty(0)
        self._align(8)
        found = np.frombuffer(self._data, self._order + "f8", count, self._at)
        self._at += 8 * count
        return found.astype(np.float64)

    def skip(self, kind: str, count: int) -> None:
        """Pass over numbers."""
        self._align(_SIZES[kind])
        self._at += _SIZES[kind] * count
        if self._at > len(self._data):
            raise ValueError("it is cut short")

    def _align(self, size: int) -> None:
        self._at += 0 if self._packed else -(self._at - 4) % size

    def length(self) -> int:
        """How many come."""
        count = self.number("I")
        if count > len(self._data) - self._at:
            raise ValueError(f"{count} elements in {len(self._data)} bytes")
        return count

    def text(self) -> str:
        """A string."""
        size = self.length()
        found = self._data[self._at : self._at + size]
        self._at += size
        return found.rstrip(b"\0").decode("utf-8", "replace")

    def header(self) -> tuple[int, str]:
        """The stamp [ns], and the frame."""
        if self._packed:
            self.number("I")
        return self.time(), self.text()

    def time(self) -> int:
        """A stamp [ns]."""
        seconds, rest = self.numbers("iI")
        return int(seconds) * 10**9 + int(rest)

    def pose(self) -> Array:
        """(7,) x y z, and the quaternion x y z w."""
        return self.doubles(7)

    def places(self) -> Array:
        """(n, 3) of a list of poses."""
        return self.doubles(7 * _few(self.length())).reshape(-1, 7)[:, :3]


def poses(cdr: Cdr) -> Message:
    """A PoseArray, or Foxglove's PosesInFrame."""
    stamp, frame = cdr.header()
    return Poses(stamp, frame, cdr.places())


def placed(cdr: Cdr) -> Message:
    """A PoseStamped, with covariance or without, or a PointStamped."""
    stamp, frame = cdr.header()
    return Poses(stamp, frame, cdr.doubles(3)[None])


def posed(cdr: Cdr) -> Message:
    """Foxglove's PosesInFrame, whose time is no header."""
    stamp, frame = cdr.time(), cdr.text()
    return Poses(stamp, frame, cdr.places())


def markers(cdr: Cdr, definition: str) -> Message:
    """A MarkerArray; its definition tells which fields there are."""
    return _marked([_marker(cdr, definition) for _ in range(_few(cdr.length()))])


def marker(cdr: Cdr, definition: str) -> Message:
    """A Marker alone."""
    return _marked([_marker(cdr, definition)])


def _marked(found: list[Marker]) -> Message:
    stamp = found[0].stamp if found else None
    return Poses(stamp, found[0].frame if found else "", np.empty((0, 3)), tuple(found))


def _marker(cdr: Cdr, definition: str) -> Marker:
    stamp, frame = cdr.header()
    space = cdr.text()
    number, kind, action = map(int, cdr.numbers("iii"))
    place = cdr.pose()
    cdr.skip("d", 3)  # scale
    cdr.skip("f", 4)  # colour
    cdr.skip("i", 2)  # lifetime
    cdr.skip("B", 1)
    points = cdr.doubles(3 * _few(cdr.length())).reshape(-1, 3)
    cdr.skip("f", 4 * _few(cdr.length()))
    if "texture_resource" in definition:
        cdr.text()
        cdr.header()
        cdr.text()
        cdr.skip("B", cdr.length())
        cdr.skip("f", 2 * _few(cdr.length()))
    text = cdr.text()
    cdr.text()
    if "mesh_file" in definition:
        cdr.text()
        cdr.skip("B", cdr.length())
    cdr.skip("B", 1)
    return Marker(stamp, frame, space, number, kind, action, place, points, text)


def transforms(cdr: Cdr) -> Message:
    """A TFMessage."""
    return Transforms(tuple(_transform(cdr) for _ in range(_few(cdr.length()))))


def transform(cdr: Cdr) -> Message:
    """A TransformStamped."""
    return Transforms((_transform(cdr),))


def _transform(cdr: Cdr) -> Transform:
    stamp, parent = cdr.header()
    child = cdr.text()
    return Transform(stamp, parent, child, cdr.pose())


def _few(count: int) -> int:
    if count > _MOST:
        raise ValueError(f"{count} elements in a list")
    return count
