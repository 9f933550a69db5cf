"""Reader of plain JSON and JSON-lines joints.

JSON: a list of frames (each 21 x 3 or 63 numbers; so is FreiHAND's `*_xyz.json`), a list of
frame objects, or one object with the names in `fields`. JSON lines: one frame a line, as an
array or as an object such as {"time": 0.1, "joints": [...], "confidence": ..., "hand": "left"};
frames of both hands may alternate.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import Hand
from handtrack.sequences.readers.fields import (
    FRAME_KEYS,
    JOINT_KEYS,
    TIME_KEYS,
    as_frames,
    from_fields,
    joint_key,
)
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import NotJointsError, Raw, as_hand, stem

Where = str
"""Where a frame stands: "line 3" or "frame 2"."""


def is_lines(data: bytes) -> bool:
    """Whether the text is JSON lines: its first line is a whole value, and more follows."""
    head, _, rest = data.lstrip(b"\xef\xbb\xbf \t\r\n").partition(b"\n")
    if not rest.strip():
        return False
    try:
        msgspec.json.decode(head.replace(b"NaN", b"null"), type=msgspec.Raw)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return True


def read_lines(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a JSON-lines file, one per hand.

    Raises:
        InputError: a line that is not JSON or not a frame (with its number).
    """
    values, places = [], []
    for number, line in enumerate(data.split(b"\n"), 1):
        if line.strip():
            values.append(decode(line, Any, path, first_line=number))
            places.append(f"line {number}")
    return _frames(values, places, path)


def read_json(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a plain JSON file.

    Raises:
        NotJointsError: well-formed, but without joints.
        InputError: malformed, or a field that does not fit.
    """
    value = decode(data, Any, path)
    if isinstance(value, dict):
        return [from_fields(value, path)]
    if not isinstance(value, list):
        raise NotJointsError("no joints in it: expected a list of frames or an object", path)
    if not value:
        raise InputError("the list of frames is empty", path)
    if any(isinstance(v, dict) for v in value):
        return _frames(value, [f"frame {i}" for i in range(len(value))], path)
    if not any(isinstance(v, list | int | float) for v in value):
        raise NotJointsError("no joints in it: the list holds no frames", path)
    return [Raw(as_frames(value, path, "the list"), path, stem(path))]


def _frames(values: list[Any], places: list[Where], path: Path) -> list[Raw]:
    """Sequences from frames that are arrays or objects, grouped by hand."""
    if not values:
        raise InputError("no frames", path)
    if not any(isinstance(v, dict) for v in values):
        return [_bare(values, places, path)]
    groups: dict[Hand | None, list[int]] = {}
    for i, value in enumerate(values):
        if not isinstance(value, dict):
            raise InputError(f"{places[i]} is not an object, others are", path)
        label = value.get("hand")
        hand = None if label is None else as_hand(label, path, f"{places[i]}: hand")
        groups.setdefault(hand, []).append(i)
    # a note such as {"subject": "A"} before the frames is not one of them
    if not any(k in v for v in values for k in JOINT_KEYS):
        raise NotJointsError(
            f"no joints in it: {places[0]} has {', '.join(list(values[0])[:8]) or 'nothing'}", path
        )
    return [
        _group([values[i] for i in group], [places[i] for i in group], path)
        for group in groups.values()
    ]


def _bare(values: list[Any], places: list[Where], path: Path) -> Raw:
    frames: list[Any] = []
    for value, place in zip(values, places, strict=True):
        frames.append(None if value is None else as_frames(value, path, place))
        if frames[-1] is not None and len(frames[-1]) != 1:
            raise InputError(f"{place} holds {len(frames[-1])} frames, expected one", path)
    return Raw(_stack(frames, places, path), path, stem(path))


def _group(values: list[dict[str, Any]], places: list[Where], path: Path) -> Raw:
    """One hand's frame objects as one object of lists, then read like any other."""
    with_joints = [v for v in values if any(v.get(k) is not None for k in JOINT_KEYS)]
    if not with_joints:
        raise InputError(f"{places[0]}: no joints, expected joints or joints_m", path)
    key = joint_key(with_joints[0], path)
    merged: dict[str, Any] = {}
    for name in ("hand", "unit", "order", "fps", "name", "subject"):
        merged[name] = next((v[name] for v in values if v.get(name) is not None), None)
    joints = []
    for value, place in zip(values, places, strict=True):
        if any(k != key and value.get(k) is not None for k in JOINT_KEYS):
            raise InputError(f"{place}: the joints are not under {key} as in other frames", path)
        given = value.get(key)
        frame = None if given is None else as_frames(given, path, f"{place}: {key}")
        if frame is not None and len(frame) != 1:
            raise InputError(f"{place}: {key} holds {len(frame)} frames, expected one", path)
        joints.append(frame)
    merged[key] = _stack(joints, places, path)
    for name in (*TIME_KEYS, *FRAME_KEYS):
        merged[name] = _column(values, name)
    merged["confidence"] = _confidences(values, places, merged[key].shape[1], path)
    raw = from_fields(merged, path)
    raw.stamps = raw.stamps and replace(raw.stamps, places=places)
    return raw


def _stack(frames: Items[np.ndarray[Any, Any] | None], places: list[Where], path: Path) -> Any:
    """(T, N, 3) from frames of which some may be missing altogether."""
    first = next((f for f in frames if f is not None), None)
    if first is None:
        raise InputError("every frame is missing", path)
    for frame, place in zip(frames, places, strict=True):
        if frame is not None and frame.shape != first.shape:
            raise InputError(
                f"{place} has {frame.shape[1]} joints, others have {first.shape[1]}", path
            )
    blank = np.full_like(first, np.nan)
    return np.concatenate([blank if f is None else f for f in frames])


def _column(values: list[dict[str, Any]], name: str) -> Any:
    """One value a frame under that name; None where no frame has it."""
    column = [v.get(name) for v in values]
    return None if all(c is None for c in column) else column


def _confidences(
    values: list[dict[str, Any]], places: list[Where], n_joints: int, path: Path
) -> Any:
    """(T, N) confidence; frames without one count fully."""
    if all(v.get("confidence") is None for v in values):
        return None
    rows = np.ones((len(values), n_joints))
    for row, value, place in zip(rows, values, places, strict=True):
        given = value.get("confidence")
        if given is None:
            continue
        try:
            array = np.array(given, dtype=np.float64)
        except (ValueError, TypeError, OverflowError):
            raise InputError(f"{place}: confidence is not a list of numbers", path) from None
        if array.shape not in ((), (n_joints,)):
            raise InputError(
                f"{place}: confidence has shape {array.shape}, expected ({n_joints},)", path
            )
        row[:] = array
    return rows
