"""The joints of one hand in many frames at once, where all frames have one form."""

from __future__ import annotations

from typing import Any

import numpy as np

from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.names import CONFIDENCES
from handtrack.sequences.readers.axis_lists import axis_keys
from handtrack.sequences.readers.points import (
    AXES,
    COUNTS,
    INSIDE,
    NAMES,
    POSITION,
    Points,
    plan_of,
)
from handtrack.sequences.readers.raw import Array


def read_many(values: list[Any]) -> Points | None:
    """Frames of one hand all at once, which is fast, where all have the same names in the same
    order and points of one form; None where anything is different.

    Returns:
        (T, N, 3) joints, (T, N) confidence or None, and whether they are ours by name.
    """
    first = values[0]
    if isinstance(first, dict):
        names = list(first)
        plan = plan_of(tuple(map(str, names)))
        if not plan.simple or len(names) <= 15 or axis_keys(first) is not None:
            return None
        if not all(isinstance(v, dict) and list(v) == names for v in values):
            return None
        found = _of_one_form([v[k] for v in values for k in plan.keys])
        if found is None:
            return None
        places, sure = found
        joints = np.full((len(values), N_JOINTS, 3), np.nan)
        joints[:, list(plan.places)] = places.reshape(len(values), -1, 3)
        if sure is None:
            return Points(joints, None, True)
        confidence = np.ones(joints.shape[:2])
        confidence[:, list(plan.places)] = sure.reshape(len(values), -1)
        return Points(joints, confidence, True)
    n = len(first) if isinstance(first, list) else 0
    if n not in COUNTS or not isinstance(first[0], dict) or any(k in first[0] for k in NAMES):
        return None
    if not all(isinstance(v, list) and len(v) == n for v in values):
        return None
    found = _of_one_form([p for v in values for p in v])
    if found is None:
        return None
    places, sure = found
    sure = None if sure is None else sure.reshape(-1, n)
    return Points(places.reshape(-1, n, 3), sure, False)


def _of_one_form(points: list[Any]) -> tuple[Array, Array | None] | None:
    """Places (P, 3) and confidences (P,) of points that all have the first one's keys."""
    first = points[0]
    if not isinstance(first, dict):
        return None
    sure_key = next((k for k in first if k.lower() in CONFIDENCES and k != "presence"), None)
    try:
        sure = None if sure_key is None else [p[sure_key] for p in points]
        for _ in range(3):
            value = points[0]
            key = None
            if isinstance(value, dict):
                keys = value.keys()
                if not all(p.keys() == keys for p in points):
                    return None
                key = next((k for k in (*INSIDE, *POSITION) if k in keys), None)
            if key is None:
                break
            points = [p[key] for p in points]
        value = points[0]
        if isinstance(value, dict):
            axes = next((a for a in AXES if all(k in value for k in a)), None)
            if axes is None:
                return None
            x, y, z = axes
            places = np.array([(p[x], p[y], p[z]) for p in points], dtype=np.float64)
        else:
            places = np.array(points, dtype=np.float64)
        confidence = None if sure is None else np.array(sure, dtype=np.float64)
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        return None
    if places.shape != (len(points), 3) or (confidence is not None and np.isnan(confidence).any()):
        return None
    return places, confidence
