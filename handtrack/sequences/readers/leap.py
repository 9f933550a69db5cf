"""Reader of Leap Motion v2 recordings as LeapJS Playback stores them.

`frames[]` hold `hands[]` (id, type, confidence) and `pointables[]` (handId, type 0..4, and
mcpPosition, pipPosition, dipPosition, btipPosition or tipPosition, mm). Format 2 packs frames:
the first entry lists the names of what follows as plain arrays. There is no wrist joint: it is
missing here, unless the recording gives the hand's `wrist`. The thumb has no metacarpal of its
own in Leap's hand, so that its "mcp" is the joint at the wrist (CMC), ours 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.jsontext import decode, misfit
from handtrack.sequences.readers.raw import (
    NotJointsError,
    Raw,
    as_fps,
    as_hand,
    stem,
    within,
)

Point = tuple[float | None, float | None, float | None]
"""A place; null is what JSON has for NaN."""
_NOWHERE: Point = (None, None, None)


class _LeapHand(msgspec.Struct):
    id: int
    type: str | None = None
    confidence: float | None = None
    wrist: Point | None = None


class _Pointable(msgspec.Struct, rename="camel"):
    """A finger (or a tool) in one frame."""

    hand_id: int
    id: int | None = None
    type: int | None = None
    tool: bool = False
    mcp_position: Point | None = None
    pip_position: Point | None = None
    dip_position: Point | None = None
    btip_position: Point | None = None
    tip_position: Point | None = None


class _LeapFrame(msgspec.Struct, rename="camel"):
    hands: list[_LeapHand] | None = None
    pointables: list[_Pointable] | None = None
    timestamp: int | float | None = None
    current_frame_rate: float | None = None


class _Metadata(msgspec.Struct, rename="camel"):
    frame_rate: float | str | None = None


class _Recording(msgspec.Struct):
    frames: list[msgspec.Raw]
    metadata: _Metadata | None = None


@dataclass
class _Seen:
    """What was seen of one hand so far."""

    frame: list[int] = field(default_factory=list)
    joints: list[list[Point]] = field(default_factory=list)
    confidence: list[float] = field(default_factory=list)
    ids: list[int] = field(default_factory=list)


def is_leap(data: bytes) -> bool:
    """Whether frames in JSON are of Leap Motion: they have its names."""
    return any(name in data for name in (b'"pointables"', b'"handId"', b'"currentFrameRate"'))


def read_leap(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a Leap recording, one per hand.

    Frames in which a hand was not seen are its frames too; one that was lost and came back under
    a new id continues its sequence; two hands of the same type at one time make two sequences.

    Raises:
        NotJointsError: no hand with fingers in any frame.
        InputError: malformed, or a field that does not fit.
    """
    recording: _Recording = decode(data, _Recording, path)
    frames = _frames(recording, path)
    seen: dict[Hand, list[_Seen]] = {}
    labels: dict[str, Hand] = {}
    notes: list[str] = []
    for number, frame in enumerate(frames):
        busy: list[_Seen] = []
        for hand in frame.hands or ():
            if hand.type is None:
                raise InputError(f"frames[{number}]: hand {hand.id} has no type", path)
            fingers = [p for p in frame.pointables or () if p.hand_id == hand.id and not p.tool]
            points = _joints(hand, fingers, f"frames[{number}]", path)
            if all(x is None for point in points for x in point):
                continue
            if hand.type not in labels:
                where = f"frames[{number}]: the type of hand {hand.id}"
                labels[hand.type] = as_hand(hand.type, path, where)
            track = _track(seen.setdefault(labels[hand.type], []), hand.id, busy)
            busy.append(track)
            track.frame.append(number)
            track.joints.append(points)
            track.confidence.append(1.0 if hand.confidence is None else hand.confidence)
            track.ids.append(hand.id)
    if not seen:
        raise NotJointsError(f"no hand with finger joints in {len(frames)} Leap frames", path)
    stamps = _stamps(frames)
    fps = None if stamps is not None else _rate(frames, recording, path)
    raws = []
    for label, tracks in sorted(seen.items()):
        for number, track in enumerate(tracks, 1):
            at = np.array(track.frame, dtype=np.int64)
            joints = np.full((len(frames), N_JOINTS, 3), np.nan)
            joints[at] = np.array(track.joints, dtype=np.float64)
            sure = np.ones((len(frames), N_JOINTS))
            sure[at] = np.clip(track.confidence, 0, 1)[:, None]
            ids = list(dict.fromkeys(track.ids))
            if len(ids) > 1:
                notes = [f"lost and found again {len(ids) - 1} time(s), under a new id"]
            raws.append(
                Raw(
                    joints,
                    path,
                    stem(path) if len(tracks) == 1 else f"{stem(path)} hand{number}",
                    hand=label,
                    unit="mm",
                    stamps=stamps,
                    frame_index=np.arange(len(frames)),
                    fps=fps,
                    confidence=sure,
                    notes=tuple(notes),
                )
            )
            notes = []
    return raws


def _track(tracks: list[_Seen], hand_id: int, busy: list[_Seen]) -> _Seen:
    """The sequence that a hand of this id continues, or a new one."""
    free = [t for t in tracks if not any(t is b for b in busy)]
    same = [t for t in free if t.ids[-1] == hand_id]
    if same:
        return same[0]
    if free:
        # the one that was seen last; its old id is gone, or it would be in this frame
        return max(free, key=lambda t: t.frame[-1])
    tracks.append(_Seen())
    return tracks[-1]


def _joints(hand: _LeapHand, fingers: list[_Pointable], where: str, path: Path) -> list[Point]:
    """The 21 joints of one hand [mm], of None where missing."""
    joints = [_NOWHERE] * N_JOINTS
    joints[0] = hand.wrist or _NOWHERE
    for finger in fingers:
        kind = finger.type
        if kind is None and finger.id is not None:
            kind = finger.id - 10 * hand.id  # ids of fingers are the hand's, and one digit
        if kind is None or not 0 <= kind <= 4:
            raise InputError(f"{where}: a finger's type is {kind}, expected 0 to 4", path)
        tip = finger.tip_position if finger.btip_position is None else finger.btip_position
        points = (finger.mcp_position, finger.pip_position, finger.dip_position, tip)
        for i, point in enumerate(points, 4 * kind + 1):
            if point is not None:
                joints[i] = point
    return joints


def _frames(recording: _Recording, path: Path) -> list[_LeapFrame]:
    if not recording.frames:
        raise InputError("frames is empty", path)
    frames: list[_LeapFrame] = []
    if bytes(recording.frames[0]).lstrip()[:1] != b"[":
        for i, raw in enumerate(recording.frames):
            with within(f"frames[{i}]", path):
                frame = decode(bytes(raw), _LeapFrame | None, path)
                frames.append(frame or _LeapFrame())
        return frames
    names = decode(bytes(recording.frames[0]), Any, path)
    for i, raw in enumerate(recording.frames[1:], 1):
        plain = _unpack(names, decode(bytes(raw), Any, path), f"frames[{i}]", path)
        try:
            frames.append(msgspec.convert(plain, _LeapFrame))
        except msgspec.ValidationError as error:
            raise InputError(f"frames[{i}]: {misfit(error)}", path) from None
    if not frames:
        raise InputError("frames holds only the names of the packed form", path)
    return frames


def _unpack(names: Any, values: Any, where: str, path: Path) -> dict[str, Any]:
    """A packed object: `names` are texts, or {name: names} for an object, {name: [names]} for
    a list of objects."""
    if not isinstance(names, list) or not isinstance(values, list) or len(values) < len(names):
        raise InputError(f"{where}: a packed frame does not have the fields of frames[0]", path)
    out: dict[str, Any] = {}
    for name, value in zip(names, values, strict=False):
        if isinstance(name, str):
            out[name] = value
        elif isinstance(name, dict) and len(name) == 1:
            key, inner = next(iter(name.items()))
            if isinstance(inner, list) and len(inner) == 1 and isinstance(inner[0], list):
                items = value if isinstance(value, list) else []
                out[key] = [_unpack(inner[0], item, f"{where}.{key}", path) for item in items]
            else:
                out[key] = _unpack(inner, value, f"{where}.{key}", path)
        else:
            raise InputError("frames[0] of a packed recording does not list names", path)
    return out


def _stamps(frames: list[_LeapFrame]) -> Stamps | None:
    """The frames' microseconds, None where they have none."""
    stamps = [f.timestamp for f in frames]
    return None if all(s is None for s in stamps) else Stamps(stamps, "timestamp", "us")


def _rate(frames: list[_LeapFrame], recording: _Recording, path: Path) -> float | None:
    rates = [f.current_frame_rate for f in frames if f.current_frame_rate]
    if rates:
        return float(np.median(rates))
    stated = None if recording.metadata is None else recording.metadata.frame_rate
    return None if stated is None else as_fps(stated, path)


FORMATS = (
    Format(
        "Leap Motion",
        "LeapJS playback .json (no wrist); frames of Ultraleap's service, digits of bones from"
        " `prev_joint` to `next_joint`",
        "by name",
        "mm",
        "both",
        "`frames` in the JSON, `prev_joint`",
        kinds={"leap": read_leap},
        ways=(Way("fields", lambda fields, data: "frames" in fields and is_leap(data), read_leap),),
    ),
)
