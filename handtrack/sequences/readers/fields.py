"""Joints and what goes with them under names: the keys of an npz, of a JSON object, of a line.

    joints | joints_m | joints_cm | joints_mm | xyz_mm ...   (T, N, 3), (T, 3 N), (N, 3), (3 N)
    time_ns | time_us | time_ms | time_s | time   (T,); frame | frame_index   (T,); fps
    confidence   (T,) or (T, N); truth | truth_m ...   like the joints
    hand, unit, order, name, subject   text

N is 21, or 25 (WebXR) or 26 (OpenXR).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import ORDER_JOINTS
from handtrack.sequences.clock import Stamps, TimeUnit
from handtrack.sequences.readers.raw import (
    METRES,
    Array,
    NotJointsError,
    Raw,
    Unit,
    as_fps,
    as_hand,
    as_unit,
    stem,
)

JOINT_COUNTS = sorted(set(ORDER_JOINTS.values()))
_STEMS = ("joints", "xyz", "joint_3d", "keypoints_3d")
JOINT_KEYS: dict[str, Unit | None] = dict.fromkeys(_STEMS) | {
    f"{s}_{u}": u for s in _STEMS for u in METRES
}
"""Names under which joints are found, with the unit that the name states."""
TIME_KEYS: dict[str, TimeUnit | None] = {
    "time_ns": "ns",
    "time_us": "us",
    "time_ms": "ms",
    "time_s": "s",
    "time": None,
}
"""Names of times, with the unit that the name states."""
FRAME_KEYS = ("frame_index", "frame")


def from_fields(fields: Mapping[str, Any], path: Path) -> Raw:
    """One hand's Raw from named fields; names that mean nothing here are ignored.

    Raises:
        NotJointsError: no joints under any known name.
        InputError: a field has the wrong shape or value, named in the message.
    """
    key = joint_key(fields, path)
    joints = as_frames(fields[key], path, key)
    n = len(joints)
    unit = JOINT_KEYS[key]
    if unit is None and fields.get("unit") is not None:
        unit = as_unit(fields["unit"], path)
    raw = Raw(joints, path, stem(path), unit=unit)
    if fields.get("hand") is not None:
        raw.hand = as_hand(fields["hand"], path)
    if fields.get("order") is not None:
        raw.order = str(fields["order"])
    if fields.get("fps") is not None:
        raw.fps = as_fps(fields["fps"], path)
    raw.name = str(fields.get("name") or raw.name)
    raw.subject = str(fields.get("subject") or "")
    for time_key, time_unit in TIME_KEYS.items():
        if fields.get(time_key) is not None:
            raw.stamps = Stamps(fields[time_key], time_key, time_unit)
            break
    for frame_key in FRAME_KEYS:
        if fields.get(frame_key) is not None:
            raw.frame_index = frame_numbers(fields[frame_key], n, path, frame_key)
            break
    if fields.get("confidence") is not None:
        raw.confidence = _confidence(fields["confidence"], joints, path)
    raw.truth = _truth(fields, key, unit, joints, path)
    return raw


def _truth(
    fields: Mapping[str, Any], key: str, unit: Unit | None, joints: Array, path: Path
) -> Array | None:
    """The true joints in the joints' unit, None where there are none."""
    keys: dict[str, Unit | None] = {"truth": unit} | {f"truth_{u}": u for u in METRES}
    name = next((k for k in keys if fields.get(k) is not None), None)
    if name is None:
        return None
    truth = as_frames(fields[name], path, name)
    if truth.shape != joints.shape:
        raise InputError(f"{name} has shape {truth.shape}, {key} has {joints.shape}", path)
    of_truth = keys[name]
    if of_truth == unit:
        return truth
    if unit is None or of_truth is None:
        raise InputError(f"{name} states a unit, {key} does not: name it joints_m or so", path)
    return truth * (METRES[of_truth] / METRES[unit])


def joint_key(fields: Mapping[str, Any], path: Path) -> str:
    """The name under which `fields` hold the joints.

    Raises:
        NotJointsError: there is none (with the names that are there).
        InputError: there are several.
    """
    keys = [k for k in JOINT_KEYS if fields.get(k) is not None]
    if not keys:
        there = ", ".join(list(map(str, fields))[:8]) or "nothing"
        raise NotJointsError(f"no joints in it: expected joints_m or joints, found {there}", path)
    if len(keys) > 1:
        raise InputError(f"both {keys[0]} and {keys[1]} are given, expected one of them", path)
    return keys[0]


def as_frames(value: Any, path: Path, what: str = "joints") -> Array:
    """Joints as (T, N, 3) from an array or nested lists; null = missing.

    Raises:
        InputError: not numbers, or not of a shape that makes frames of 21 (25, 26) joints.
    """
    array = value if isinstance(value, np.ndarray) else _nested(value, path, what)
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} holds {array.dtype}, expected numbers", path)
    shape = array.shape
    flat_sizes = [3 * n for n in JOINT_COUNTS]
    if array.ndim == 3 and shape[2] == 3 and shape[1] in JOINT_COUNTS:
        frames = array
    elif array.ndim == 2 and shape[1] in flat_sizes:
        frames = array.reshape(shape[0], shape[1] // 3, 3)
    elif (array.ndim == 2 and shape[1] == 3 and shape[0] in JOINT_COUNTS) or (
        array.ndim == 1 and shape[0] in flat_sizes
    ):
        frames = array.reshape(1, -1, 3)
    else:
        raise InputError(
            f"{what} has shape {shape}, expected (frames, 21, 3) or (frames, 63)", path
        )
    if not len(frames):
        raise InputError(f"{what} holds no frames", path)
    return frames.astype(np.float64)


def _nested(value: Any, path: Path, what: str) -> NDArray[Any]:
    """Nested lists as an array; an error names the element that does not fit."""
    if not isinstance(value, list):
        raise InputError(f"{what} is {_kind(value)}, expected a list", path)
    if any(not isinstance(v, list) for v in value) and any(isinstance(v, list) for v in value):
        # null for a whole frame, or for a joint of a single frame
        like = next(v for v in value if isinstance(v, list))
        value = [_blank(like) if v is None else v for v in value]
    items = []
    for item in value:
        full = item
        if isinstance(item, list) and any(isinstance(v, list) for v in item):
            full = [[None] * 3 if v is None else v for v in item]
        items.append(full)
    try:
        return np.array(items, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        raise InputError(_misfit(items, what), path) from None


def _blank(like: list[Any]) -> list[Any]:
    return (
        [[None] * 3] * len(like) if any(isinstance(v, list) for v in like) else [None] * len(like)
    )


def _misfit(items: list[Any], what: str) -> str:
    """What is wrong with lists that make no array of numbers."""
    first: tuple[int, ...] | None = None
    for i, item in enumerate(items):
        try:
            shape = np.array(item, dtype=np.float64).shape
        except (ValueError, TypeError, OverflowError):
            if isinstance(item, list):
                return _misfit(item, f"{what}[{i}]")
            return f"{what}[{i}] is {_kind(item)}, expected a number"
        if first is not None and shape != first:
            return f"{what}[{i}] has shape {shape}, {what}[0] has {first}"
        first = shape
    return f"{what} is not an array of numbers"


def _kind(value: object) -> str:
    names = {dict: "an object", list: "a list", str: "text", bool: "true or false"}
    return "null" if value is None else names.get(type(value), "a number")


def numbers(value: Any, path: Path, what: str, shape: tuple[int, ...]) -> Array:
    """Numbers of exactly that shape.

    Raises:
        InputError: not numbers, or another shape.
    """
    try:
        array = np.array(value)
    except ValueError:
        raise InputError(f"{what} is ragged, expected shape {shape}", path) from None
    if array.dtype == object:  # null among numbers
        try:
            array = array.astype(np.float64)
        except (ValueError, TypeError, OverflowError):
            raise InputError(f"{what} holds something that is not a number", path) from None
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} is not a number", path)
    if array.shape != shape:
        expected = f"shape {shape}" if shape else "one number"
        raise InputError(f"{what} has shape {array.shape}, expected {expected}", path)
    return array.astype(np.float64)


def frame_numbers(value: Any, n: int, path: Path, what: str) -> NDArray[np.int64]:
    """(n,) whole frame numbers.

    Raises:
        InputError: not n whole numbers.
    """
    array = numbers(value if n != 1 else np.atleast_1d(value), path, what, (n,))
    if not (np.abs(array) < 2**53).all() or (array != np.round(array)).any():
        raise InputError(f"{what} is not a whole number in every frame", path)
    return array.astype(np.int64)


def _confidence(value: Any, joints: Array, path: Path) -> Array:
    given = np.asarray(value) if isinstance(value, np.ndarray) else _nested_numbers(value, path)
    n, per_frame = joints.shape[:2]
    if given.shape in ((per_frame,), ()) and n == 1 and given.shape != (1,):
        given = np.broadcast_to(given, (1, per_frame))
    shape = (n, per_frame) if given.ndim == 2 else (n,)
    return numbers(given, path, "confidence", shape)


def _nested_numbers(value: Any, path: Path) -> NDArray[Any]:
    if not isinstance(value, list):
        return numbers(value, path, "confidence", ())
    return _nested(value, path, "confidence")
