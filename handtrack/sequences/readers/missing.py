"""What says "not seen" in JSON, in one form: null for a hand, a frame or a joint."""

from __future__ import annotations

import re
from typing import Any

from handtrack.hand.skeleton import ORDER_JOINTS

# a text in the place of a value, as tables and languages without a NaN write one
_TEXT = re.compile(rb'(?<=[\[:,\s])"(?:[nN]a[nN]|NAN|null|NULL)?"(?=\s*[,\]}])')
_JOINTS = frozenset(k * n for n in ORDER_JOINTS.values() for k in (1, 3))
"""Lengths of lists that are of one hand's joints or numbers."""
_MATRIX = 16
"""Numbers of a point at most."""
_WIDE = 15
"""An object of more names than this, with numbers under the first, is of joints."""


def texts_as_null(data: bytes) -> bytes:
    """JSON text with null for "", "NaN" and "null"."""
    return _TEXT.sub(b"null", data) if b'""' in data or b'n"' in data.lower() else data


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
