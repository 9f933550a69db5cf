"""Lists in lists, as JSON has them, as arrays of numbers; what does not fit is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.sequences.readers.raw import Array


def nested_array(value: Any, path: Path, what: str) -> NDArray[Any]:
    """Nested lists as an array; an error names the element that does not fit."""
    if not isinstance(value, list):
        raise InputError(f"{what} is {kind_of(value)}, expected a list", path)
    try:  # the usual case: lists of numbers, all at once
        if isinstance(value[:1][0] if value else None, list | int | float):
            return np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        pass
    items = [_place(v) if v else v for v in value]
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
            items[i] = [[None] * 3 if v in (None, []) else _place(v) for v in item]
    try:
        return np.array(items, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        raise InputError(_misfit(items, what), path) from None


def _place(value: Any) -> Any:
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
