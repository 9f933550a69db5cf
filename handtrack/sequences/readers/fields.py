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

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import N_JOINTS
from handtrack.hand.units import METRES, Unit
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import UNUSED, as_side, joint_name, words
from handtrack.sequences.readers.axis_lists import axis_keys, column_keys, with_joints
from handtrack.sequences.readers.joint_frames import as_frames, frames_and_sure
from handtrack.sequences.readers.jsontext import nested_numbers, numbers
from handtrack.sequences.readers.raw import (
    Array,
    NotJointsError,
    Raw,
    Shown,
    as_fps,
    as_hand,
    as_unit,
    stem,
)
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import (
    is_confidence,
    is_frame_number,
    is_hand_label,
    joints_key,
    looks_meant,
    may_be_hand_label,
    time_unit,
)

FINEST = ("ns", "us", "ms", "s", "")
"""Of several times the one of the finest stated unit is taken."""
RATES = (
    *("fps", "frame_rate", "framerate", "sample_rate", "hz", "frames_per_second", "rate"),
    *("sampling_rate", "sampling_frequency", "frequency", "freq", "fs", "video_fps"),
    *("frame_rate_hz", "sample_rate_hz", "sampling_rate_hz"),
)
UNIT_KEYS = ("unit", "units")
_FEWEST = 4
"""Fewer joints by name are no hand."""


def _detector(fields: Mapping[str, Any], key: str) -> str:
    """Whose landmarks the joints under a key are, where that is plain; else "".

    "World landmarks" is MediaPipe's word, and what `detect` writes has its pictures beside.
    """
    said = fields.get("detector")
    if isinstance(said, str):
        return said
    from_pictures = "size_px" in fields and any("image_px" in str(k) for k in fields)
    return "mediapipe" if from_pictures else detector_of(key)


def detector_of(key: str) -> str:
    """Whose landmarks the joints under a name are, where it says so: "world landmarks" is
    MediaPipe's word; else ""."""
    return "mediapipe" if {"world", "landmarks"} <= set(words(key)) else ""


def from_fields(fields: Mapping[str, Any], path: Path) -> Raw:
    """One hand's Raw from named fields; what else there is and looks like no joints, hand or
    time is left out.

    Raises:
        NotJointsError: no joints under any known name.
        InputError: a field has the wrong shape or value, named in the message, or looks like a
            hand or a time and is not understood.
    """
    fields = _with_columns(fields, path)
    key = joint_key(fields, path)
    said = joints_key(key)
    joints, fourth = frames_and_sure(fields[key], path, key)
    n = len(joints)
    unit = None if said is None else said.unit
    stated = next((fields[k] for k in UNIT_KEYS if fields.get(k) is not None), None)
    if unit is None and stated is not None:
        unit = as_unit(stated, path)
    raw = Raw(joints, path, stem(path), unit=unit, hand=None if said is None else said.hand)
    there = {k: v for k, v in fields.items() if v is not None}
    label = next((k for k in there if is_hand_label(k)), None)
    label = label or next((k for k in there if may_be_hand_label(k) and as_side(there[k])), None)
    if label is not None:
        raw.hand = as_hand(there[label], path, label)
    if fields.get("order") is not None:
        raw.order = str(fields["order"])
    rate = next((k for k in there if k.lower() in RATES), None)
    if rate is not None:
        raw.fps = as_fps(there[rate], path)
    raw.name = str(fields.get("name") or raw.name)
    raw.subject = str(fields.get("subject") or "")
    raw.detector = _detector(fields, key)
    clocks = [k for k in there if time_unit(k) is not None and not isinstance(there[k], bool)]
    if clocks:
        clock = min(clocks, key=lambda k: FINEST.index(time_unit(k) or ""))
        raw.stamps = Stamps(there[clock], clock, time_unit(clock) or None)
    frame = next((k for k in there if is_frame_number(k) and np.size(there[k]) == n), None)
    if frame is not None:
        raw.frame_index = frame_numbers(there[frame], n, path, frame)
    sure = next((k for k in there if is_confidence(k)), None)
    if sure is not None:
        fourth = _confidence(there[sure], joints, path)
    raw.confidence = fourth
    raw.truth = _truth(fields, key, unit, joints, path)
    raw.shown = shown_by(fields, key, joints, path) if raw.detector else None
    _refuse_meant(there, path)
    unused = [k for k, v in there.items() if _of_joints(v) is float and not is_confidence(k)]
    if unused:
        raw.notes = (*raw.notes, f"not used: {shown(', '.join(unused[:8]))}")
    return raw


_SIZES = ("size_px", "image_size", "picture_size", "frame_size", "video_size", "resolution")


def shown_by(fields: Mapping[str, Any], key: str, joints: Array, path: Path) -> Shown | None:
    """Where a picture shows a detector's joints, by `image_px` or landmarks beside those in space.

    Raises:
        InputError: what `detect` writes of the pictures has another shape, or is no size.
    """
    ours = fields.get("image_px")
    if fields.get("one_size", True) is False:  # pictures of several lenses
        return None
    if ours is not None:
        if np.shape(ours) != (len(joints), N_JOINTS, 2):
            expected = (len(joints), N_JOINTS, 2)
            raise InputError(f"image_px has shape {np.shape(ours)}, expected {expected}", path)
        return Shown(np.asarray(ours, dtype=np.float64), size_of(fields, path))
    for name, value in fields.items():
        if name == key or not isinstance(value, np.ndarray) or value.ndim != 3:
            continue
        beside = "world" not in words(name) and {"landmarks", "image"} & set(words(name))
        if beside and value.shape[:2] == joints.shape[:2] and value.dtype.kind in "fiu":
            points = np.where(np.isfinite(value).all(-1, keepdims=True), value, np.nan)
            return Shown(points[..., :2].astype(np.float64), size_of(fields, path))
    return None


def size_of(fields: Mapping[str, Any], path: Path) -> tuple[int, int] | None:
    """(width, height) of pictures [px] by name; None where nothing says it.

    Raises:
        InputError: it is none.
    """
    there = {key.lower(): value for key, value in fields.items() if value is not None}
    name = next((n for n in _SIZES if n in there), None)
    if name is not None:
        size = there[name]
    else:
        sides = [
            next((there[k] for k in (f"image_{side}", f"frame_{side}", side) if k in there), None)
            for side in ("width", "height")
        ]
        if None in sides:
            return None
        name, size = "width, height", sides
    if isinstance(size, Mapping):
        size = [size.get("width"), size.get("height")]
    array = np.atleast_1d(np.asarray(size))
    if array.shape != (2,) or array.dtype.kind not in "iuf" or not (array > 0).all():
        raise InputError(f"{name} is {str(size)[:40]}, expected width and height", path)
    return int(array[0]), int(array[1])


_TOLD = ("rejected",)
"""Arrays of our own export that are no part of what was observed."""


def _refuse_meant(fields: Mapping[str, Any], path: Path) -> None:
    for key, value in fields.items():
        if _of_joints(value) is bool and key not in _TOLD and not is_confidence(key):
            raise InputError(
                f"{key[:40]!r} is true or false of each joint and is not understood: name it valid"
                " (true where it is seen), or leave it out",
                path,
            )
        kind = looks_meant(key)
        # what `handtrack export` writes of events is not of the frames
        known = time_unit(key) is not None or isinstance(value, dict) or key.startswith("event_")
        if kind in ("a time", "a hand") and not known:
            raise InputError(
                f"{key[:40]!r} looks like {kind} and is not understood: name it"
                f" {'time_s' if kind == 'a time' else 'hand'}, or leave it out",
                path,
            )


def _of_joints(value: Any) -> type | None:
    """bool or float, where a value holds one of these for each joint; else None."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "b" and value.ndim == 2:
            return bool
        numbers = value.dtype.kind in "fiu" and value.ndim == 2 and value.shape[1] == N_JOINTS
        return float if numbers else None
    row = value[0] if isinstance(value, list) and value else None
    if not isinstance(row, list) or len(row) != N_JOINTS:
        return None
    kinds = {type(x) for x in row}
    return bool if kinds == {bool} else float if kinds <= {int, float} else None


def names_joints(key: str) -> bool:
    """Whether a name is of joints, and not of true ones."""
    said = joints_key(key)
    return said is not None and not said.truth


def joint_columns(fields: Mapping[str, Any]) -> dict[str, int]:
    """Which joint each name is, where names are of joints with a column of places each."""
    said = {k: joint_name(words(k)) for k, v in fields.items() if _may_be_column(v)}
    known = {k: s for k, s in said.items() if s is not None and s.number is None}
    joints = dict(zip(known, settle(known.values()), strict=True))
    found = {k: j for k, j in joints.items() if j is not None and j != UNUSED}
    return found if len(found) >= _FEWEST else {}


def _may_be_column(value: Any) -> bool:
    """Whether it may be one joint's places: a list of them, or lists of its x, y and z."""
    return isinstance(value, list | np.ndarray) or (
        isinstance(value, dict) and axis_keys(value) is not None
    )


def _with_columns(fields: Mapping[str, Any], path: Path) -> Mapping[str, Any]:
    """With the joints as one array where each has one of its own."""
    key = next((k for k in fields if names_joints(k) and isinstance(fields[k], dict)), None)
    inside = fields[key] if key is not None else fields
    if key is None and any(names_joints(k) for k in fields):
        return fields
    if column_keys(inside) is not None:
        return {k: v for k, v in fields.items() if k != key} | with_joints(
            inside, path, key or "joints"
        )
    columns = joint_columns(inside)
    if not columns:
        return fields
    arrays = {name: _column(inside[name], path, name) for name in columns}
    n = len(next(iter(arrays.values())))
    joints = np.full((n, N_JOINTS, 3), np.nan)
    for name, joint in columns.items():
        if arrays[name].shape != (n, 3):
            raise InputError(f"{name} has shape {arrays[name].shape}, expected ({n}, 3)", path)
        joints[:, joint] = arrays[name]
    rest = {k: v for k, v in fields.items() if k != key and k not in columns}
    return rest | {key or "joints": joints}


def _column(value: Any, path: Path, name: str) -> Array:
    """(T, 3) places of one joint."""
    keys = axis_keys(value) if isinstance(value, dict) else None
    if keys is None:
        return nested_numbers(value, path, name)
    axes = [nested_numbers(value[k], path, f"{name}.{k}") for k in keys]
    if len({a.shape for a in axes}) > 1:
        raise InputError(f"{name}: {', '.join(keys)} are of different length", path)
    return np.stack(axes, axis=-1)


def _truth(
    fields: Mapping[str, Any], key: str, unit: Unit | None, joints: Array, path: Path
) -> Array | None:
    """The true joints in the joints' unit, None where there are none."""
    said = {k: s for k in fields if (s := joints_key(k)) is not None and s.truth}
    name = next((k for k in said if fields[k] is not None), None)
    if name is None:
        return None
    truth = as_frames(fields[name], path, name)
    if truth.shape != joints.shape:
        raise InputError(f"{name} has shape {truth.shape}, {key} has {joints.shape}", path)
    of_truth = said[name].unit
    if of_truth is None or of_truth == unit:
        return truth
    if unit is None:
        raise InputError(f"{name} states a unit, {key} does not: name it joints_m or so", path)
    return truth * (METRES[of_truth] / METRES[unit])


def joint_key(fields: Mapping[str, Any], path: Path) -> str:
    """The name under which `fields` hold the joints.

    Raises:
        NotJointsError: there is none (with the names that are there).
        InputError: there are several.
    """
    keys = [k for k in fields if fields[k] is not None and names_joints(k)]
    if len(keys) > 1:
        # MediaPipe's world landmarks, and not those in the picture; names of what joints are of
        worlds = [k for k in keys if "world" in words(k)]
        keys = worlds or [k for k in keys if not isinstance(fields[k], str)] or keys
    if not keys:
        there = shown(", ".join(list(map(str, fields))[:8])) or "nothing"
        shaped = any(
            isinstance(v, np.ndarray) and v.shape[-2:] == (N_JOINTS, 3) for v in fields.values()
        )
        choose = " (--key NAME says which is the joints)" if shaped else ""
        text = f"no joints in it: expected joints_m or joints, found {there}{choose}"
        raise NotJointsError(text, path)
    if len(keys) > 1:
        raise InputError(f"both {keys[0]} and {keys[1]} are given, expected one of them", path)
    return keys[0]


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
    given = nested_numbers(value, path, "confidence")
    if given.dtype.kind == "b":  # seen or not
        given = given.astype(np.float64)
    n, per_frame = joints.shape[:2]
    if given.shape in ((per_frame,), ()) and n == 1 and given.shape != (1,):
        given = np.broadcast_to(given, (1, per_frame))
    shape = (n, per_frame) if given.ndim == 2 else (n,)
    return numbers(given, path, "confidence", shape)
