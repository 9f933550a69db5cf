"""Robots' logs of hands, made by encoders of their own: CDR, FlatBuffers, Protobuf, ROS bags."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

from handtrack.mcap.schema import descriptor_set, message_class

START = 1_782_897_167_604_809_000
STEP = 33_333_333

HUMBLE = b"""# as in ROS 2 Humble
string texture_resource
sensor_msgs/CompressedImage texture
UVCoordinate[] uv_coordinates
string text
string mesh_resource
MeshFile mesh_file
"""


class CdrOut:
    """Writes little-endian CDR."""

    def __init__(self) -> None:
        self.data = bytearray(b"\0\1\0\0")

    def put(self, kind: str, *values: float) -> CdrOut:
        size = struct.calcsize(kind)
        for value in values:
            self.data += bytes(-(len(self.data) - 4) % size) + struct.pack("<" + kind, value)
        return self

    def text(self, value: str) -> CdrOut:
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self.data += data
        return self

    def header(self, time: int, frame: str) -> CdrOut:
        return self.put("i", time // 10**9).put("I", time % 10**9).text(frame)

    def pose(self, place: Any, turn: Any = (0, 0, 0, 1)) -> CdrOut:
        return self.put("d", *map(float, place), *map(float, turn))


def pose_array(time: int, places: np.ndarray, frame: str = "world") -> bytes:
    out = CdrOut().header(time, frame).put("I", len(places))
    for place in places:
        out.pose(place)
    return bytes(out.data)


def marker_array(
    time: int, named: list[tuple[str, int, Any]], texts: list[str] | None = None, new: bool = True
) -> bytes:
    """Spheres of (namespace, id, place), in the fields of Humble (new) or Foxy."""
    out = CdrOut().put("I", len(named))
    for i, (space, number, place) in enumerate(named):
        out.header(time, "map").text(space).put("i", number, 2, 0).pose(place)
        out.put("d", 0.01, 0.01, 0.01).put("f", 1, 0, 0, 1).put("i", 0).put("I", 0).put("B", 0)
        out.put("I", 0).put("I", 0)
        if new:
            out.text("").header(0, "").text("").put("I", 0).put("I", 0)
        out.text(texts[i] if texts else "").text("")
        if new:
            out.text("").put("I", 0)
        out.put("B", 0)
    return bytes(out.data)


def tf_message(time: int, frames: list[tuple[str, str, Any, Any]]) -> bytes:
    """Transforms of (parent, child, place, quaternion xyzw)."""
    out = CdrOut().put("I", len(frames))
    for parent, child, place, turn in frames:
        out.header(time, parent).text(child).pose(place, turn)
    return bytes(out.data)


def isaac_record(time: int, places: np.ndarray | None) -> bytes:
    """A HandPoseRecord as flatc's builders lay it out, by the flatbuffers package."""
    import flatbuffers

    builder = flatbuffers.Builder(2048)
    pose = None
    if places is not None:
        builder.StartObject(1)
        builder.Prep(4, 26 * 36)
        for place in places[::-1]:
            valid = bool(np.isfinite(place).all())
            builder.Prep(4, 36)
            builder.PrependFloat32(0.01)
            builder.Pad(3)
            builder.PrependBool(valid)
            for value in (1.0, 0.0, 0.0, 0.0):  # w z y x
                builder.PrependFloat32(value)
            for value in np.nan_to_num(place)[::-1]:
                builder.PrependFloat32(float(value))
        builder.PrependStructSlot(0, builder.Offset(), 0)
        pose = builder.EndObject()
    builder.StartObject(2)
    if pose is not None:
        builder.PrependUOffsetTRelativeSlot(0, pose, 0)
    builder.Prep(8, 24)
    for value in (time - 7_000, time, time + 500):  # from the last to the first
        builder.PrependInt64(value)
    builder.PrependStructSlot(1, builder.Offset(), 0)
    builder.Finish(builder.EndObject())
    return bytes(builder.Output())


def foxglove_frames(time: int, frames: list[tuple[str, str, Any, Any]]) -> bytes:
    made = message_class("foxglove.FrameTransforms")()
    for parent, child, place, turn in frames:
        one = made.transforms.add(parent_frame_id=parent, child_frame_id=child)
        one.timestamp.seconds, one.timestamp.nanos = divmod(time, 10**9)
        one.translation.x, one.translation.y, one.translation.z = map(float, place)
        one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w = map(float, turn)
    return bytes(made.SerializeToString())


def foxglove_poses_json(time: int, places: np.ndarray) -> bytes:
    poses = [{"position": dict(zip("xyz", map(float, p), strict=True))} for p in places]
    stamp = {"sec": time // 10**9, "nsec": time % 10**9}
    return json.dumps({"timestamp": stamp, "frame_id": "world", "poses": poses}).encode()


Topics = dict[str, tuple[str, str, str, bytes, Callable[[int, int], bytes]]]
"""Topic: schema, its encoding, the messages' encoding, its text, and a message of (time, i)."""


def write_log(path: Path, topics: Topics, frames: int) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels = {}
        for topic, (schema, language, encoding, text, _) in topics.items():
            number = writer.register_schema(schema, language, text)
            channels[topic] = writer.register_channel(topic, encoding, number)
        for i in range(frames):
            time = START + i * STEP
            for topic, (*_, message) in topics.items():
                writer.add_message(channels[topic], time + 3_000_000, message(time, i), time)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def protobuf(name: str) -> bytes:
    return descriptor_set(name)
