"""Foxglove's PosesInFrame and FrameTransforms, in Protobuf and in JSON."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import msgspec
import numpy as np

from handtrack.sequences.readers.robot_messages import (
    Array,
    Message,
    Poses,
    Transform,
    Transforms,
)

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
