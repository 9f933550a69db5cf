"""Corrections in a profile's file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.correction import N_BENDS, N_OWN, N_PLACES, Bends, Correction
from handtrack.detectors.rows import DIGITS, as_number, as_object, as_rows, named
from handtrack.errors import InputError
from handtrack.hand.skeleton import FINGERS, JOINT_NAMES

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
