"""Joints whose x, y and z are lists of their own: of one frame, or of all frames together.

{"x": [21 numbers], "y": [...], "z": [...], "visibility": [21 numbers]}
{"xs": [[21 numbers] x T], "ys": ..., "zs": ...}     or 21 lists of T numbers
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.readers.joint_frames import JOINT_COUNTS
from handtrack.sequences.readers.jsontext import nested_numbers
from handtrack.sequences.titles import is_confidence

_FORMS = ("{}", "p{}", "{}s", "{}_list", "{}_coords", "{}_values", "{}List", "{}Coords", "{}Values")
NAMES: tuple[tuple[str, str, str], ...] = tuple(
    (form.format(x), form.format(y), form.format(z))
    for form in _FORMS
    for x, y, z in (("x", "y", "z"), ("X", "Y", "Z"))
)


def axis_keys(value: Mapping[Any, Any]) -> tuple[str, str, str] | None:
    """The names of three lists of numbers, the places of one frame's joints; None of others."""
    keys = _keys(value) if len(value) > 2 else None
    if keys is None or any(_is_nested(value[k]) for k in keys):
        return None
    return keys


def column_keys(value: Mapping[Any, Any]) -> tuple[str, str, str] | None:
    """The names of three arrays of two axes, the places in all frames; None of others."""
    keys = _keys(value) if len(value) > 2 else None
    return keys if keys is not None and all(_is_nested(value[k]) for k in keys) else None


def _keys(value: Mapping[Any, Any]) -> tuple[str, str, str] | None:
    for keys in NAMES:
        if all(isinstance(value.get(k), list | np.ndarray) for k in keys):
            return keys
    return None


def _is_nested(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim == 2
    return isinstance(next((v for v in value if v is not None), None), list)


def sure_of(value: Mapping[str, Any], n: int) -> list[Any] | None:
    """How sure each of n joints is, where a list beside theirs says it."""
    found = (v for k, v in value.items() if is_confidence(k) and isinstance(v, list))
    return next((v for v in found if len(v) == n), None)


def with_joints(value: Mapping[str, Any], path: Path, name: str = "joints") -> dict[str, Any]:
    """The same with (T, N, 3) joints under a name in the place of the arrays of x, y and z, and
    what else has their axes turned as they are: frames first.

    Raises:
        InputError: they are no arrays of numbers, or not of one shape.
    """
    keys = column_keys(value)
    if keys is None:
        return dict(value)
    arrays = [nested_numbers(value[k], path, k) for k in keys]
    if len({a.shape for a in arrays}) > 1 or arrays[0].ndim != 2:
        shapes = ", ".join(str(a.shape) for a in arrays)
        raise InputError(f"{', '.join(keys)} have shapes {shapes}, expected one of all", path)
    shape = arrays[0].shape
    turned = shape[1] not in JOINT_COUNTS and shape[0] in JOINT_COUNTS
    out = {k: v for k, v in value.items() if k not in keys}
    if turned:
        for key, inner in out.items():
            if is_confidence(key) and isinstance(inner, list | np.ndarray) and _is_nested(inner):
                array = nested_numbers(inner, path, key)
                out[key] = array.T if array.shape == shape else array
    joints = np.stack(arrays, axis=-1)
    return out | {name: joints.transpose(1, 0, 2) if turned else joints}
