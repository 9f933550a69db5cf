"""The free hand that ships with the project: its skeleton, joint axes and skin.

`default_hand.npz` is made by `tools/make_default_hand.py` from published bone lengths
(Buryanov and Kotiuk 2010); it is our own work and under the project's licence. It holds the
right hand: the left one is its mirror image, made here with axes and winding of its own.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import Hand

_MIRROR = np.array([1.0, -1.0, 1.0])


@cache
def _arrays() -> dict[str, np.ndarray]:
    with (
        (files("handtrack.hand") / "default_hand.npz").open("rb") as stream,
        np.load(stream, allow_pickle=False) as data,
    ):
        return {name: data[name] for name in data.files}


def default_hand(hand: Hand, limits: Limits) -> HandModel:
    """The free hand, right or left, at rest in its root frame."""
    a = _arrays()
    joints, axes = a["rest_joints"], a["axes"]
    vertices, faces = a["rest_vertices"], a["faces"]
    if hand == "left":
        joints, vertices = joints * _MIRROR, vertices * _MIRROR
        # a mirrored rotation turns the other way about the mirrored axis
        axes = -axes * _MIRROR
        faces = faces[:, ::-1]
    weights = a["weights"].astype(np.float64)
    weights /= weights.sum(1, keepdims=True)
    return HandModel("default", hand, joints, axes, limits, vertices, faces, weights)
