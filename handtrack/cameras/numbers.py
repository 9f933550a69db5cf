"""Numbers of calibration files, checked before they become a camera's."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError, shown
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.units import METRES, Unit

Array = NDArray[np.float64]
# no camera has as many pixels, is as far away, is turned as often or has a longer name
_PIXELS, _FAR, _TURNS, _LONGEST = 100_000, 1e9, 100.0, 200
_LENGTH = re.compile(r"(?P<number>\d{1,9}(\.\d{1,9})?)?[ ]?(?P<unit>m|cm|mm)")


def metres_of(unit: str) -> float:
    """A unit of length [m]: m, cm, mm, or so many of them, as a board's square is ("42mm").

    Raises:
        SettingsError: it is neither.
    """
    found = _LENGTH.fullmatch(unit.strip())
    metres = 0.0
    if found is not None:
        metres = float(found["number"] or 1) * METRES[cast(Unit, found["unit"])]
    if not metres:
        raise SettingsError(
            f"unit {shown(unit, 40)} is unknown, expected m, cm, mm or a length as in 42mm"
        )
    return metres


def numbers(value: Any, what: str, *shapes: tuple[int, ...]) -> Array:
    """Numbers in one of some shapes; a flat list is as good as rows.

    Raises:
        InputError: text, NaN, numbers that are no place of a camera's, another shape.
    """
    flat, shape = _flat(value, what)
    if not all(abs(x) < _FAR for x in flat):  # as is NaN
        raise InputError(f"{what} holds a number that is not finite")
    counts = {math.prod(s) for s in shapes}
    if shapes and (len(flat) not in counts or shape not in (*shapes, (len(flat),))):
        wanted = " or ".join(" x ".join(map(str, s)) for s in shapes)
        has = f"shape {shape}" if len(flat) in counts else f"{len(flat)} numbers"
        raise InputError(f"{what} has {has}, expected {wanted} numbers")
    return np.array(flat, dtype=np.float64)


def _flat(value: Any, what: str) -> tuple[list[float], tuple[int, ...]]:
    """The numbers of a list, or of a list of lists, and its shape."""
    rows = value if isinstance(value, list) else [value]
    nested = bool(rows) and all(isinstance(row, list) for row in rows)
    if nested and len({len(row) for row in rows}) > 1:
        raise InputError(f"{what} has rows of different length")
    flat = [x for row in rows for x in row] if nested else rows
    for x in flat:
        if isinstance(x, bool) or not isinstance(x, int | float):
            raise InputError(f"{what} holds {shown(x, 40)}, expected numbers")
    return flat, (len(rows), len(rows[0])) if nested else (len(flat),)


def size(value: Any, what: str) -> tuple[int, int]:
    """Width and height of the pictures [px]."""
    width, height = numbers(value, what, (2,))
    if not (0 < width < _PIXELS and 0 < height < _PIXELS and width % 1 == height % 1 == 0):
        raise InputError(f"{what} is {width:g} x {height:g}, expected whole numbers of pixels")
    return int(width), int(height)


def name(value: Any, where: str) -> str:
    """A camera's name."""
    if isinstance(value, bool) or not isinstance(value, str | int) or len(str(value)) > _LONGEST:
        raise InputError(f"{where} has the name {shown(value, 40)}, expected text")
    return str(value)


def rotation(value: Array) -> Array:
    """(3, 3), of a matrix or of axis times angle."""
    if value.size == 9:
        return value.reshape(3, 3)
    if np.linalg.norm(value) > _TURNS:
        raise InputError(f"rotation is {np.linalg.norm(value):.3g} rad, expected axis times angle")
    return vector_to_matrix(value.ravel())


def entry(table: Mapping[str, Any], keys: tuple[str, ...], where: str) -> Any:
    """The first of some keys that is there.

    Raises:
        InputError: none is.
    """
    for key in keys:
        if key in table:
            return table[key]
    raise InputError(f"{where} has no {' or '.join(keys)}")


def as_number(word: str, what: str) -> float:
    """A number that stands in a text."""
    try:
        return float(word)
    except ValueError:
        raise InputError(f"{what} holds {shown(word, 40)}, expected numbers") from None
