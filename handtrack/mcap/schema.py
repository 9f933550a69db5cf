"""The schemas of the messages in our MCAP files.

`handtrack.proto` and `foxglove.proto` say what they are; `schemas.binpb` is the two, compiled:

    cd handtrack/mcap
    python -m grpc_tools.protoc -I. --include_imports --descriptor_set_out=schemas.binpb \\
        handtrack.proto foxglove.proto

Message classes are made from it at run time, so that any protobuf runtime can be used:
generated modules work only with the runtimes that their compiler knows.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool

JOINT_STATE_NAME = "sensor_msgs/msg/JointState"
JOINT_STATE_ROS2 = """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
"""ROS 2's definition of a JointState with what it refers to."""


ROS2_DEFINITIONS = {JOINT_STATE_NAME: JOINT_STATE_ROS2, "std_msgs/msg/String": "string data\n"}
"""Of the messages that are ROS 2's, in CDR; all others are protobuf."""

HAND_SCHEMAS = {
    "model": "handtrack.Hand",
    "state": "handtrack.State",
    "event": "handtrack.Event",
    "observed": "foxglove.PointCloud",
    "fitted": "foxglove.PointCloud",
    "mesh": "foxglove.PointCloud",
    "skin": "foxglove.SceneUpdate",
    "transforms": "foxglove.FrameTransforms",
    "joint_states": JOINT_STATE_NAME,
    "robot_description": "std_msgs/msg/String",
    "log": "foxglove.Log",
}
"""Of each topic of a hand."""


@cache
def _compiled() -> FileDescriptorSet:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    data = (files("handtrack.mcap") / "schemas.binpb").read_bytes()
    return FileDescriptorSet.FromString(data)


@cache
def _pool() -> DescriptorPool:
    from google.protobuf.descriptor_pool import DescriptorPool

    pool = DescriptorPool()
    for file in _compiled().file:
        pool.AddSerializedFile(file.SerializeToString())
    return pool


@cache
def message_class(name: str) -> Any:
    """The class of a message by its full name, such as "handtrack.State"."""
    from google.protobuf.message_factory import GetMessageClass

    return GetMessageClass(_pool().FindMessageTypeByName(name))


@cache
def array_class(name: str) -> Any:
    """As `message_class`, but `repeated double` fields are `bytes` of little-endian doubles.

    The two are the same on the wire, and bytes become arrays without a Python float each.
    """
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    source = _pool().FindMessageTypeByName(name).file
    file = FileDescriptorProto()
    source.CopyToProto(file)
    for message in file.message_type:
        for field in message.field:
            repeated = field.label == FieldDescriptorProto.LABEL_REPEATED
            if repeated and field.type == FieldDescriptorProto.TYPE_DOUBLE:
                field.label = FieldDescriptorProto.LABEL_OPTIONAL
                field.type = FieldDescriptorProto.TYPE_BYTES
    pool = DescriptorPool()
    pool.AddSerializedFile(file.SerializeToString())
    return GetMessageClass(pool.FindMessageTypeByName(name))


@cache
def descriptor_set(name: str) -> bytes:
    """What an MCAP schema record holds for a message: its file and all that this imports."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    by_name = {file.name: file for file in _compiled().file}
    wanted: list[str] = []

    def add(file_name: str) -> None:
        for dependency in by_name[file_name].dependency:
            add(dependency)
        if file_name not in wanted:
            wanted.append(file_name)

    add(_pool().FindMessageTypeByName(name).file.name)
    return FileDescriptorSet(file=[by_name[n] for n in wanted]).SerializeToString()
