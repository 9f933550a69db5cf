"""What stands in a profile's file: numbers of joints, and corrections."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.correction import N_BENDS, N_OWN, N_PLACES, Bends, Correction
from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import FINGERS, JOINT_NAMES

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


_OF_HAND, _OF_FINGER = ("mean", "spread", "shift"), ("mean", "spread")


def written_correction(correction: Correction) -> dict[str, Any]:
    """The mean of a hand by joints; the slopes of each joint's three coordinates, a row each; and
    each finger's own."""
    slopes = correction.slope.reshape(len(JOINT_NAMES), 3, N_PLACES)
    parts = {name: getattr(correction, name) for name in _OF_HAND}
    said = {name: named(values) for name, values in {**parts, "slope": slopes}.items()}
    own = correction.finger
    if own is None:
        return said
    fingers = {
        finger: {
            name: np.round(getattr(own, name)[f], DIGITS).tolist()
            for name in (*_OF_FINGER, "slope")
        }
        for f, finger in enumerate(FINGERS)
    }
    return {**said, "finger": fingers}


def read_correction(content: Any, path: Path) -> Correction | None:
    """The correction of a profile's file, None where it has none.

    Raises:
        InputError: something in it is missing or wrong.
    """
    if content is None:
        return None
    said = as_object(content, "correction", path)
    parts = {n: as_rows(said.get(n), f"correction.{n}", path) for n in _OF_HAND}
    by_joint = as_object(said.get("slope"), "correction.slope", path)
    rows = [
        _matrix(by_joint.get(joint), 3, N_PLACES, f"correction.slope.{joint}", path)
        for joint in JOINT_NAMES
    ]
    return Correction(**parts, slope=np.concatenate(rows), finger=_bends(said.get("finger"), path))


def _bends(content: Any, path: Path) -> Bends | None:
    if content is None:
        return None
    said = as_object(content, "correction.finger", path)
    parts: dict[str, list[NDArray[np.float64]]] = {n: [] for n in (*_OF_FINGER, "slope")}
    for finger in FINGERS:
        name = f"correction.finger.{finger}"
        one = as_object(said.get(finger), name, path)
        for of in _OF_FINGER:
            parts[of].append(_row(one.get(of), N_BENDS, f"{name}.{of}", path))
        parts["slope"].append(_matrix(one.get("slope"), N_OWN, N_BENDS, f"{name}.slope", path))
    return Bends(**{name: np.stack(values) for name, values in parts.items()})


def _matrix(value: Any, rows: int, columns: int, name: str, path: Path) -> NDArray[np.float64]:
    if not isinstance(value, list) or len(value) != rows:
        raise InputError(f"{name} expects {rows} rows of {columns} numbers", path)
    for row in value:
        if not isinstance(row, list) or len(row) != columns:
            raise InputError(f"{name} expects {rows} rows of {columns} numbers", path)
    return np.stack([_row(row, columns, name, path) for row in value])


def _row(value: Any, n: int, name: str, path: Path) -> NDArray[np.float64]:
    if not isinstance(value, list) or len(value) != n:
        raise InputError(f"{name} expects {n} numbers", path)
    return np.array([as_number(x, name, path) for x in value])
