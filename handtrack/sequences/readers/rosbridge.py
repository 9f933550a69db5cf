"""What rosbridge sends, as JSON: `{"op": "publish", "topic": "/right_hand", "msg": {...}}`.

Messages are geometry_msgs' PoseArray, PoseStamped and PointStamped, visualization_msgs' Marker and
MarkerArray, tf2_msgs' TFMessage, or any in which a hand is found as in other JSON.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence as Items
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.clock import MAX_NS, UNIT_NS
from handtrack.sequences.readers.raw import Array, Raw
from handtrack.sequences.readers.record_places import Picked
from handtrack.sequences.readers.records import read_records
from handtrack.sequences.readers.robot_logs import RobotLog
from handtrack.sequences.readers.robot_messages import (
    Marker,
    Message,
    Poses,
    StampError,
    Transform,
    Transforms,
    marked,
    or_none,
    stamps,
)
from handtrack.sequences.readers.robot_topics import side_in
from handtrack.sequences.titles import time_unit

_POINT = ("x", "y", "z")
_TURN = ("x", "y", "z", "w")


_FLAT = ("position", "pose", "point", "poses", "markers", "transforms", "transform")


def is_frame(value: Any) -> bool:
    """Whether an object is a message with its topic, or beside it."""
    if not isinstance(value, dict) or not isinstance(value.get("topic"), str):
        return False
    return isinstance(value.get("msg"), dict) or any(
        isinstance(value.get(key), dict | list) for key in _FLAT
    )


def _content(value: dict[str, Any]) -> dict[str, Any]:
    """The message, which may stand beside its topic."""
    inner = value.get("msg")
    if isinstance(inner, dict):
        return inner
    if isinstance(value.get("position"), dict | list):
        return {**value, "pose": {"position": value["position"]}}
    return value


def read_frames(values: list[Any], places: Items[str], path: Path) -> list[Raw]:
    """The hands of all topics.

    Raises:
        NotJointsError: there are none.
        InputError: a message that does not fit.
    """
    log = RobotLog(path)
    others: dict[str, list[int]] = {}
    rounds: Counter[str] = Counter()
    stamped = False
    for i, value in enumerate(values):
        if not is_frame(value):
            continue
        try:
            message, stamp = _message(_content(value)), _stamp_of(value)
        except StampError as error:
            raise InputError(f"{places[i]}: {error}", path) from None
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
            raise InputError(f"{places[i]} is no message of poses", path) from None
        if message is None:
            others.setdefault(value["topic"], []).append(i)
        else:
            # without stamps what a topic says is of as many moments
            rounds[value["topic"]] += 1
            log.put(value["topic"], stamp or rounds[value["topic"]], message)
            stamped = stamped or stamp != 0
    found = log.hands()
    if not stamped:
        for raw in found:
            raw.stamps = None
    if found or not others:
        return found or log.check()
    return [
        raw for topic, rows in others.items() for raw in _topic(topic, rows, values, places, path)
    ]


def _topic(
    topic: str, rows: list[int], values: list[Any], places: Items[str], path: Path
) -> list[Raw]:
    """The hands of one topic of messages that are read as any JSON."""
    raws = read_records([_content(values[i]) for i in rows], Picked(places, rows), path)
    for raw in raws:
        if raw.hand is None:
            raw.hand = side_in(topic)
    return raws


def _stamp_of(value: Any) -> int:
    if not is_frame(value):
        return 0
    msg = _content(value)
    inner = next((v for k in ("markers", "transforms") if isinstance(v := msg.get(k), list)), [msg])
    stamp = max((_stamp(m) for m in inner if isinstance(m, dict)), default=0)
    return stamp or _time_beside(value)


def _time_beside(value: dict[str, Any]) -> int:
    """The time that stands beside a topic [ns], in the unit that its name or its size says; 0:
    none."""
    for key, time in value.items():
        unit = time_unit(key)
        if unit is None or isinstance(time, bool) or not isinstance(time, int | float):
            continue
        if not unit:
            size = abs(time)
            unit = "s" if size < 1e11 else "ms" if size < 1e14 else "us" if size < 1e17 else "ns"
        return round(time * UNIT_NS[unit]) if abs(time) * UNIT_NS[unit] < MAX_NS else 0
    return 0


def _message(msg: dict[str, Any]) -> Message | None:
    """A message of places; None where it is another."""
    if isinstance(msg.get("markers"), list):
        return marked([_marker(m) for m in msg["markers"]], 1)
    if "ns" in msg and "pose" in msg:
        return marked([_marker(msg)], 1)
    if isinstance(msg.get("transforms"), list):
        return Transforms(tuple(map(_transform, msg["transforms"])))
    if "transform" in msg and "child_frame_id" in msg:
        return Transforms((_transform(msg),))
    if isinstance(msg.get("poses"), list) and all(map(_is_pose, msg["poses"])):
        # null, which is what JSON has for NaN, is NaN among floats
        several = [[p["position"][k] for k in _POINT] for p in msg["poses"]]
        places = np.array(several, dtype=np.float64).reshape(1, -1, 3)
        return Poses(or_none(stamps(_stamp(msg))), _frame(msg), places)
    pose = msg.get("pose")
    if isinstance(pose, dict) and isinstance(pose.get("pose"), dict):
        pose = pose["pose"]  # with its covariance
    point = pose.get("position") if isinstance(pose, dict) else msg.get("point")
    if isinstance(point, list) and len(point) == len(_POINT):
        point = dict(zip(_POINT, point, strict=True))
    if not isinstance(point, dict):
        return None
    return Poses(or_none(stamps(_stamp(msg))), _frame(msg), _point(point)[None, None])


def _is_pose(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("position"), dict)


def _point(given: dict[str, Any], keys: Items[str] = _POINT) -> Array:
    # null is what JSON has for NaN
    return np.array([np.nan if given[k] is None else given[k] for k in keys], dtype=np.float64)


def _pose(given: dict[str, Any], place: str = "position", turn: str = "orientation") -> Array:
    still = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    return np.concatenate([_point(given[place]), _point(given.get(turn) or still, _TURN)])


def _transform(given: dict[str, Any]) -> Transform:
    pose = _pose(given["transform"], "translation", "rotation")
    return Transform(stamps(_stamp(given)), _frame(given), str(given["child_frame_id"]), pose[None])


def _marker(given: dict[str, Any]) -> Marker:
    points = np.array([_point(p) for p in given.get("points") or ()]).reshape(1, -1, 3)
    return Marker(
        or_none(stamps(_stamp(given))),
        _frame(given),
        str(given.get("ns", "")),
        int(given.get("id", 0)),
        int(given.get("type", 0)),
        int(given.get("action", 0)),
        _pose(given["pose"])[None],
        points,
        str(given.get("text", "")),
    )


def _frame(msg: dict[str, Any]) -> str:
    header = msg.get("header")
    return str(header.get("frame_id", "")) if isinstance(header, dict) else ""


def _stamp(msg: dict[str, Any]) -> int:
    """The header's time [ns], of ROS 1 or 2; 0: none."""
    header = msg.get("header")
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if not isinstance(stamp, dict):
        return 0
    whole = next((stamp[k] for k in ("sec", "secs") if k in stamp), 0)
    rest = next((stamp[k] for k in ("nanosec", "nsecs", "nsec") if k in stamp), 0)
    return int(whole) * 10**9 + int(rest)
