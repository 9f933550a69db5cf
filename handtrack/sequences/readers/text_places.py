"""Places that are written as text: "0.1,0.2,0.3" as a value of JSON, and with decimal commas
"(0,1, 0,2, 0,3)", as C# prints a vector where people write numbers so."""

from __future__ import annotations

import re
from typing import Any

from handtrack.sequences.readers.table_places import numbers_in
from handtrack.sequences.titles import is_hand_label, time_unit

_COMMA = r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?"
_BETWEEN = r"(?:\s*;\s*|,?\s+)"
_THREE = rf"{_COMMA}{_BETWEEN}{_COMMA}{_BETWEEN}{_COMMA}"
_COMMA_PLACE = re.compile(rf"[(\[{{]?\s*{_THREE}\s*[)\]}}]?")
_IN_BRACKETS = re.compile(rf"[(\[]\s*{_THREE}\s*[)\]]")
_NUMBER = re.compile(_COMMA)
_LONGEST = 4000
_FIRST = 50
_LOOKED_INTO, _DEEPEST = 4, 8


def with_points(lines: list[str]) -> list[str]:
    """Lines whose places in brackets have points where they had decimal commas."""
    if not any(_IN_BRACKETS.search(line) for line in lines[:_FIRST]):
        return lines
    return [_IN_BRACKETS.sub(lambda m: _pointed(m[0]), line) for line in lines]


def _pointed(text: str) -> str:
    inner = text.strip("()[]{} ")
    return f"({' '.join(n.replace(',', '.') for n in _NUMBER.findall(inner))})"


def with_places(value: Any) -> Any:
    """A value of JSON with lists of numbers where texts hold a place, or a whole hand; itself
    where none does, as told from the first of each list."""
    return _changed(value, 0) if _any_in(value, 0) else value


def _any_in(value: Any, depth: int) -> bool:
    if depth > _DEEPEST:
        return False
    if isinstance(value, str):
        return _place(value) is not None
    if isinstance(value, list):
        some = [v for v in value[:100] if isinstance(v, dict | list | str) and v][:_LOOKED_INTO]
        return any(_any_in(v, depth + 1) for v in some)
    if not isinstance(value, dict):
        return False
    inner = [v for k, v in value.items() if isinstance(v, dict | list | str) and _may_be(k)]
    return any(_any_in(v, depth + 1) for v in inner[: 16 * _LOOKED_INTO])


def _may_be(key: Any) -> bool:
    """Whether what stands under a name may be a place: no time or hand's name."""
    return not (isinstance(key, str) and (time_unit(key) is not None or is_hand_label(key)))


def _changed(value: Any, depth: int) -> Any:
    if depth > _DEEPEST:
        return value
    if isinstance(value, str):
        place = _place(value)
        return value if place is None else place
    if isinstance(value, list):
        if value and isinstance(value[0], int | float):
            return value
        return [_changed(v, depth + 1) if isinstance(v, dict | list | str) else v for v in value]
    if not isinstance(value, dict):
        return value
    return {
        k: _changed(v, depth + 1) if isinstance(v, dict | list | str) and _may_be(k) else v
        for k, v in value.items()
    }


def _place(text: str) -> list[float | None] | None:
    """The numbers of a text that is a place or a hand, None of any other."""
    if not 5 <= len(text) <= _LONGEST or text[:1].isalpha():
        return None
    text = text.strip()
    if _COMMA_PLACE.fullmatch(text):
        text = _pointed(text)
    numbers = numbers_in(text)
    return [None if n[:1] in "nN" else float(n) for n in numbers] or None
