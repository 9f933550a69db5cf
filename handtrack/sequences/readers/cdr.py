"""CDR, ROS 2's encoding of messages, and ROS 1's: those that carry hands.

geometry_msgs/msg/PoseArray, PoseStamped, PoseWithCovarianceStamped, PointStamped
foxglove_msgs/msg/PosesInFrame
visualization_msgs/msg/MarkerArray, visualization_msgs/msg/Marker
tf2_msgs/msg/TFMessage, geometry_msgs/msg/TransformStamped
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.readers.message_rows import Ints, Rows
from handtrack.sequences.readers.robot_messages import (
    Array,
    Marker,
    Message,
    Poses,
    Transform,
    Transforms,
    marked,
)

_MOST = 100_000
"""Poses, markers or points of a message."""


_SIZES = {kind: struct.calcsize(kind) for kind in "BiIfd"}


class Cdr:
    """Reads values one after the other; numbers lie at multiples of their size.

    Args:
        rows: messages of one layout, with CDR's four bytes before each.
        packed: they are ROS 1's: without them, numbers close together, headers with a number
            first.

    Raises:
        ValueError: no CDR, or a length that cannot be.
        struct.error: the message is too short.
    """

    def __init__(self, rows: Rows, packed: bool = False) -> None:
        self._rows, self._packed, self._first = rows, packed, rows.first
        if packed:
            self._at, self._order = 0, "<"
            return
        if len(self._first) < 4 or self._first[0] != 0 or self._first[1] not in (0, 1):
            raise ValueError("not in plain CDR")
        rows.free(2, 4)
        self._at, self._order = 4, "<>"[1 - self._first[1]]

    def __len__(self) -> int:
        return len(self._rows)

    def number(self, kind: str) -> int:
        """One number that is the same in all, by its letter of `struct`."""
        self._align(_SIZES[kind])
        (found,) = struct.unpack_from(self._order + kind, self._first, self._at)
        self._at += _SIZES[kind]
        return int(found)

    def doubles(self, count: int) -> Array:
        """(n, count) of 8 bytes each."""
        return self._numbers("f8", count).astype(np.float64)

    def _numbers(self, kind: str, count: int = 1) -> NDArray[Any]:
        size = int(kind[1:])
        if count:
            self._align(size)
        found = self._rows.numbers(self._at, self._order + kind, count)
        self._at += size * count
        return found

    def skip(self, kind: str, count: int) -> None:
        """Pass over numbers."""
        self._align(_SIZES[kind])
        end = self._at + _SIZES[kind] * count
        self._rows.free(self._at, end)
        self._at = end

    def _align(self, size: int) -> None:
        end = self._at + (0 if self._packed else -(self._at - 4) % size)
        self._rows.free(self._at, end)
        self._at = end

    def length(self) -> int:
        """How many come."""
        count = self.number("I")
        if count > len(self._first) - self._at:
            raise ValueError(f"{count} elements in {len(self._first)} bytes")
        return count

    def text(self) -> str:
        """A string."""
        size = self.length()
        found = self._first[self._at : self._at + size]
        self._at += size
        return found.rstrip(b"\0").decode("utf-8", "replace")

    def header(self) -> tuple[Ints, str]:
        """The stamps [ns], and the frame."""
        if self._packed:
            self.skip("I", 1)
        return self.time(), self.text()

    def time(self) -> Ints:
        """(n,) stamps [ns]."""
        seconds, rest = self._numbers("i4")[:, 0], self._numbers("u4")[:, 0]
        return seconds.astype(np.int64) * 10**9 + rest.astype(np.int64)

    def pose(self) -> Array:
        """(n, 7) x y z, and the quaternion x y z w."""
        return self.doubles(7)

    def places(self) -> Array:
        """(n, k, 3) of a list of poses."""
        return self.doubles(7 * _few(self.length())).reshape(len(self), -1, 7)[:, :, :3]


def poses(cdr: Cdr) -> Message:
    """A PoseArray, or Foxglove's PosesInFrame."""
    stamp, frame = cdr.header()
    return Poses(stamp, frame, cdr.places())


def placed(cdr: Cdr) -> Message:
    """A PoseStamped, with covariance or without, or a PointStamped."""
    stamp, frame = cdr.header()
    return Poses(stamp, frame, cdr.doubles(3)[:, None])


def posed(cdr: Cdr) -> Message:
    """Foxglove's PosesInFrame, whose time is no header."""
    stamp, frame = cdr.time(), cdr.text()
    return Poses(stamp, frame, cdr.places())


def markers(cdr: Cdr, definition: str) -> Message:
    """A MarkerArray; its definition tells which fields there are."""
    return marked([_marker(cdr, definition) for _ in range(_few(cdr.length()))], len(cdr))


def marker(cdr: Cdr, definition: str) -> Message:
    """A Marker alone."""
    return marked([_marker(cdr, definition)], len(cdr))


def _marker(cdr: Cdr, definition: str) -> Marker:
    stamp, frame = cdr.header()
    space = cdr.text()
    number, kind, action = cdr.number("i"), cdr.number("i"), cdr.number("i")
    place = cdr.pose()
    cdr.skip("d", 3)  # scale
    cdr.skip("f", 4)  # colour
    cdr.skip("i", 2)  # lifetime
    cdr.skip("B", 1)
    points = cdr.doubles(3 * _few(cdr.length())).reshape(len(cdr), -1, 3)
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
