"""JSON in which joints have no z: landmarks in a picture, read as joints whose z is 0."""

from __future__ import annotations

from typing import Any

import numpy as np

from handtrack.sequences.readers.axis_lists import NAMES

_DEEPEST = 12
_FEWEST = 12
"""So few pairs of numbers are no hand."""


def with_depth(value: Any) -> Any:
    """The same with a z of 0 at places of x and y alone; None where it has no such."""
    changed = [False]
    deep = _deep(value, 0, changed)
    return deep if changed[0] else None


def _deep(value: Any, depth: int, changed: list[bool]) -> Any:
    if isinstance(value, np.ndarray):
        return _array(value, changed)
    if depth > _DEEPEST:
        return value
    if isinstance(value, list):
        return _list(value, depth, changed)
    return _object(value, depth, changed) if isinstance(value, dict) else value


def _list(value: list[Any], depth: int, changed: list[bool]) -> list[Any]:
    if len(value) == 42 and all(_is_number(v) for v in value):
        changed[0] = True
        return [n for i in range(0, 42, 2) for n in (value[i], value[i + 1], 0.0)]
    if len(value) >= _FEWEST and all(v is None or _is_pair(v) for v in value):
        if any(value):
            changed[0] = True
        return [v and [*v, 0.0] for v in value]
    return [_deep(v, depth + 1, changed) for v in value]


def _object(value: dict[Any, Any], depth: int, changed: list[bool]) -> dict[Any, Any]:
    for x, y, z in NAMES:
        if x not in value or y not in value:
            continue
        if z in value and value[z] is not None:
            continue
        if _is_number(value[x]) and _is_number(value[y]):
            changed[0] = True
            return {**value, z: 0.0}
        if isinstance(value[x], list) and len(value[x]) >= _FEWEST:
            changed[0] = True
            return {**value, z: [[0.0] * len(v) if isinstance(v, list) else 0.0 for v in value[x]]}
    pairs = sum(_is_pair(v) for v in value.values())
    if pairs >= _FEWEST:
        changed[0] = True
        return {k: [*v, 0.0] if _is_pair(v) else v for k, v in value.items()}
    return {k: _deep(v, depth + 1, changed) for k, v in value.items()}


def _array(value: np.ndarray[Any, Any], changed: list[bool]) -> np.ndarray[Any, Any]:
    if value.ndim < 2 or value.dtype.kind not in "fiu":
        return value
    if value.shape[-1] == 42 and value.ndim == 2:
        value = value.reshape(len(value), 21, 2)
    if value.shape[-1] != 2 or value.shape[-2] < _FEWEST:
        return value
    changed[0] = True
    return np.concatenate([value, np.zeros((*value.shape[:-1], 1))], axis=-1)


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))
