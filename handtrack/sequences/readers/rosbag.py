"""ROS bags: a folder of ROS 2 with metadata.yaml, or ROS 1's .bag, read by `rosbags`."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from handtrack.errors import InputError, shown
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.raw import NotJointsError, Raw
from handtrack.sequences.readers.robot_logs import Channel, RobotLog, understood

BAG_MAGIC = b"#ROSBAG V2.0\n"
SQLITE_MAGIC = b"SQLite format 3\0"
METADATA = "metadata.yaml"
BAG_MARK = b"rosbag2_bagfile_information"
_ROS1 = "ros1"


def is_bag_file(head: bytes, path: Path) -> bool:
    """Whether a file that begins so is a bag or part of one."""
    return head.startswith((BAG_MAGIC, SQLITE_MAGIC)) or BAG_MARK in head


def is_bag(folder: Path) -> bool:
    """Whether a folder is a bag of ROS 2."""
    try:
        with (folder / METADATA).open("rb") as file:
            return BAG_MARK in file.read(512)
    except OSError:
        return False


def read_bag(path: Path) -> list[Raw]:
    """The hands in a bag.

    Args:
        path: a folder, a .bag, or a file of a folder: its metadata.yaml or a .db3.

    Raises:
        NotJointsError: no topic of hands.
        InputError: rosbags is not installed, or the bag is damaged.
    """
    where = path
    if path.is_file() and not _is_ros1(path):
        where = path.parent
        if not is_bag(where):
            raise InputError(
                f"a ROS 2 bag is a folder: its {METADATA} is not beside this file"
                " ('ros2 bag reindex' makes it anew)",
                path,
            )
    if path.name == METADATA:
        path = where
    log = RobotLog(path)
    ros1 = where.is_file()
    with _opened(where) as reader:
        wanted = [c for c in reader.connections if understood(c.msgtype, "cdr") and c.msgcount != 0]
        if not wanted:
            there = shown(", ".join(f"{c.topic} ({c.msgtype})" for c in reader.connections[:6]))
            raise NotJointsError(f"no topic that may hold hands, there are {there}", path)
        channels: dict[int, Channel] = {}
        for connection, time, raw in reader.messages(connections=wanted):
            if connection.id not in channels:
                encoding, definition = _ROS1 if ros1 else "cdr", _definition(connection)
                about = connection.topic, connection.msgtype, encoding, definition
                channels[connection.id] = log.channel(*about)
            channels[connection.id].add(time, bytes(raw))
    return log.check()


def _is_ros1(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(BAG_MAGIC)) == BAG_MAGIC


def _definition(connection: Any) -> bytes:
    """The text of a type; of bags that do not hold it that of today's ROS 2."""
    text = getattr(connection.msgdef, "data", "") or ""
    return (text or "texture_resource mesh_file").encode()


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag1 import ReaderError as Ros1Error
        from rosbags.rosbag2 import ReaderError as Ros2Error
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(
            'ROS bags need the package rosbags: pip install "handtrack[formats]"', path
        ) from None
    try:
        store = get_typestore(Stores.ROS2_JAZZY if path.is_dir() else Stores.ROS1_NOETIC)
        with AnyReader([path], default_typestore=store) as reader:
            yield reader
    except InputError:
        raise
    except (
        *(AnyReaderError, Ros1Error, Ros2Error, SerdeError, sqlite3.Error, struct.error),
        *(OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, RuntimeError),
        *(AssertionError, OverflowError, MemoryError, zlib.error),
    ) as error:
        raise InputError(f"the bag is damaged ({shown(str(error), 120)})", path) from None


FORMATS = (
    Format(
        "ROS 2 and Foxglove logs",
        "MCAP with `geometry_msgs/PoseArray`, `visualization_msgs/MarkerArray`, TF of frames named"
        " as joints, `foxglove.PosesInFrame` or `FrameTransforms`; a topic, or names, for each"
        " hand; a topic of `PoseStamped` or `PointStamped` for each joint; ROS 2 bags (folders with"
        " metadata.yaml) and ROS 1's .bag; rosbridge's JSON of the same",
        "by their number or by name",
        "m",
        "both",
        "names of schemas",
        'bags: extra `formats` (pip install "handtrack[formats]")',
        suffixes=(".bag",),
        ways=(Way("file", is_bag_file, read_bag),),
    ),
)
