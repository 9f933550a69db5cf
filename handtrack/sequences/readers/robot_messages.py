"""What robots' messages say of hands.

Whatever encoding they come in; IsaacTeleop's FlatBuffers of 26 OpenXR joints
(src/core/schema/fbs/hand.fbs).
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.message_rows import Ints, Rows

Array = NDArray[np.float64]
UNSTAMPED = np.iinfo(np.int64).min
"""The stamp of a message that has none."""


class StampError(ValueError):
    """A stamp beyond 64 bits."""


def stamps(*given: int) -> Ints:
    """(n,) stamps [ns].

    Raises:
        StampError: one is beyond 64 bits.
    """
    if any(abs(stamp) > -(UNSTAMPED + 1) for stamp in given):
        raise StampError("its stamp is beyond 64 bits")
    return np.array(given, np.int64)


def or_none(own: Ints) -> Ints:
    """The same, where 0 is none."""
    return np.where(own == 0, UNSTAMPED, own)


class Marker(NamedTuple):
    """A visualization_msgs/Marker in n messages of one layout.

    Attributes:
        stamp: (n,) [ns].
        frame: that its pose is in.
        space: its namespace.
        number: its id there.
        kind: its type (2: a sphere, 7: a list of spheres, 8: points ...).
        action: 0: shown, 2 and 3: taken away.
        pose: (n, 7) x y z, quaternion x y z w.
        points: (n, k, 3) in the pose's frame.
        text: what stands on it.
    """

    stamp: Ints
    frame: str
    space: str
    number: int
    kind: int
    action: int
    pose: Array
    points: Array
    text: str


class Poses(NamedTuple):
    """A list of places in n messages of one layout.

    Attributes:
        stamp: (n,) [ns]; UNSTAMPED: the message has none.
        frame: that they are in.
        places: (n, k, 3) [m], NaN = missing.
        markers: the same as markers, with names.
    """

    stamp: Ints
    frame: str
    places: Array
    markers: tuple[Marker, ...] = ()


class Transform(NamedTuple):
    """Where a frame is in another, in n messages of one layout.

    Attributes:
        stamp: (n,) [ns].
        parent, child: names of the frames.
        pose: (n, 7) x y z, quaternion x y z w.
    """

    stamp: Ints
    parent: str
    child: str
    pose: Array


class Transforms(NamedTuple):
    """Frames, as TF has them."""

    transforms: tuple[Transform, ...]


Message = Poses | Transforms


def marked(found: list[Marker], n: int) -> Poses:
    """The markers of n messages."""
    stamp = found[0].stamp if found else np.full(n, UNSTAMPED)
    frame = found[0].frame if found else ""
    return Poses(stamp, frame, np.empty((n, 0, 3)), tuple(found))


def turns_of(poses: Array) -> Array:
    """(n, 3, 3) the rotations of poses (n, 7): x y z, then quaternion x y z w of any length; NaN
    where that is none."""
    usable = turnable(poses)
    largest = np.abs(poses[:, 3:]).max(1)
    out = np.full((len(poses), 3, 3), np.nan)
    scaled = poses[usable, 3:] / largest[usable, None]
    out[usable] = quaternion_to_matrix(scaled[:, [3, 0, 1, 2]])
    return out


def turnable(poses: Array) -> NDArray[np.bool_]:
    """(n,) whether poses (n, 7) have a rotation."""
    largest = np.abs(poses[:, 3:]).max(1)
    return np.asarray((largest > 0) & (largest < np.inf))


SCHEMA = "core.HandPoseRecord"
_JOINT = np.dtype(
    [("place", "<f4", 3), ("turn", "<f4", 4), ("valid", "u1"), ("_", "u1", 3), ("radius", "<f4")]
)
_JOINTS = 26
_DATA, _TIME = 0, 1
_TIMES = 24  # bytes of a time on three clocks


def hand_pose(rows: Rows) -> Message:
    """The joints of records of one layout.

    Raises:
        ValueError, struct.error: it is none.
    """
    data = rows.first
    root = _offset(data, 0)
    at = _field(data, root, _TIME)
    # when it was sampled, on the clock that all devices share; 0 where nobody said
    stamp = np.zeros(len(rows), np.int64)
    if at is not None:
        stamp = rows.numbers(at, "<i8", 2)[:, 1]
        rows.free(at, min(at + _TIMES, len(data)))
    pose = _field(data, root, _DATA)
    places = np.full((len(rows), _JOINTS, 3), np.nan)
    if pose is not None:
        joints = _field(data, _offset(data, pose), 0)
        if joints is not None:
            if joints + _JOINTS * _JOINT.itemsize > len(data):
                raise ValueError("26 joints do not fit in it")
            found = rows.numbers(joints, "u1", _JOINTS * _JOINT.itemsize).view(_JOINT)
            with np.errstate(invalid="ignore"):  # damaged numbers may be NaN that signal
                places[:] = found["place"]
            places[found["valid"] == 0] = np.nan
    return Poses(or_none(stamp), "", places)


def _offset(data: bytes, at: int) -> int:
    """Where the table or vector is that an offset leads to."""
    (step,) = struct.unpack_from("<I", data, at)
    if at + step + 4 > len(data):
        raise ValueError("an offset leads out of the message")
    return int(at + step)


def _field(data: bytes, table: int, number: int) -> int | None:
    """Where a table's field is; None where it has none."""
    (back,) = struct.unpack_from("<i", data, table)
    fields = table - back
    if fields < 0:
        raise ValueError("a table's fields lie out of the message")
    (size,) = struct.unpack_from("<H", data, fields)
    entry = 4 + 2 * number
    if entry + 2 > size:
        return None
    (step,) = struct.unpack_from("<H", data, fields + entry)
    return table + step if step else None


FORMATS = (
    Format(
        "IsaacTeleop",
        "MCAP with FlatBuffers `core.HandPoseRecord`, `hands/left_hand` and `hands/right_hand`",
        "openxr",
        "m",
        "both",
        "name of the schema",
    ),
)
