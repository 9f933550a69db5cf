"""JSON as readers take it: decoded so that an error names the file and the place in it.

Lists become arrays of numbers; what says "not seen" takes one form: null for a hand, a frame or a
joint.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import ORDER_JOINTS
from handtrack.sequences.readers.raw import Array, NotJointsError

_BYTE = re.compile(r" \(byte (\d+)\)$")
# Python's json module writes NaN, which JSON does not have
_NAN = re.compile(rb"(?<=[\[:,\s])NaN(?=[\],}\s])")


def as_utf8(data: bytes) -> bytes:
    """Text in UTF-16 with a byte order mark, as spreadsheets save it, in UTF-8; else the same."""
    if data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        return data
    try:
        return data.decode("utf-16").encode()
    except UnicodeError:
        return data


def decode(data: bytes, kind: Any, path: str | Path, first_line: int = 1) -> Any:
    """Decode JSON text as `kind`; NaN reads as null, and where any kind will do so do "" and "NaN".

    Args:
        data: UTF-8 text, with or without a byte order mark; or UTF-16 with one.
        kind: a type for msgspec; unknown fields are skipped unparsed.
        path: named in errors.
        first_line: the number of the text's first line, for lines of a longer file.

    Raises:
        InputError: malformed (with line and byte), cut short, or not of that type (with the
            field's name).
    """
    data = as_utf8(data).removeprefix(b"\xef\xbb\xbf")
    data = without_nan(data)
    if kind is Any or kind == list[Any]:  # fields of a known type may be texts, and empty
        data = texts_as_null(data)
    try:
        return msgspec.json.decode(data, type=kind)
    except msgspec.ValidationError as error:
        raise InputError(misfit(error) + _line(first_line), path) from None
    except msgspec.DecodeError as error:
        raise InputError(_place(str(error), data, first_line), path) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"the text is not UTF-8 (byte {error.start} of a string){_line(first_line)}", path
        ) from None
    except RecursionError:
        raise InputError(f"the JSON is nested too deeply{_line(first_line)}", path) from None


def without_nan(data: bytes) -> bytes:
    """JSON text with null for NaN."""
    return _NAN.sub(b"null", data) if b"NaN" in data else data


def _line(first_line: int) -> str:
    return f" (line {first_line})" if first_line > 1 else ""


def misfit(error: msgspec.ValidationError) -> str:
    """What does not fit, and in which field."""
    text = str(error).replace(" - at `$.", " at `").replace(" - at `$", " at `")
    return text[:1].lower() + text[1:]


def _place(message: str, data: bytes, first_line: int) -> str:
    found = _BYTE.search(message)
    if found is None:  # "Input data was truncated"
        line = data.count(b"\n") + first_line
        cure = "leave that line out" if first_line > 1 else "its last brackets are not there"
        return f"the JSON is cut short: it ends after {len(data)} bytes (line {line}): {cure}"
    byte = int(found[1])
    line = data[:byte].count(b"\n") + first_line
    reason = message[: found.start()].removeprefix("JSON is malformed: ")
    cure = ": leave that comma out" if "trailing comma" in reason else ""
    return f"wrong JSON: {reason} at byte {byte} (line {line}){cure}"


_QUOTES = bytes.maketrans(b"()'", b'[]"')
_PRINTED = re.compile(rb"\[?\s*(?:[\[({]\s*)*(?:['(]|landmark\s*\{|np\.)")
_NUMPYS = re.compile(rb"(?:np\.|numpy\.)?(?:float|int)\d+\(([^()]*)\)")
_ARRAY = re.compile(rb"\s*\[\s*(?:\[\s*)+-?(?:\d[\d.e+-]*|nan)\s+(?:-?[\d.]|nan)")
_WORDS = {b"None": b"null", b"nan": b"null", b"True": b"true", b"False": b"false"}
_LANDMARK = re.compile(rb"landmark\s*\{([^{}]*)\}")
_PLACE = re.compile(rb"x:\s*(\S+)\s+y:\s*(\S+)\s+z:\s*(\S+)")
_HAND = 21


def of_python(data: bytes) -> bytes:
    """JSON of what Python prints: tuples, names in single quotes, None, arrays of NumPy; and
    MediaPipe's `landmark { x: ... }`. Anything else as it is."""
    if _ARRAY.match(data[:200]):
        return _arrays(data)
    if not _PRINTED.match(data.removeprefix(b"\xef\xbb\xbf")[:200]):
        return data
    if b'"' in data:
        return data
    if _LANDMARK.search(data[:400]):
        return _landmarks(data)
    data = _NUMPYS.sub(rb"\1", data) if b"(" in data else data
    data = data.translate(_QUOTES)
    return re.sub(rb"\b(?:None|nan|True|False)\b", lambda m: _WORDS[m[0]], data)


def _arrays(data: bytes) -> bytes:
    """A list of the arrays that stand one behind the other, as NumPy prints them."""
    if b"," in data or b"..." in data:
        return data
    data = re.sub(rb"(?<=[\w.])\s+(?=[-\w.])", b",", data)
    data = re.sub(rb"\]\s*\[", b"],[", data)
    data = re.sub(rb"(?<=\d)\.(?=[],\seE])", b".0", data)
    return b"[" + re.sub(rb"\bnan\b", b"null", data.strip()) + b"]"


def _landmarks(data: bytes) -> bytes:
    """Frames of 21 landmarks, one behind the other."""
    places = [_PLACE.search(inside) for inside in _LANDMARK.findall(data)]
    if not places or len(places) % _HAND or not all(places):
        return data
    rows = [b"[" + b",".join(m.groups()) + b"]" for m in places if m is not None]
    hands = [b",".join(rows[i : i + _HAND]) for i in range(0, len(rows), _HAND)]
    return b"[[" + b"],[".join(hands) + b"]]"


def one_after_another(data: bytes) -> list[Any] | None:
    """The objects of a text in which several stand one behind the other, over lines or not; None
    where it is anything else."""
    try:
        text = as_utf8(data).decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    decoder, at = json.JSONDecoder(), 0
    values: list[Any] = []
    try:
        while at < len(text):
            while at < len(text) and (text[at].isspace() or text[at] == ","):
                at += 1
            if at < len(text):
                value, at = decoder.raw_decode(text, at)
                if not isinstance(value, dict | list):
                    return None
                values.append(value)
    except (ValueError, RecursionError):
        return None
    return values if len(values) > 1 else None


def nested_array(value: Any, path: Path, what: str) -> NDArray[Any]:
    """Nested lists as an array; an error names the element that does not fit."""
    if not isinstance(value, list):
        raise InputError(f"{what} is {kind_of(value)}, expected a list", path)
    try:  # the usual case: lists of numbers, all at once
        if isinstance(value[:1][0] if value else None, list | int | float):
            return np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        pass
    items = [_place_of(v) if v else v for v in value]
    like = next(
        (v for v in items if isinstance(v, list) and any(isinstance(p, list | dict) for p in v)),
        None,
    )
    like = like or next((v for v in items if isinstance(v, list)), None)
    if like is not None:
        # null for a whole frame, for all its joints, or for a joint of a single frame
        gone = [v is None or (isinstance(v, list) and all(p is None for p in v)) for v in items]
        items = [_blank(like) if no else v for no, v in zip(gone, items, strict=True)]
    for i, item in enumerate(items):
        if isinstance(item, list) and any(isinstance(v, list | dict) for v in item):
            items[i] = [[None] * 3 if v in (None, []) else _place_of(v) for v in item]
    try:
        return np.array(items, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        raise InputError(_misfit(items, what), path) from None


def _place_of(value: Any) -> Any:
    """{x, y, z} as a list."""
    if isinstance(value, dict) and {"x", "y", "z"} <= value.keys():
        return [value["x"], value["y"], value["z"]]
    return value


def _blank(like: list[Any]) -> list[Any]:
    one = [None] * 3 if any(isinstance(v, list | dict) for v in like) else None
    return [one] * len(like)


def _misfit(items: list[Any], what: str) -> str:
    """What is wrong with lists that make no array of numbers."""
    first: tuple[int, ...] | None = None
    for i, item in enumerate(items):
        try:
            shape = np.array(item, dtype=np.float64).shape
        except (ValueError, TypeError, OverflowError):
            if isinstance(item, list):
                return _misfit(item, f"{what}[{i}]")
            return f"{what}[{i}] is {kind_of(item)}, expected a number"
        if first is not None and shape != first:
            return f"{what}[{i}] has shape {shape}, {what}[0] has {first}"
        first = shape
    return f"{what} is not an array of numbers"


def kind_of(value: object) -> str:
    """What a value of JSON is, in words."""
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


def nested_numbers(value: Any, path: Path, what: str) -> NDArray[Any]:
    """An array as it is, lists as one, else one number."""
    if isinstance(value, np.ndarray):
        return value
    if not isinstance(value, list):
        return numbers(value, path, what, ())
    return nested_array(value, path, what)


# a text in the place of a value, as tables and languages without a NaN write one
_TEXT = re.compile(rb'(?<=[\[:,\s])"(?:[nN]a[nN]|NAN|null|NULL)?"(?=\s*[,\]}])')
_BLANKS = (b'""', b'"nan"', b'"null"')
_JOINTS = frozenset(k * n for n in ORDER_JOINTS.values() for k in (1, 3))
"""Lengths of lists that are of one hand's joints or numbers."""
_MATRIX = 16
"""Numbers of a point at most."""
_WIDE = 15
"""An object of more names than this, with numbers under the first, is of joints."""


def texts_as_null(data: bytes) -> bytes:
    """JSON text with null for "", "NaN" and "null"."""
    low = data.lower()
    return _TEXT.sub(b"null", data) if any(text in low for text in _BLANKS) else data


def is_blank(value: Any) -> bool:
    """Whether a value holds nothing but null, NaN, {} and []."""
    if isinstance(value, dict):
        return all(map(is_blank, value.values()))
    if isinstance(value, list):
        return all(map(is_blank, value))
    return value is None or (isinstance(value, float) and value != value)


def blanks_as_null(values: list[Any]) -> list[Any]:
    """Frames with null in the place of hands, and of frames, that hold nothing.

    Lists of joints and objects of named joints that hold something are not looked into: readers
    of joints know what a missing joint is. What is given is changed.
    """
    for i, value in enumerate(values):
        if isinstance(value, dict | list):
            values[i] = _settled(value)
    return values


def _settled(value: Any) -> Any:
    if isinstance(value, dict):
        if is_blank(value):
            return None
        first = next(iter(value.values()))
        if len(value) <= _WIDE or not _is_point(first):
            for key, inner in value.items():
                # an empty list says that there are none, which is no hand that was not seen
                if isinstance(inner, dict | list) and inner != []:
                    value[key] = _settled(inner)
        return value
    if is_blank(value):
        if len(value) in _JOINTS and all(isinstance(v, list) and len(v) == 3 for v in value):
            return value  # points as any others, of a hand that is told of if it is never seen
        return None if not value or len(value) in _JOINTS else [None] * len(value)
    if len(value) in _JOINTS and ([] in value or {} in value):
        value = [None if v == [] or v == {} else v for v in value]
    some = next((v for v in value if v not in (None, [], {})), None)
    if isinstance(some, dict | list) and not _is_point(some):
        blanks_as_null(value)
    return value


def _is_point(value: Any) -> bool:
    """Whether a value is one of few numbers alone: a point, or nothing."""
    if isinstance(value, dict | list) and len(value) > _MATRIX:
        return False
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return all(v is None or isinstance(v, int | float | str) for v in inner)


_OF_NOTHING = b" \t\r\nnul{}[],"
"""What lines of null, {} and [] are made of: whatever says something needs more."""


def refuse_nothing(data: bytes, path: Path) -> None:
    """Refuse text in which nothing is said, told from the bytes: millions of empty frames take
    seconds to decode.

    Raises:
        NotJointsError: it is such.
    """
    closed = data.count(b"[") == data.count(b"]")
    if closed and not data.translate(None, _OF_NOTHING):
        raise NotJointsError("every frame is missing", path)
