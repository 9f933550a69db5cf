"""Sound inputs as scripts write them, to be spoilt: objects, record types and arrays of other
axes, archives, messages whose layout changes, BVH of this project, labels of many kinds."""

from __future__ import annotations

import io
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES
from tools.fuzz import robots
from tools.fuzz.corpus import Files, Joints, Kind, as_npz, dumps, motion, named_csv, npy, panoptic
from tools.make import robot_logs
from tools.make.robot_logs import HUMBLE, protobuf

ONE_WAY = (
    *("npy dict", "npy list", "npy record", "zip folder", "bvh inches", "bvh written"),
    *("poses change", "markers change", "frames change", "protobuf change"),
)
"""Kinds that nothing writes otherwise."""
_LONG = 34
"""Frames, more than a hand has joints: else which axis is theirs is not to be told."""


def _load(path: Path) -> Any:
    return ht.load(path)


def _array(shaped: Callable[[Joints], Any]) -> Kind:
    return Kind(lambda joints: {"a.npy": npy(shaped(motion(_LONG)))}, "a.npy", _load)


def _object(content: Callable[[Joints], Any]) -> Kind:
    return _array(lambda joints: np.array(content(joints), dtype=object))


def _dicts(joints: Joints) -> list[dict[str, Any]]:
    return [{"time": i / 30, "hand": "right", "joints": j} for i, j in enumerate(joints)]


def _record(joints: Joints) -> np.ndarray:
    return np.array(list(enumerate(joints)), [("frame", "i4"), ("pos", "f8", (21, 3))])


def _with_fourth(joints: Joints) -> Joints:
    return np.concatenate([joints, np.full((*joints.shape[:2], 1), 0.75)], axis=2)


def _zipped(files: Files) -> Files:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return {"a.zip": out.getvalue()}


def _bvh(**options: Any) -> Kind:
    """BVH that the project writes itself."""

    def make(joints: Joints) -> Files:
        times = np.arange(len(joints)) * 33_333_333
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.bvh"
            ht.convert([ht.Sequence(times, joints, hand="right")], path, **options)
            return {"a.bvh": path.read_bytes()}

    return Kind(make, "a.bvh", _load)


def _labelled(joints: Joints) -> Files:
    labels = ("Right", "right_hand", "R", "RIGHT", "Right hand", "right")
    rows = [
        {"time": i / 30, "label": labels[i % len(labels)], "joints": j.tolist()}
        for i, j in enumerate(joints)
    ]
    return {"a.jsonl": b"\n".join(map(dumps, rows))}


def _label_cells(joints: Joints) -> Files:
    header, *rows = named_csv(joints)["a.csv"].decode().splitlines()
    lines = [f"hand,{header}", *(f"Right,{row}" for row in rows)]
    return {"a.csv": "\n".join(lines).encode() + b"\n"}


def _mirrored(joints: Joints) -> Files:
    found = [
        {"label": "Left (mirrored)", "landmarks": j.tolist(), "timestamp": i / 30}
        for i, j in enumerate(joints)
    ]
    return {"a.json": dumps({"data": {"results": found}})}


def _seen(i: int) -> list[int]:
    """Joints of a message: their order and number change between messages."""
    order = np.roll(np.arange(21), 5 * (i // 2 % 2)).tolist()
    return [j for j in order if i % 6 != 5 or j % 7 != 3]


def _frames(joints: np.ndarray, i: int) -> list[tuple[str, str, Any, Any]]:
    parent = "world" if i < 3 else "map"
    still = (0, 0, 0, 1)
    found = [(parent, f"right_{JOINT_NAMES[j]}", joints[j], still) for j in _seen(i)]
    return [("map", "world", [0.0, 0.0, 0.0], still), *found]


def _changing() -> dict[str, Kind]:
    poses = ("geometry_msgs/msg/PoseArray", "ros2msg", "cdr", b"")
    markers = ("visualization_msgs/msg/MarkerArray", "ros2msg", "cdr", HUMBLE)
    tf = ("tf2_msgs/msg/TFMessage", "ros2msg", "cdr", b"")
    frames = "foxglove.FrameTransforms"
    foxglove = (frames, "protobuf", "protobuf", protobuf(frames))

    def spheres(joints: np.ndarray, i: int) -> list[tuple[str, int, Any]]:
        return [(f"right_{JOINT_NAMES[j]}", 0, joints[j]) for j in _seen(i)]

    def pose_list(time: int, joints: np.ndarray, i: int) -> bytes:
        frame = "world" if i % 2 else "the world"
        return robot_logs.pose_array(time, joints[[]] if i == 4 else joints, frame)

    return {
        "poses change": robots.log(
            "/right",
            lambda j: (*poses, lambda t, i: pose_list(t, j[i], i)),
        ),
        "markers change": robots.log(
            "/hand",
            lambda j: (*markers, lambda t, i: robot_logs.marker_array(t, spheres(j[i], i))),
        ),
        "frames change": robots.log(
            "/tf", lambda j: (*tf, lambda t, i: robot_logs.tf_message(t, _frames(j[i], i)))
        ),
        "protobuf change": robots.log(
            "/tf",
            lambda j: (
                *foxglove,
                lambda t, i: robot_logs.foxglove_frames(t + i**9, _frames(j[i], i)),
            ),
        ),
    }


def kinds() -> dict[str, Kind]:
    """All of them, by name."""
    return {
        "npy dict": _object(lambda j: {"joints": j, "fps": 30.0, "hand": "right"}),
        "npy list": _object(_dicts),
        "npy record": _array(_record),
        "npy fourth": _array(_with_fourth),
        "npy 63 x T": _array(lambda j: j.reshape(len(j), 63).T),
        "npy 21 x T x 3": _array(lambda j: j.transpose(1, 0, 2)),
        "npz a frame": Kind(
            lambda joints: {"a.npz": as_npz(**{f"frame_{i:04d}": j for i, j in enumerate(joints)})},
            "a.npz",
            _load,
        ),
        "zip": Kind(lambda j: _zipped(named_csv(j)), "a.zip", _load),
        "zip folder": Kind(lambda j: _zipped(panoptic(j)), "a.zip", _load),
        "zip mcap": Kind(lambda j: _zipped(_changing()["frames change"].make(j)), "a.zip", _load),
        "bvh inches": _bvh(unit="in"),
        "bvh written": _bvh(),
        "labels": Kind(_labelled, "a.jsonl", _load),
        "label cells": Kind(_label_cells, "a.csv", _load),
        "labels mirrored": Kind(_mirrored, "a.json", _load),
        **_changing(),
    }
