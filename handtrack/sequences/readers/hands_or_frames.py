"""Whether two to four lists of landmarks under one name, of which the file says nothing more, are
hands in one frame or frames of one hand: where they are tells it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.readers.points import read_points
from handtrack.sequences.readers.raw import Array

_MOVED = 0.12
"""Of its size a hand moves so far between two frames, at most."""
_APART = 0.5
"""Two hands are so far from each other, or turned so far."""


def are_frames(lists: list[Any], name: str, path: Path) -> bool:
    """Whether lists of landmarks are frames of one hand.

    Raises:
        InputError: they may be either.
    """
    try:
        hands = [read_points(one, name, path).joints for one in lists if one]
    except InputError:
        return False  # said where they are read
    if len(hands) < 2 or len({hand.shape for hand in hands}) > 1:
        return False
    steps = [_step(a, b) for a, b in pairwise(hands)]
    if max(steps) < _MOVED:
        return True
    if max(steps) > _APART:
        return False
    raise InputError(
        f"{name} holds {len(lists)} lists of landmarks, which may be frames of one hand or hands in"
        f" one frame: for frames pass --key {name} (load(key=...)) or say the fps in the file, for"
        " hands name them (handedness)",
        path,
    )


def _step(a: Array, b: Array) -> float:
    """How far apart two hands are, in sizes of the first; far where one mirrors the other."""
    both = np.isfinite(a).all(1) & np.isfinite(b).all(1)
    if both.sum() < 4:
        return np.inf
    a, b = a[both], b[both]
    size = float(np.ptp(a, axis=0).max())
    if size <= 0:
        return np.inf
    return float(np.linalg.norm(a - b, axis=1).mean()) / size
