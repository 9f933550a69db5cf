"""What robots' messages say of hands, whatever encoding they come in.

Foxglove's in Protobuf and JSON; IsaacTeleop's FlatBuffers of 26 OpenXR joints
(src/core/schema/fbs/hand.fbs).
"""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.sequences.readers.catalogue import Format

Array = NDArray[np.float64]


class Marker(NamedTuple):
    """A visualization_msgs/Marker.

    Attributes:
        stamp: [ns].
        frame: that its pose is in.
        space: its namespace.
        number: its id there.
        kind: its type (2: a sphere, 7: a list of spheres, 8: points ...).
        action: 0: shown, 2 and 3: taken away.
        pose: (7,) x y z, quaternion x y z w.
        points: (n, 3) in the pose's frame.
        text: what stands on it.
    """

    stamp: int
    frame: str
    space: str
    number: int
    kind: int
    action: int
    pose: Array
    points: Array
    text: str


class Poses(NamedTuple):
    """A list of places.

    Attributes:
        stamp: [ns]; None: the message has none.
        frame: that they are in.
        places: (n, 3) [m], NaN = missing.
        markers: the same as markers, with names.
    """

    stamp: int | None
    frame: str
    places: Array
    markers: tuple[Marker, ...] = ()


class Transform(NamedTuple):
    """Where a frame is in another.

    Attributes:
        stamp: [ns].
        parent, child: names of the frames.
        pose: (7,) x y z, quaternion x y z w.
    """

    stamp: int
    parent: str
    child: str
    pose: Array


class Transforms(NamedTuple):
    """Frames, as TF has them."""

    transforms: tuple[Transform, ...]


Message = Poses | Transforms


def turn_of(pose: Array) -> Array:
    """(3, 3) the rotation of a pose: x y z, then quaternion x y z w of any length; NaN where
    that is none."""
    return np.asarray(turns_of(pose[None])[0])


def turns_of(poses: Array) -> Array:
    """(n, 3, 3) of poses (n, 7), as `turn_of`."""
    largest = np.abs(poses[:, 3:]).max(1)
    usable = (largest > 0) & (largest < np.inf)
    out = np.full((len(poses), 3, 3), np.nan)
    scaled = poses[usable, 3:] / largest[usable, None]
    out[usable] = quaternion_to_matrix(scaled[:, [3, 0, 1, 2]])
    return out


POSES = ("foxglove.PosesInFrame", "foxglove.PoseArray", "foxglove.PoseInFrame")
TRANSFORMS = ("foxglove.FrameTransforms", "foxglove.FrameTransform")
SCHEMAS = (*POSES, *TRANSFORMS)


def protobuf(data: bytes, name: str, schema: bytes) -> Message:
    """A message, by the schema that its file holds.

    Raises:
        ValueError, TypeError, KeyError: it is none.
    """
    from google.protobuf.message import DecodeError

    made = _class(name, schema)()
    try:
        made.ParseFromString(data)
    except DecodeError as error:
        raise ValueError(str(error)) from None
    if name in TRANSFORMS:
        several = made.transforms if name == TRANSFORMS[0] else [made]
        return Transforms(tuple(_transform(t) for t in several))
    poses = [made.pose] if name.endswith("PoseInFrame") else made.poses
    places = [(p.position.x, p.position.y, p.position.z) for p in poses]
    stamp = made.timestamp.seconds * 10**9 + made.timestamp.nanos
    return Poses(stamp or None, made.frame_id, np.array(places, np.float64).reshape(-1, 3))


def _transform(given: Any) -> Transform:
    t, r = given.translation, given.rotation
    stamp = given.timestamp.seconds * 10**9 + given.timestamp.nanos
    pose = np.array([t.x, t.y, t.z, r.x, r.y, r.z, r.w])
    return Transform(stamp, given.parent_frame_id, given.child_frame_id, _turned(pose))


@lru_cache(8)
def _class(name: str, schema: bytes) -> Any:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message import DecodeError
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    try:
        files = FileDescriptorSet.FromString(schema).file
    except DecodeError as error:
        raise ValueError(f"its schema is damaged: {error}") from None
    for file in files:
        pool.AddSerializedFile(file.SerializeToString())
    return GetMessageClass(pool.FindMessageTypeByName(name))


class _Time(msgspec.Struct):
    sec: int = 0
    nsec: int = 0


class _Place(msgspec.Struct):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class _Turn(msgspec.Struct):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 0.0


class _Pose(msgspec.Struct):
    position: _Place = msgspec.field(default_factory=_Place)


class _Frame(msgspec.Struct):
    timestamp: _Time = msgspec.field(default_factory=_Time)
    parent_frame_id: str = ""
    child_frame_id: str = ""
    translation: _Place = msgspec.field(default_factory=_Place)
    rotation: _Turn = msgspec.field(default_factory=_Turn)


class _Frames(msgspec.Struct):
    transforms: list[_Frame] = []


class _Poses(msgspec.Struct):
    timestamp: _Time = msgspec.field(default_factory=_Time)
    frame_id: str = ""
    poses: list[_Pose] = []
    pose: _Pose | None = None


def json(data: bytes, name: str) -> Message:
    """A message.

    Raises:
        msgspec.DecodeError: it is none (a ValueError).
    """
    if name in TRANSFORMS:
        one = name == TRANSFORMS[1]
        frames = (
            [msgspec.json.decode(data, type=_Frame)]
            if one
            else msgspec.json.decode(data, type=_Frames).transforms
        )
        return Transforms(
            tuple(
                Transform(
                    f.timestamp.sec * 10**9 + f.timestamp.nsec,
                    f.parent_frame_id,
                    f.child_frame_id,
                    _turned(
                        np.array(
                            [
                                *msgspec.structs.astuple(f.translation),
                                *msgspec.structs.astuple(f.rotation),
                            ]
                        )
                    ),
                )
                for f in frames
            )
        )
    said = msgspec.json.decode(data, type=_Poses)
    poses = said.poses if said.pose is None else [said.pose]
    places = np.array([msgspec.structs.astuple(p.position) for p in poses], np.float64)
    stamp = said.timestamp.sec * 10**9 + said.timestamp.nsec
    return Poses(stamp or None, said.frame_id, places.reshape(-1, 3))


def _turned(pose: Array) -> Array:
    """A pose whose rotation, where it is left out, is none."""
    return pose if pose[3:].any() else np.array([*pose[:3], 0.0, 0.0, 0.0, 1.0])


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
