"""Sound logs of robots, data sets of robots, and streams of headsets, to be spoilt."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES, ORDERS, PARENTS
from tools.fuzz.corpus import Files, Joints, Kind, dumps
from tools.make import robot_logs
from tools.make.robot_logs import HUMBLE, CdrOut, Topics, protobuf

ONE_WAY = (
    *("lerobot", "parquet", "ros poses", "ros markers", "ros frames", "foxglove frames", "isaac"),
    *("landmark lines", "ros joints", "rosbridge", "json capitals"),
)
"""Kinds that nothing writes otherwise."""
_STILL, _TURN = (0, 0, 0, 1), {"x": 0, "y": 0, "z": 0, "w": 1}


def _load(path: Path) -> Any:
    return ht.load(path)


def _lerobot(joints: Joints) -> Files:
    import pyarrow as pa

    n = len(joints)
    flat = pa.array(joints.astype(np.float32).ravel())
    columns = {
        "observation.state": pa.FixedSizeListArray.from_arrays(flat, 63),
        "timestamp": np.arange(n, dtype=np.float32) / 30,
        "frame_index": np.arange(n),
        "episode_index": np.repeat([0, 1], [n // 2, n - n // 2]),
    }
    return {"a.parquet": _parquet(columns)}


def _table(joints: Joints) -> Files:
    columns: dict[str, Any] = {"time_s": np.arange(len(joints)) / 30}
    for j, name in enumerate(JOINT_NAMES):
        columns |= {f"{name}_{c}": joints[:, j, i] for i, c in enumerate("xyz")}
    return {"a.parquet": _parquet(columns)}


def _parquet(columns: dict[str, Any]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    out = io.BytesIO()
    parquet.write_table(pa.table(columns), out)
    return out.getvalue()


def log(topic: str, entry: Callable[[Joints], Any]) -> Kind:
    """A log of one topic."""
    return _of_topics(lambda joints: {topic: entry(joints)})


def _of_topics(topics_of: Callable[[Joints], Topics]) -> Kind:
    def make(joints: Joints) -> Files:
        topics = topics_of(joints)
        with tempfile.TemporaryDirectory() as folder:
            path = robot_logs.write_log(Path(folder) / "a.mcap", topics, len(joints))
            return {"a.mcap": path.read_bytes()}

    return Kind(make, "a.mcap", _load, True)


def _frames(joints: np.ndarray) -> list[tuple[str, str, Any, Any]]:
    frames: list[tuple[str, str, Any, Any]] = [("world", "right_wrist", joints[0], _STILL)]
    for j in range(1, 21):
        above = int(PARENTS[j])
        names = f"right_{JOINT_NAMES[above]}", f"right_{JOINT_NAMES[j]}"
        frames.append((*names, joints[j] - joints[above], _STILL))
    return frames


def _openxr(joints: np.ndarray) -> np.ndarray:
    out = np.repeat(joints[:1], 26, axis=0)
    out[list(ORDERS["openxr"])] = joints
    return out


def _lines(joints: Joints) -> Files:
    text = []
    for i, places in enumerate(joints):
        about = f" | f = {i} | t = {i * 33_000_000}"
        numbers = ", ".join(f"{x:.6f}" for x in (places - places[0]).ravel())
        wrist = ", ".join(f"{x:.6f}" for x in [*places[0], *_STILL])
        text += [f"Right wrist{about}:, {wrist}", f"Right landmarks{about}:, {numbers}"]
    return {"a.txt": "\n".join(text).encode()}


def _joint_topics(joints: Joints) -> Topics:
    """A topic of PoseStamped for each joint."""
    about = ("geometry_msgs/msg/PoseStamped", "ros2msg", "cdr", b"")

    def at(j: int) -> Callable[[int, int], bytes]:
        return lambda t, i: bytes(CdrOut().header(t, "world").pose(joints[i, j]).data)

    return {f"/right/{name}": (*about, at(j)) for j, name in enumerate(JOINT_NAMES)}


def _bridged(joints: Joints) -> Files:
    """rosbridge's messages, a topic for each joint."""
    lines = []
    for i, places in enumerate(joints):
        header = {"stamp": {"sec": i // 30, "nanosec": i % 30 * 33_000_000}, "frame_id": "world"}
        for name, place in zip(JOINT_NAMES, places.tolist(), strict=True):
            pose = {"position": dict(zip("xyz", place, strict=True)), "orientation": _TURN}
            msg = {"header": header, "pose": pose}
            lines.append(dumps({"op": "publish", "topic": f"/right/{name}", "msg": msg}))
    return {"a.jsonl": b"\n".join(lines)}


def _capitals(joints: Joints) -> Files:
    """Joints with names, in capital letters."""
    frames = [
        {
            "Time": i / 30,
            "Hand": "right",
            "Joints": [
                {"Name": name, "Position": dict(zip("XYZ", place, strict=True))}
                for name, place in zip(JOINT_NAMES, places.tolist(), strict=True)
            ],
        }
        for i, places in enumerate(joints)
    ]
    return {"a.json": dumps(frames)}


def kinds() -> dict[str, Kind]:
    """All of them, by name."""
    frames = "foxglove.FrameTransforms"
    poses = ("geometry_msgs/msg/PoseArray", "ros2msg", "cdr", b"")
    markers = ("visualization_msgs/msg/MarkerArray", "ros2msg", "cdr", HUMBLE)
    tf = ("tf2_msgs/msg/TFMessage", "ros2msg", "cdr", b"")
    isaac = ("core.HandPoseRecord", "flatbuffer", "flatbuffer", b"")
    foxglove = (frames, "protobuf", "protobuf", protobuf(frames))
    return {
        "lerobot": Kind(_lerobot, "a.parquet", _load),
        "parquet": Kind(_table, "a.parquet", _load),
        "ros poses": log("/right", lambda j: (*poses, lambda t, i: robot_logs.pose_array(t, j[i]))),
        "ros markers": log(
            "/hand",
            lambda j: (
                *markers,
                lambda t, i: robot_logs.marker_array(
                    t, [("right", n, p) for n, p in enumerate(j[i])]
                ),
            ),
        ),
        "ros frames": log(
            "/tf", lambda j: (*tf, lambda t, i: robot_logs.tf_message(t, _frames(j[i])))
        ),
        "foxglove frames": log(
            "/tf", lambda j: (*foxglove, lambda t, i: robot_logs.foxglove_frames(t, _frames(j[i])))
        ),
        "ros joints": _of_topics(_joint_topics),
        "rosbridge": Kind(_bridged, "a.jsonl", _load),
        "json capitals": Kind(_capitals, "a.json", _load),
        "isaac": log(
            "hands/right_hand",
            lambda j: (*isaac, lambda t, i: robot_logs.isaac_record(t, _openxr(j[i]))),
        ),
        "landmark lines": Kind(_lines, "a.txt", _load),
    }
