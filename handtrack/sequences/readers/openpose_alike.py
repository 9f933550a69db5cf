"""OpenPose's pictures of one person each, whose numbers become arrays together."""

from __future__ import annotations

from typing import Any

import numpy as np

from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.readers.raw import Array

HAND_KEYS: dict[Hand, str] = {
    "left": "hand_left_keypoints_2d",
    "right": "hand_right_keypoints_2d",
}
_ALONE = ([-1], None)
"""A person's number where there is none."""


def of_one_person(
    numbers: list[int], values: list[dict[str, Any]]
) -> dict[Hand, tuple[list[int], Array]] | None:
    """The hands that are seen: the numbers of their pictures, and (n, 21, 3) x, y and confidence.

    Args:
        numbers: of the pictures.
        values: what each one's file holds.

    Returns:
        None where a picture has several people, a hand has other than 63 numbers, or anything is
        to be said of one.
    """
    if len(set(numbers)) < len(numbers):
        return None
    said: dict[Hand, tuple[list[int], list[Any]]] = {hand: ([], []) for hand in HAND_KEYS}
    for number, value in zip(numbers, values, strict=True):
        people = value.get("people")
        if not isinstance(people, list) or len(people) > 1:
            return None
        for person in people:
            if not isinstance(person, dict) or person.get("person_id") not in _ALONE:
                return None
            for hand, (frame, rows) in said.items():
                if row := person.get(HAND_KEYS[hand]):
                    frame.append(number)
                    rows.append(row)
    found: dict[Hand, tuple[list[int], Array]] = {}
    for hand, (frame, rows) in said.items():
        try:
            points = np.array(rows or np.empty((0, 3 * N_JOINTS)), dtype=np.float64)
        except (ValueError, TypeError, OverflowError):
            return None
        if points.shape != (len(frame), 3 * N_JOINTS) or np.isinf(points).any():
            return None
        points = points.reshape(-1, N_JOINTS, 3)
        seen = np.flatnonzero((points[..., 2] > 0).any(1))
        if len(seen):
            found[hand] = [frame[i] for i in seen.tolist()], points[seen]
    return found
