"""Made JSON of every kind that is read, of one moving hand."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.hand.skeleton import FINGERS, JOINT_NAMES
from tools.bench.reading_files import OPENXR, XYZ, Array, frames, openxr, pixels, texts


def _points(x: Array) -> list[dict[str, float]]:
    return [dict(zip(XYZ, p, strict=True)) for p in x.tolist()]


def _lines(record: Callable[[int, float, Array], Any]) -> Any:
    def make(path: Path, mb: float) -> Path:
        return texts(path, mb, "", lambda i, t, x: json.dumps(record(i, t, x)) + "\n")

    return make


def _document(begin: str, record: Callable[[int, float, Array], Any], end: str) -> Any:
    def make(path: Path, mb: float) -> Path:
        def line(i: int, time: float, x: Array) -> str:
            return ("," if i else "") + json.dumps(record(i, time, x))

        texts(path, mb, begin, line)
        with path.open("a") as file:
            file.write(end)
        return path

    return make


def _named(i: int, time: float, x: Array) -> Any:
    named = {n: {"position": p} for n, p in zip(JOINT_NAMES, _points(x), strict=True)}
    return {"timestamp": time, "right": named, "left": None}


def _media(i: int, time: float, x: Array) -> Any:
    return {"timestamp": time, "hands": [{"handedness": "Right", "landmarks": _points(x)}]}


def _mrtk(i: int, time: float, x: Array) -> Any:
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    names = ("Palm", "Wrist", *(f"{n}Joint" for n in OPENXR[2:]))
    items = [
        {"joint": n, "pose": {"position": p, "rotation": turn}}
        for n, p in zip(names, _points(openxr(x)), strict=True)
    ]
    return {"timestamp": time, "handedness": "Right", "items": items}


def _leap(i: int, time: float, x: Array) -> Any:
    fields = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")
    pointables = [
        {
            **dict(zip(fields, (1e3 * x[4 * f + 1 : 4 * f + 5]).tolist(), strict=True)),
            "handId": 7,
            "id": 70 + f,
            "tool": False,
            "type": f,
            "length": 50.0,
        }
        for f in range(len(FINGERS))
    ]
    hand = {"id": 7, "type": "right", "confidence": 0.8, "grabStrength": 0.0}
    stamp = 12_441_190_938 + round(time * 1e6)
    return {"id": i, "timestamp": stamp, "hands": [hand], "pointables": pointables}


def _ultraleap(i: int, time: float, x: Array) -> Any:
    points = _points(1e3 * x)
    digits = [
        {
            "bones": [
                {"prev_joint": a, "next_joint": b, "width": 15.0}
                for a, b in itertools.pairwise(
                    [points[4 * f + 1 if f == 0 else 0], *points[4 * f + 1 : 4 * f + 5]]
                )
            ]
        }
        for f in range(5)
    ]
    hand = {"id": 5, "type": "Right", "confidence": 1.0, "digits": digits}
    hand["arm"] = {"prev_joint": points[9], "next_joint": points[0]}
    return {"tracking_frame_id": i, "timestamp": round(time * 1e6), "hands": [hand]}


def _rosbridge(i: int, time: float, x: Array) -> Any:
    stamp = {"sec": 1_700_000_000 + int(time), "nanosec": round(time % 1 * 1e9)}
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    poses = [{"position": p, "orientation": turn} for p in _points(x)]
    message = {"header": {"stamp": stamp, "frame_id": "world"}, "poses": poses}
    return {"op": "publish", "topic": "/right_hand", "msg": message}


def umetrack(path: Path, mb: float) -> Path:
    """HOT3D's trajectory of UmeTrack's angles, with a made profile beside it."""
    from tools.make.hdf5_files import profile

    (path.parent / "umetrack_hand_user_profile.json").write_text(json.dumps(profile()))

    def record(i: int, time: float, x: Array) -> Any:
        angles = (0.4 + 0.2 * np.sin(time + np.arange(22))).tolist()
        wrist = {"t_xyz": x[0].tolist(), "q_wxyz": [1.0, 0.0, 0.0, 0.0]}
        pose = {"wrist_xform": wrist, "joint_angles": angles, "hand_confidence": 1.0}
        return {"timestamp_ns": 10**12 + round(time * 1e9), "hand_poses": {"1": pose}}

    return _lines(record)(path, mb)  # type: ignore[no-any-return]


def mmpose(path: Path, mb: float) -> Path:
    """mmpose's predictions of hands."""

    def record(i: int, time: float, x: Array) -> Any:
        points = np.round(pixels(x), 4).tolist()
        return {
            "frame_id": i + 1,
            "instances": [{"keypoints": points, "keypoint_scores": [0.8] * 21}],
        }

    return _document('{"meta_info":{},"instance_info":[', record, "]}")(path, mb)  # type: ignore[no-any-return]


def openpose(path: Path, mb: float) -> Path:
    """OpenPose's folder of a file for each frame."""
    path.mkdir(exist_ok=True)
    for i, _, x in itertools.islice(frames(), int(mb * 1e6 / 1500)):
        points = np.column_stack([pixels(x), np.full(21, 0.8)])
        person = {
            "person_id": [-1],
            "pose_keypoints_2d": np.zeros(75).tolist(),
            "hand_left_keypoints_2d": np.zeros(63).tolist(),
            "hand_right_keypoints_2d": np.round(points, 3).ravel().tolist(),
        }
        text = json.dumps({"version": 1.3, "people": [person]})
        (path / f"clip_{i:012d}_keypoints.json").write_text(text)
    return path


JSON: dict[str, tuple[str, Any]] = {
    "JSON, frames": (
        "frames.json",
        _document("[", lambda i, t, x: {"time": t, "joints": x.tolist()}, "]"),
    ),
    "JSON, one object": (
        "object.json",
        _document('{"fps":60,"hand":"right","joints_m":[', lambda i, t, x: x.tolist(), "]}"),
    ),
    "JSON lines": (
        "flat.jsonl",
        _lines(lambda i, t, x: {"time": t, "hand": "right", "joints": x.ravel().tolist()}),
    ),
    "JSON lines, MediaPipe's objects": ("objects.jsonl", _lines(_media)),
    "JSON lines, named joints": ("named.jsonl", _lines(_named)),
    "MRTK, lines of items": ("items.jsonl", _lines(_mrtk)),
    "Leap Motion": ("leap.json", _document('{"frames":[', _leap, '],"metadata":{}}')),
    "Ultraleap": ("ultraleap.json", _document('{"frames":[', _ultraleap, "]}")),
    "rosbridge": ("rosbridge.jsonl", _lines(_rosbridge)),
    "HOT3D, UmeTrack's angles": ("umetrack_hand_pose_trajectory.jsonl", umetrack),
}
"""Name, file's name and maker of each text."""

PICTURES: dict[str, tuple[str, Any]] = {
    "pixels, mmpose": ("mmpose.json", mmpose),
    "pixels, OpenPose's files": ("openpose", openpose),
}
"""The same of landmarks in pictures."""
