"""Foxglove's messages of poses and frames, in Protobuf and in JSON."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Items
from typing import Any

import msgspec
import numpy as np

from handtrack.sequences.readers.message_rows import MALFORMED, Ints, NoMessageError, Rows
from handtrack.sequences.readers.protobuf_rows import class_of, fields_of, parsed
from handtrack.sequences.readers.robot_messages import (
    Array,
    Message,
    Poses,
    StampError,
    Transform,
    Transforms,
    or_none,
    stamps,
)

POSES = ("foxglove.PosesInFrame", "foxglove.PoseArray", "foxglove.PoseInFrame")
TRANSFORMS = ("foxglove.FrameTransforms", "foxglove.FrameTransform")
SCHEMAS = (*POSES, *TRANSFORMS)
_SECONDS_MOST = 9_223_372_035
_XYZ, _XYZW = ("x", "y", "z"), ("x", "y", "z", "w")


def protobuf(rows: Rows, name: str, schema: bytes) -> Message:
    """Messages of one layout, by the schema that their file holds.

    Raises:
        ValueError, TypeError, KeyError: it is none.
    """
    made = class_of(name, schema)
    exact = _of_fields(parsed(rows.first, made), name, 1)
    try:
        found = _of_fields(fields_of(rows, made), name, len(rows))
    except StampError:
        raise
    except ValueError:
        found = None
    if found is None or not _same(exact, found):
        rows.fix()  # only those that are the same in every byte are read with it
        found = _of_fields(parsed(rows.first, made), name, len(rows))
    return found


def _same(exact: Message, found: Message) -> bool:
    """Whether one message is the first of some."""
    if isinstance(exact, Transforms) or isinstance(found, Transforms):
        if not isinstance(exact, Transforms) or not isinstance(found, Transforms):
            return False
        pairs = list(zip(exact.transforms, found.transforms, strict=False))
        return len(exact.transforms) == len(found.transforms) and all(
            (a.parent, a.child) == (b.parent, b.child)
            and a.stamp[0] == b.stamp[0]
            and a.pose[0].tobytes() == b.pose[0].tobytes()
            for a, b in pairs
        )
    alike = exact.frame == found.frame and exact.stamp[0] == found.stamp[0]
    return alike and exact.places[0].tobytes() == found.places[0].tobytes()


def _of_fields(made: Any, name: str, n: int) -> Message:
    """What fields say, that are numbers of one message or (n,) of some."""
    if name in TRANSFORMS:
        several = made.transforms if name == TRANSFORMS[0] else [made]
        return Transforms(tuple(_transform(t, n) for t in several))
    poses = [made.pose] if name.endswith("PoseInFrame") else made.poses
    places = np.empty((n, len(poses), 3))
    for i, pose in enumerate(poses):
        _put(places[:, i], pose.position, _XYZ)
    return Poses(or_none(_stamp(made.timestamp, n)), made.frame_id, places)


def _transform(given: Any, n: int) -> Transform:
    pose = np.empty((n, 7))
    _put(pose[:, :3], given.translation, _XYZ)
    _put(pose[:, 3:], given.rotation, _XYZW)
    stamp = _stamp(given.timestamp, n)
    return Transform(stamp, given.parent_frame_id, given.child_frame_id, _turned(pose))


def _put(out: Array, given: Any, axes: Items[str]) -> None:
    for i, axis in enumerate(axes):
        out[:, i] = getattr(given, axis)


def _stamp(given: Any, n: int) -> Ints:
    seconds = np.broadcast_to(np.asarray(given.seconds, np.int64), n)
    if ((seconds > _SECONDS_MOST) | (seconds < -_SECONDS_MOST)).any():
        raise StampError("its stamp is beyond 64 bits")
    return seconds * 10**9 + np.asarray(given.nanos, np.int64)


def _turned(pose: Array) -> Array:
    """Poses whose rotation, where it is left out, is none."""
    pose[~pose[:, 3:].any(1), 6] = 1.0
    return pose


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


def json(messages: Items[bytes], name: str) -> Iterator[tuple[Ints, Message]]:
    """Messages in groups of as many poses, or of the same frames; as `by_layout`.

    Raises:
        NoMessageError: one cannot be read.
    """
    read = _json_frames if name in TRANSFORMS else _json_poses
    kind = {TRANSFORMS[0]: _Frames, TRANSFORMS[1]: _Frame}.get(name, _Poses)
    decoder = msgspec.json.Decoder(kind)
    alike: dict[Any, list[tuple[int, Any]]] = {}
    for i, message in enumerate(messages):
        try:
            said = decoder.decode(message)
            if isinstance(said, _Poses):
                poses = said.poses if said.pose is None else [said.pose]
                stamp = _json_stamp(said.timestamp)
                alike.setdefault((said.frame_id, len(poses)), []).append((i, (stamp, poses)))
                continue
            frames = said.transforms if isinstance(said, _Frames) else [said]
            own = [(_json_stamp(f.timestamp), f) for f in frames]
        except MALFORMED as error:
            raise NoMessageError(i, str(error)) from None
        names = tuple((f.parent_frame_id, f.child_frame_id) for f in frames)
        alike.setdefault(names, []).append((i, own))
    for key, of in alike.items():
        yield np.array([i for i, _ in of]), read(key, [one for _, one in of])


def _json_stamp(time: _Time) -> int:
    stamp = time.sec * 10**9 + time.nsec
    stamps(stamp)
    return stamp


def _json_poses(key: tuple[str, int], of: list[tuple[int, list[_Pose]]]) -> Message:
    frame, count = key
    flat = [v for _, ps in of for p in ps for v in (p.position.x, p.position.y, p.position.z)]
    places = np.array(flat, np.float64).reshape(len(of), count, 3)
    return Poses(or_none(stamps(*(stamp for stamp, _ in of))), frame, places)


def _json_frames(key: tuple[tuple[str, str], ...], of: list[list[tuple[int, _Frame]]]) -> Message:
    transforms = []
    for j, (parent, child) in enumerate(key):
        own = [row[j] for row in of]
        poses = [
            (*msgspec.structs.astuple(f.translation), *msgspec.structs.astuple(f.rotation))
            for _, f in own
        ]
        stamp = stamps(*(stamp for stamp, _ in own))
        pose = _turned(np.array(poses, np.float64).reshape(-1, 7))
        transforms.append(Transform(stamp, parent, child, pose))
    return Transforms(tuple(transforms))
