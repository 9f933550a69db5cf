"""Numbers of joints in a profile's file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import JOINT_NAMES

DIGITS = 4
"""Numbers are written to so many digits."""


def named(values: NDArray[np.float64]) -> dict[str, Any]:
    """Numbers of joints by their names."""
    return dict(zip(JOINT_NAMES, np.round(values, DIGITS).tolist(), strict=True))


def as_object(value: Any, name: str, path: Path) -> dict[str, Any]:
    """An object of a profile's file, as what follows: of its name.

    Raises:
        InputError: it is none.
    """
    if not isinstance(value, dict):
        raise InputError(f"{name} is missing or no object", path)
    return value


def as_number(value: Any, name: str, path: Path) -> float:
    """A number; raises as `as_object`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6:
        raise InputError(f"{name} is {shown(value, 40)}, expected a number", path)
    return float(value)


def as_rows(value: Any, name: str, path: Path) -> NDArray[np.float64]:
    """(21, 3) numbers by joints, or (21,); raises as `as_object`."""
    by_joint = as_object(value, name, path)
    if set(by_joint) != set(JOINT_NAMES):
        odd = sorted(set(by_joint) ^ set(JOINT_NAMES))[0]
        raise InputError(
            f"{name} is of another joint set: {shown(odd, 40)} is not in both; expected the 21 of"
            f" handtrack, {JOINT_NAMES[0]} to {JOINT_NAMES[-1]}",
            path,
        )
    wide = name == "noise.bone" or not name.startswith("noise.")
    rows = []
    for joint in JOINT_NAMES:
        given = by_joint[joint]
        numbers = given if isinstance(given, list) else [given]
        if len(numbers) != (3 if wide else 1) or isinstance(given, list) != wide:
            raise InputError(f"{name}.{joint} expects {3 if wide else 1} numbers", path)
        rows.append([as_number(x, f"{name}.{joint}", path) for x in numbers])
    return np.array(rows if wide else [row[0] for row in rows])
