"""Reader of JSON and JSON-lines joints.

JSON: a list of frames (each 21 x 3 or 63 numbers; so is FreiHAND's `*_xyz.json`), a list of
frame objects, or one object with the names in `fields`. JSON lines: one frame a line, as an
array or as an object such as {"time": 0.1, "joints": [...], "confidence": ..., "hand": "left"};
frames of both hands may alternate. WebXR, OpenXR, MediaPipe and engines have their own names and
nestings of the same:

    {"time_ms": 12.5, "handedness": "left", "joints": {"wrist": [x, y, z], "thumb-tip": ...}}
    {"timestamp": 12.5, "left": {"wrist": ...} or null, "right": {...}}
    {"timestamp": 12.5, "hands": [{"handedness": "left", "joints": ...}]}
    {"worldLandmarks": [[{"x", "y", "z"}, ...]], "handedness": [[{"categoryName": "Left"}]]}
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Items
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.readers import (
    hot3d,
    keypoints_2d,
    rosbridge,
    text_table,
    ultraleap,
    visionpro,
)
from handtrack.sequences.readers.alike import FEWEST, forms_of, read_alike
from handtrack.sequences.readers.both_hands import of_sides, two_hands
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.fields import from_fields
from handtrack.sequences.readers.flat_json import with_depth
from handtrack.sequences.readers.found import CONTAINERS, MOST_HANDS, MOST_NAMES, hands_in
from handtrack.sequences.readers.joint_frames import as_frames
from handtrack.sequences.readers.json_lines import forms_of_lines, lines_in
from handtrack.sequences.readers.json_objects import (
    as_clip,
    by_number,
    is_clip,
    unwrapped,
    with_frames_above,
    with_what_it_says,
)
from handtrack.sequences.readers.json_table import table_of
from handtrack.sequences.readers.jsontext import blanks_as_null, decode, is_blank, refuse_nothing
from handtrack.sequences.readers.number_text import Forms
from handtrack.sequences.readers.pictures import flat
from handtrack.sequences.readers.points import are_points, has_names
from handtrack.sequences.readers.raw import NotJointsError, Raw, stem
from handtrack.sequences.readers.record_places import Places
from handtrack.sequences.readers.records import read_records
from handtrack.sequences.readers.spelling import LISTS, in_small_letters
from handtrack.sequences.readers.text_places import with_places

_LARGE = 1_000_000


def read_any(data: bytes, path: Path) -> list[Raw]:
    """JSON or JSON lines; errors as these."""
    return read_lines(data, path) if is_lines(data) else read_json(data, path)


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
        NotJointsError: no joints in any line.
        InputError: a line that is not JSON or not a frame (with its number).
    """
    refuse_nothing(data, path)
    first = next(lines_in(data), None)
    forms = None if first is None or _is_of_its_own(first[1]) else forms_of_lines(data)
    if forms and (quick := alike(forms[0], Places("line", forms[1]), path)) is not None:
        return quick
    lines = list(lines_in(data))
    places = Places("line", [n for n, _ in lines])
    try:  # all at once is faster, but cannot say which line is wrong
        values = decode(b"[" + b",".join(line for _, line in lines) + b"]", list[Any], path)
    except InputError:
        values = []
    if len(values) != len(lines):
        values = [decode(line, Any, path, first_line=n) for n, line in lines]
    values = with_places(in_small_letters(values))
    table = table_of(values)
    if table is not None:
        return text_table.read_table(table, path)
    return flat_too(lambda v: _frames(v, places, path), values)


_OF_THEIR_OWN = (hot3d, rosbridge, visionpro)


def _is_of_its_own(line: bytes) -> bool:
    """Whether a line is of a source whose frames are no records of joints."""
    try:
        first = msgspec.json.decode(line)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return False
    return isinstance(first, dict) and any(of.is_frame(first) for of in _OF_THEIR_OWN)


def _of_source(
    values: list[Any], places: Items[str], path: Path, about: dict[str, Any] | None = None
) -> list[Raw] | None:
    """The hands of frames as a source of its own has them."""
    first = next((v for v in values if v), None)
    if isinstance(first, dict):
        if hot3d.is_frame(first):
            return hot3d.read_lines(values, places, path)
        if rosbridge.is_frame(first):
            return rosbridge.read_frames(values, places, path)
        if visionpro.is_frame(first):
            return visionpro.read_lines(values, places, path)
    if ultraleap.any_in(values):
        return ultraleap.read_frames(values, places, path, about)
    return None


def _frames(
    values: list[Any], places: Items[str], path: Path, about: dict[str, Any] | None = None
) -> list[Raw]:
    found = _of_source(values, places, path, about)
    return found or read_records(values, places, path, about)


def alike(
    forms: Forms, places: Items[str], path: Path, about: dict[str, Any] | None = None
) -> list[Raw] | None:
    """The hands of records of few forms that `read_records` would read; None of others."""
    first = in_small_letters([decode(form.first, Any, path) for form in forms.forms])
    if not all(v is None or isinstance(v, dict) for v in first) or table_of(first[:1] * FEWEST):
        return None
    some: dict[str, Any] = next((v for v in first if v), {})
    if any(of.is_frame(some) for of in _OF_THEIR_OWN):
        return None
    if ultraleap.any_in(first):
        found = read_alike(forms, places, path, about, ultraleap.as_records)
        return None if found is None else ultraleap.with_unit(found)
    if keypoints_2d.read_other(first, path) is not None:
        return None
    return read_alike(forms, places, path, about)


def _list_of_alike(data: bytes, path: Path) -> list[Raw] | None:
    """The hands of a list of frames of few forms, or of one in an object; None of anything else."""
    data = data.lstrip(b"\xef\xbb\xbf \t\r\n")
    try:
        if data[:1] == b"[":
            forms = forms_of(data)
            about: dict[str, Any] = {}
        else:
            fields = decode(data, dict[str, msgspec.Raw], path)
            key = max(fields, key=lambda k: len(bytes(fields[k])))
            if key == "instance_info":
                return keypoints_2d.of_forms(forms_of(bytes(fields[key])), path)
            about = {k: decode(bytes(v), Any, path) for k, v in fields.items() if k != key}
            if key not in (*LISTS, *CONTAINERS) or any(isinstance(v, list) for v in about.values()):
                return None
            forms = forms_of(bytes(fields[key]))
            about = with_what_it_says(in_small_letters(about))
        if forms is None:
            return None
        return alike(forms, Places("frame", range(len(forms))), path, about)
    except (InputError, msgspec.MsgspecError):
        return None


def read_json(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a JSON file.

    Raises:
        NotJointsError: well-formed, but without joints.
        InputError: malformed, or a field that does not fit.
    """
    if len(data) > _LARGE:
        refuse_nothing(data, path)
        quick = _list_of_alike(data, path)
        if quick is not None:
            return quick
    return from_value(decode(data, Any, path), path)


def flat_too(read: Callable[[Any], list[Raw]], value: Any) -> list[Raw]:
    """What a reader makes of a value; where it refuses it, of the same as places in a picture.

    Raises:
        NotJointsError, InputError: as the reader.
    """
    try:
        return read(value)
    except InputError as error:
        deep = with_depth(value)
        if deep is None:
            raise
        try:
            found = read(deep)
        except InputError:
            raise error from None
        if any(np.nan_to_num(raw.joints[..., 2]).any() for raw in found):
            raise
        return [flat(raw) for raw in found]


def from_value(value: Any, path: Path) -> list[Raw]:
    """The sequences of lists, objects and numbers, wherever they were stored.

    Raises:
        NotJointsError, InputError: as `read_json`.
    """
    return flat_too(lambda v: _from_value(v, path), with_places(in_small_letters(value)))


def _from_value(value: Any, path: Path) -> list[Raw]:
    table = table_of(value)
    if table is not None:
        return text_table.read_table(table, path)
    in_pictures = keypoints_2d.read_other(value, path)
    if in_pictures is not None:
        return in_pictures
    if isinstance(value, dict):
        value = blanks_as_null([value])[0] or value
        return _of_source([value], ["the object"], path) or _with_world(_object(value, path), value)
    if not isinstance(value, list):
        raise NotJointsError("no joints in it: expected a list of frames or an object", path)
    if not value:
        raise InputError("the list of frames is empty", path)
    value = blanks_as_null(value)
    if not any(isinstance(v, list | int | float | dict) for v in value):
        raise NotJointsError("no joints in it: the list holds no frames", path)
    if _are_frames(value):
        return _listed(value, path)
    if any(isinstance(v, dict) for v in value):  # joints of one frame
        return read_records([value], ["the list"], path)
    return two_hands(Raw(as_frames(value, path, "the list"), path, stem(path)))


def _with_world(raws: list[Raw], value: dict[str, Any]) -> list[Raw]:
    """With a note where the world is Unity's: MRTK records a pose's `items` in it."""
    items = value.get("items")
    first = items[0] if isinstance(items, list) and items else None
    if isinstance(first, dict) and "joint" in first and isinstance(first.get("pose"), dict):
        note = "MRTK's world is left-handed: --mirror z turns it round, and tells which hand it is"
        return [replace(raw, notes=(*raw.notes, note)) for raw in raws]
    return raws


def _are_frames(value: list[Any]) -> bool:
    """Whether a list is of frames that only `read_records` can read."""
    if are_points(value):
        return False
    some = next((v for v in value if not is_blank(v)), None)
    if isinstance(some, dict):
        return True
    return isinstance(some, list) and (any(isinstance(v, dict) for v in some) or has_names(some))


def _listed(values: list[Any], path: Path, about: dict[str, Any] | None = None) -> list[Raw]:
    return _frames(values, Places("frame", range(len(values))), path, about)


def _object(value: dict[str, Any], path: Path) -> list[Raw]:
    if len(value) > MOST_NAMES:
        raise NotJointsError(f"an object of {len(value)} names is of no hands", path)
    value = as_clip(with_what_it_says(unwrapped(with_frames_above(value), path)))
    # a frame has no more than a few hands: a longer list is of frames
    long = [k for k in CONTAINERS if isinstance(value.get(k), list) and len(value[k]) > MOST_HANDS]
    for key in (*LISTS, *long):
        frames = value.get(key)
        if frames == [] and key == "frames":
            raise InputError("frames is empty", path)
        if not isinstance(frames, list) or not any(map(_may_hold_names, frames)):
            continue
        if not are_points(frames) and (ultraleap.any_in(frames) or any(map(hands_in, frames))):
            return _listed(frames, path, value)
    numbered = by_number(value)
    if numbered:
        return _listed(numbered, path)
    found = hands_in(value)
    seen = any(isinstance(f.value, dict | list) and are_points(f.value) for f in found)
    if seen and not is_clip(value, path):
        return read_records([value], ["the object"], path)
    return [raw for fields in of_sides(value) for raw in two_hands(from_fields(fields, path))]


def _may_hold_names(frame: Any) -> bool:
    """Whether a frame is an object, or a list of joints that are."""
    if isinstance(frame, list):
        return has_names(frame) and are_points(frame)
    return isinstance(frame, dict)


FORMATS = (
    Format(
        "JSON, JSON lines",
        "frames of 21 x 3 or 63 numbers, of `{x, y, z}`, of joints by name (MediaPipe's, OpenXR's,"
        " Unity's, Ultraleap's, ARKit's and more, in any case and style), one hand or both under"
        " `hands`, `left`, `handedness` ...; null and empty records are missing frames;"
        " FreiHAND's `*_xyz.json`",
        "handtrack, or by name",
        "m",
        "one or both",
        "its text",
        suffixes=(".json", ".jsonl", ".ndjson"),
    ),
    Format(
        "WebXR, OpenXR, MRTK",
        "JSON lines of named joints, or of 25 or 26; one hand a line or both",
        "by name, webxr, openxr",
        "m",
        "one or both",
        "names of joints",
        kinds={"webxr": read_any, "openxr": read_any},
    ),
)
