"""Joints in JSON messages of an MCAP file, one topic per hand.

Two layouts: `bone_data["0".."20"].to_global.position` with x, y, z [m] (exports of headsets,
this project's joint order), or `joints` as in `fields`. A joint at -1, -1, -1 is missing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.fields import JOINT_KEYS, as_frames, joint_key
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.mcap_file import McapFile, Message
from handtrack.sequences.readers.raw import (
    Array,
    NotJointsError,
    Raw,
    Unit,
    as_hand,
    stem,
    within,
)

_WORD = re.compile(r"(?<![a-z])(left|right)(?![a-z])")
SAME_CLOCK_NS = 60 * 10**9
"""A message's own stamp this near to its log time is one of the same clock, in nanoseconds."""


class _Position(msgspec.Struct):
    x: float | None
    y: float | None
    z: float | None


class _Place(msgspec.Struct):
    position: _Position


class _Bone(msgspec.Struct):
    bone_name: str = ""
    to_global: _Place | None = None
    position: _Position | None = None
    confidence: float | None = None


class _Header(msgspec.Struct):
    timestamp: int | float | str | None = None
    frame_index: int | None = None


class _Joints(msgspec.Struct):
    """A message, as far as it is used."""

    header: _Header | None = None
    bone_data: dict[str, _Bone] | None = None
    hand: str | None = None
    confidence: list[float | None] | float | None = None
    joints: Any = None
    joints_m: Any = None
    joints_cm: Any = None
    joints_mm: Any = None


def read(file: McapFile, path: Path) -> list[Raw]:
    """The sequences of the JSON topics, one per topic that carries joints.

    Raises:
        NotJointsError: no topic carries joints.
        InputError: a message that does not fit, with its topic and number.
    """
    by_topic: dict[str, list[Message]] = {}
    for message in file.messages:
        if message.encoding == "json":
            by_topic.setdefault(message.topic, []).append(message)
    raws = {
        topic: _topic(topic, messages, path)
        for topic, messages in sorted(by_topic.items())
        if _carries_joints(messages[0], path)
    }
    if not raws:
        raise NotJointsError(
            f"no joints in the JSON messages of {', '.join(sorted(by_topic)[:6])}", path
        )
    labels = [raw.hand for raw in raws.values()]
    for topic, raw in raws.items():
        if len(raws) > 1 and (raw.hand is None or labels.count(raw.hand) > 1):
            raw.name = f"{raw.name} {topic.strip('/').replace('/', ' ')}"
    return list(raws.values())


def _carries_joints(message: Message, path: Path) -> bool:
    with within(f"{message.topic}, message 0", path):
        fields = decode(message.data, Any, path)
    return isinstance(fields, dict) and any(k in fields for k in ("bone_data", *JOINT_KEYS))


def _topic(topic: str, messages: list[Message], path: Path) -> Raw:
    read = []
    for i, message in enumerate(messages):
        with within(f"{topic}, message {i}", path):
            if message.log_time > np.iinfo(np.int64).max:
                raise InputError(f"log time {message.log_time} ns is beyond 64 bits", path)
            read.append(_message(message, path))
            if read[-1].joints.shape != read[0].joints.shape or read[-1].unit != read[0].unit:
                raise InputError("another layout than in message 0", path)
    in_topic = _labels([topic], path)
    labels = in_topic or {label for m in read for label in m.labels}
    return Raw(
        np.array([m.joints for m in read]),
        path,
        stem(path),
        hand=next(iter(labels)) if len(labels) == 1 else None,
        unit=read[0].unit,
        stamps=_stamps([m.stamp for m in read], [m.log_time for m in messages]),
        frame_index=_numbers([m.number for m in read]),
        confidence=np.array([m.confidence for m in read]),
    )


@dataclass
class _Read:
    """One message's content."""

    joints: Array
    confidence: Array
    unit: Unit | None
    labels: set[Hand]
    stamp: int | float | str | None
    number: int | None


def _message(message: Message, path: Path) -> _Read:
    value: _Joints = decode(message.data, _Joints, path)
    unit: Unit | None = "m"
    if value.bone_data is not None:
        joints, confidence = _bones(value.bone_data, path)
        labels = _labels([b.bone_name for b in value.bone_data.values()], path)
    else:
        fields = {k: v for k, v in msgspec.structs.asdict(value).items() if k in JOINT_KEYS}
        key = joint_key(fields, path)
        unit = JOINT_KEYS[key]
        joints = as_frames(fields[key], path, key)
        if len(joints) != 1:
            raise InputError(f"{key} holds {len(joints)} frames, expected one", path)
        joints = joints[0]
        confidence, labels = np.ones(len(joints)), set()
    if value.hand is not None:
        labels = {as_hand(value.hand, path)}
    if value.confidence is not None:
        given = np.array(value.confidence, dtype=np.float64)
        if given.shape not in ((), (len(joints),)):
            raise InputError(f"confidence has shape {given.shape}, expected (21,)", path)
        confidence = confidence * given
    joints[(joints == -1).all(1)] = np.nan
    confidence[np.isnan(joints).any(1)] = 0
    header = value.header or _Header()
    return _Read(joints, confidence, unit, labels, header.timestamp, header.frame_index)


def _labels(texts: Iterable[str], path: Path) -> set[Hand]:
    """Hands named in texts such as "/robot0/handtracking/left" or "Left_Thumb0"."""
    return {as_hand(word, path) for text in texts for word in _WORD.findall(text.lower())}


def _bones(bones: dict[str, _Bone], path: Path) -> tuple[Array, Array]:
    """(21, 3) joints and (21,) confidence; bones that are not there are missing."""
    joints, confidence = np.full((N_JOINTS, 3), np.nan), np.ones(N_JOINTS)
    for key, bone in bones.items():
        if not (key.isascii() and key.isdecimal() and int(key) < N_JOINTS):
            raise InputError(f"bone_data has a bone {key[:20]!r}, expected 0 to 20", path)
        position = bone.position if bone.to_global is None else bone.to_global.position
        if position is not None:
            joints[int(key)] = np.array([position.x, position.y, position.z], dtype=np.float64)
        if bone.confidence is not None:
            confidence[int(key)] = bone.confidence
    return joints, confidence


def _stamps(own: list[int | float | str | None], logged: list[int]) -> Stamps:
    """When the messages say they were taken, or when they were logged."""
    log = np.array(logged, dtype=np.int64)
    stamps = []
    for stamp, logged_at in zip(own, logged, strict=True):
        text = str(stamp)
        if not re.fullmatch(r"\d{1,18}|\d{19}", text) or abs(int(text) - logged_at) > SAME_CLOCK_NS:
            return Stamps(log, "log time", "ns")
        stamps.append(int(text))
    taken = np.array(stamps, dtype=np.int64)
    # of two that say the same, the one that is in better order
    if (np.diff(taken) <= 0).sum() <= (np.diff(log) <= 0).sum():
        return Stamps(taken, "header timestamp", "ns")
    return Stamps(log, "log time", "ns")


def _numbers(numbers: list[int | None]) -> Any:
    """(T,) frame numbers where every message has one, and they increase; else None."""
    if any(n is None or abs(n) >= 2**53 for n in numbers):
        return None
    index = np.array(numbers, dtype=np.int64)
    return index if (np.diff(index) > 0).all() else None
