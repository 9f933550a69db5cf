"""The frame of each bone, in which a landmark keeps its place about a joint."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import ModelError
from handtrack.hand.skeleton import PALM, PARENTS, Hand

Array = NDArray[np.float64]

_INDEX, _MIDDLE, _LITTLE = 5, 9, 17


def rest_frames(rest_joints: ArrayLike, hand: Hand) -> Array:
    """The frames of the bones that arrive at the joints of a hand at rest.

    Args:
        rest_joints: (21, 3), any unit.
        hand: "left" or "right".

    Returns:
        (21, 3, 3), columns: along the bone (of the wrist: to the middle finger's base), towards
        the thumb's side, and their normal out of the back of the hand. A left hand's are the
        mirror images of a right hand's.

    Raises:
        ModelError: a bone has no length, or lies along the palm's breadth.
    """
    j = np.asarray(rest_joints, dtype=np.float64)
    along = j - j[np.maximum(PARENTS, 0)]
    along[0] = j[_MIDDLE] - j[0]
    across = j[_INDEX] - j[_LITTLE]
    x = _unit(along)
    y = _unit(across - (x @ across)[:, None] * x)
    z = np.cross(x, y) * (1.0 if hand == "right" else -1.0)
    return np.stack([x, y, z], -1)


def palm_length(joints: ArrayLike) -> float:
    """Mean distance from the wrist to the four finger bases, of (21, 3) joints."""
    j = np.asarray(joints, dtype=np.float64)
    return float(np.linalg.norm(j[PALM[2:]] - j[0], axis=1).mean())


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    if length.min() < 1e-9:
        raise ModelError(f"joint {int(length.argmin())}: its bone has no frame at rest")
    return np.asarray(v / length)
