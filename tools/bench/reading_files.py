"""What made files have in common: one moving hand, as large as is asked for."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel

Array = NDArray[np.float64]
RATE = 60.0
_CYCLE = 3000
XYZ = "xyz"


@cache
def motion() -> Array:
    """(T, 21, 3) joints [m] of a hand that bends, turns and is carried about."""
    model = HandModel.default("right")
    time = np.arange(_CYCLE) / RATE
    phase = np.arange(20) % 4
    angles = 0.4 + 0.35 * np.sin(1.3 * time[:, None] + 0.2 * np.arange(20))
    angles = model.limits.clamp(np.where(phase == 1, 0.1, angles))
    turn = np.tile(np.eye(3), (_CYCLE, 1, 1))
    place = np.stack([0.1 * np.sin(time), 0.1 * np.cos(0.7 * time), 1 + 0.05 * np.sin(time)], 1)
    return np.asarray(model.joints(angles, turn, place))


def frames() -> Iterator[tuple[int, float, Array]]:
    """Number, time [s] and joints of each frame, without an end."""
    for i in itertools.count():
        yield i, i / RATE, motion()[i % _CYCLE]


def cycles(mb: float) -> Array:
    """(T, 21, 3) joints that take so many MB as doubles."""
    n = int(mb * 1e6 / (63 * 8))
    return np.resize(motion(), (n, 21, 3))


def texts(path: Path, mb: float, head: str, line: Callable[[int, float, Array], str]) -> Path:
    """A file of a head and a text for each frame."""
    size = 0
    with path.open("w") as file:
        file.write(head)
        for i, time, joints in frames():
            text = line(i, time, joints)
            file.write(text)
            size += len(text)
            if size > mb * 1e6:
                return path
    raise AssertionError


def numbers(values: Array, digits: int = 9) -> list[str]:
    """As they are written."""
    return [f"{v:.{digits}f}" for v in values.ravel().tolist()]


OPENXR = (
    *("Palm", "Wrist", "ThumbMetacarpal", "ThumbProximal", "ThumbDistal", "ThumbTip"),
    *(
        f"{finger}{part}"
        for finger in ("Index", "Middle", "Ring", "Little")
        for part in ("Metacarpal", "Proximal", "Intermediate", "Distal", "Tip")
    ),
)


def openxr(x: Array) -> Array:
    """26 joints."""
    return x[
        [9, 0, 1, 2, 3, 4, *(j for f in range(1, 5) for j in (0, *range(4 * f + 1, 4 * f + 5)))]
    ]


def pixels(x: Array) -> Array:
    """(21, 2) [px] in a picture."""
    return 640 + 900 * x[:, :2] / x[:, 2:]
