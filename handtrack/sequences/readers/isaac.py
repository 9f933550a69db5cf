"""IsaacTeleop's hands: FlatBuffers of 26 OpenXR joints (src/core/schema/fbs/hand.fbs).

    table HandPoseRecord { data: HandPose; timestamp: struct of int64 }
    table HandPose { joints: struct of 26 x { x y z  qx qy qz qw (float), is_valid, radius } }

One hand a channel, `hands/left_hand` and `hands/right_hand`; a record without data is a frame in
which the hand was not seen.
"""

from __future__ import annotations

import struct

import numpy as np

from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.robot_messages import Message, Poses

SCHEMA = "core.HandPoseRecord"
_JOINT = np.dtype(
    [("place", "<f4", 3), ("turn", "<f4", 4), ("valid", "u1"), ("_", "u1", 3), ("radius", "<f4")]
)
_JOINTS = 26
_DATA, _TIME = 0, 1


def hand_pose(data: bytes) -> Message:
    """A record's joints.

    Raises:
        ValueError, struct.error: it is none.
    """
    root = _offset(data, 0)
    at = _field(data, root, _TIME)
    # when it was sampled, on the clock that all devices share; 0 where nobody said
    stamp = None if at is None else struct.unpack_from("<qq", data, at)[1]
    pose = _field(data, root, _DATA)
    places = np.full((_JOINTS, 3), np.nan)
    if pose is not None:
        joints = _field(data, _offset(data, pose), 0)
        if joints is not None:
            if joints + _JOINTS * _JOINT.itemsize > len(data):
                raise ValueError("26 joints do not fit in it")
            found = np.frombuffer(data, _JOINT, _JOINTS, joints)
            places = np.where(found["valid"][:, None] != 0, found["place"], np.nan)
    with np.errstate(invalid="ignore"):  # damaged numbers may be NaN that signal
        return Poses(stamp or None, "", places.astype(np.float64))


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
