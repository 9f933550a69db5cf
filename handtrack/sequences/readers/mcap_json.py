"""Joints in JSON messages of an MCAP file, one topic per hand.

Two layouts: `bone_data["0".."20"].to_global.position` with x, y, z [m] (exports of headsets,
this project's joint order), or frames as `records` reads them. A joint at -1, -1, -1 is missing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.found import hands_in, is_blank
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import (
    Array,
    NotJointsError,
    Raw,
    as_hand,
    stem,
    within,
)
from handtrack.sequences.readers.records import read_records
from handtrack.sequences.readers.spelling import in_small_letters

_WORD = re.compile(r"(?<![a-z])(left|right)(?![a-z])")
SAME_CLOCK_NS = 60 * 10**9
"""A message's own stamp this near to its log time is one of the same clock, in nanoseconds."""


class Message(NamedTuple):
    """A JSON message.

    Attributes:
        topic: where it was sent.
        log_time: [ns].
        data: the message.
    """

    topic: str
    log_time: int
    data: bytes


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


class _Bones(msgspec.Struct):
    """A message of bones, as far as it is used."""

    header: _Header | None = None
    bone_data: dict[str, _Bone] | None = None
    hand: str | None = None
    confidence: list[float | None] | float | None = None


def read(messages: list[Message], path: Path) -> list[Raw]:
    """The sequences of the JSON topics, of each hand in a topic that carries joints.

    Args:
        messages: in the order of their log times.
        path: of the file.

    Raises:
        NotJointsError: no topic carries joints.
        InputError: a message that does not fit, with its topic and number.
    """
    by_topic: dict[str, list[Message]] = {}
    for message in messages:
        by_topic.setdefault(message.topic, []).append(message)
    raws: list[Raw] = []
    topics: list[str] = []
    for topic, messages in sorted(by_topic.items()):
        of_topic = _topic(topic, messages, path)
        raws += of_topic
        topics += [topic] * len(of_topic)
    if not raws:
        raise NotJointsError(
            f"no joints in the JSON messages of {', '.join(sorted(by_topic)[:6])}", path
        )
    labels = [raw.hand for raw in raws]
    for topic, raw in zip(topics, raws, strict=True):
        if len(set(topics)) > 1 and (raw.hand is None or labels.count(raw.hand) > 1):
            raw.name = f"{raw.name} {topic.strip('/').replace('/', ' ')}"
    return raws


def _topic(topic: str, messages: list[Message], path: Path) -> list[Raw]:
    """The hands of one topic: its first message with something in it says what it carries."""
    values: list[Any] = []
    some: Any = None
    for i, message in enumerate(messages):
        with within(f"{topic}, message {i}", path):
            values.append(in_small_letters(decode(message.data, Any, path)))
        if some is None and _has_content(values[-1]):
            some = values[-1]
            if "bone_data" not in some and not hands_in(some):
                return []
            if some.get("bone_data") is not None:
                break
    if some is None:
        return []
    for i, message in enumerate(messages):
        if message.log_time > np.iinfo(np.int64).max:
            raise InputError(
                f"{topic}, message {i}: log time {message.log_time} ns is beyond 64 bits", path
            )
    if some.get("bone_data") is not None:
        return [_bones_topic(topic, messages, path)]
    places = [f"{topic}, message {i}" for i in range(len(messages))]
    logged = np.array([m.log_time for m in messages], dtype=np.int64)
    raws = read_records(values, places, path, logged=Stamps(logged, "log time", "ns"))
    in_topic = _labels([topic], path)
    for raw in raws:
        if raw.hand is None and len(in_topic) == 1:
            raw.hand = next(iter(in_topic))
        if raw.stamps is not None and len(raw.joints) == len(messages):
            raw.stamps = _better(raw.stamps, logged)
    return raws


def _has_content(value: Any) -> bool:
    """Whether a message says what its topic carries: it holds more than nulls."""
    if not isinstance(value, dict):
        return False
    if "bone_data" in value and not value["bone_data"]:
        return False
    return not is_blank(value)


def _better(own: Stamps, logged: NDArray[np.int64]) -> Stamps:
    """The messages' own times, where log times say nothing or they are of the same clock."""
    if own.name == "log time" or (np.diff(logged) <= 0).sum() > len(logged) / 2:
        return own
    return message_stamps(list(own.values), logged.tolist())


def _bones_topic(topic: str, messages: list[Message], path: Path) -> Raw:
    read = []
    for i, message in enumerate(messages):
        with within(f"{topic}, message {i}", path):
            read.append(_message(message, path))
    labels = _labels([topic], path) or {label for m in read for label in m.labels}
    return Raw(
        np.array([m.joints for m in read]),
        path,
        stem(path),
        hand=next(iter(labels)) if len(labels) == 1 else None,
        unit="m",
        stamps=message_stamps([m.stamp for m in read], [m.log_time for m in messages]),
        frame_index=_numbers([m.number for m in read]),
        confidence=np.array([m.confidence for m in read]),
    )


@dataclass
class _Read:
    """One message's content."""

    joints: Array
    confidence: Array
    labels: set[Hand]
    stamp: int | float | str | None
    number: int | None


def _message(message: Message, path: Path) -> _Read:
    value = decode(message.data, _Bones | None, path) or _Bones()
    bones = value.bone_data or {}
    joints, confidence = _bones(bones, path)
    labels = _labels([b.bone_name for b in bones.values()], path)
    if value.hand is not None:
        labels = {as_hand(value.hand, path)}
    if value.confidence is not None:
        given = np.array(value.confidence, dtype=np.float64)
        if given.shape not in ((), (N_JOINTS,)):
            raise InputError(f"confidence has shape {given.shape}, expected (21,)", path)
        confidence = confidence * given
    joints[(joints == -1).all(1)] = np.nan
    confidence[np.isnan(joints).any(1)] = 0
    header = value.header or _Header()
    return _Read(joints, confidence, labels, header.timestamp, header.frame_index)


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


def message_stamps(own: list[int | float | str | None], logged: list[int]) -> Stamps:
    """When the messages say they were taken, or when they were logged."""
    log = np.array(logged, dtype=np.int64)
    stamps = []
    for stamp, logged_at in zip(own, logged, strict=True):
        text = str(stamp)
        if not re.fullmatch(r"\d{1,18}|\d{19}", text) or abs(int(text) - logged_at) > SAME_CLOCK_NS:
            return Stamps(log, "log time", "ns")
        stamps.append(int(text))
    return _in_better_order(np.array(stamps, dtype=np.int64), log)


def taken_or_logged(own: NDArray[np.int64], logged: NDArray[np.int64]) -> Stamps:
    """The same of (n,) stamps [ns] that are numbers."""
    if (own >= 0).all() and (np.abs(own - logged) <= SAME_CLOCK_NS).all():
        return _in_better_order(own, logged)
    return Stamps(logged, "log time", "ns")


def _in_better_order(taken: NDArray[np.int64], log: NDArray[np.int64]) -> Stamps:
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


FORMATS = (
    Format(
        "MCAP of JSON messages",
        "one topic per hand",
        "handtrack",
        "m",
        "both",
        "file magic",
    ),
)
