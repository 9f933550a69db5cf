"""The free hand that ships with the project: its skeleton, joint axes and skin.

`default_hand.npz` is made by `tools/make/default_hand.py` from published bone lengths
(Buryanov and Kotiuk 2010); it is our own work and under the project's licence. It holds the
right hand: the left one is its mirror image, made here with axes and winding of its own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import SettingsError
from handtrack.hand.limits import DEFAULT_LIMITS, Limits, preset
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import BASES, PALM, Hand

Array = NDArray[np.float64]

_MIRROR = np.array([1.0, -1.0, 1.0])


@cache
def _arrays() -> dict[str, np.ndarray]:
    with (
        (files("handtrack.hand") / "default_hand.npz").open("rb") as stream,
        np.load(stream, allow_pickle=False) as data,
    ):
        return {name: data[name] for name in data.files}


class ShapeOfDefault(NamedTuple):
    """The default hand's shape space, as `MANO` is of MANO's.

    Everything is linear in the coefficients, which count standard deviations of adults. Axes do
    not change: bones keep their directions.

    Attributes:
        joint_template: (21, 3) rest joints of the mean hand [m].
        joint_basis: (21, 3, 4) their offset for each unit of a coefficient [m].
        template: (V, 3) skin of the mean hand [m].
        shape_basis: (V, 3, 4) its offsets [m].
    """

    joint_template: Array
    joint_basis: Array
    template: Array
    shape_basis: Array


SHAPES: dict[str, float] = {
    # hand length 193.8 +- 9.8 mm (men), 180.5 +- 9.7 (women): both together 6.3 % (Gordon et
    # al. 1989, ANSUR). The bones one by one have 8 to 12 % (Buryanov and Kotiuk 2010).
    "size": 0.063,
    # fingers vary by 7.3 % (Chatzioglou et al. 2024, mean of index to little); what size leaves
    "finger_length": 0.037,
    # breadth 90.4 +- 4.2 and 79.4 +- 3.8 mm: both together 8.0 % (Gordon et al.); what size leaves
    "palm_width": 0.049,
    # our own estimate
    "thickness": 0.08,
}
"""The shape coefficients by name, with what one standard deviation of each changes."""


@cache
def default_shape(hand: Hand) -> ShapeOfDefault:
    """How the default hand's joints and skin go with its shape coefficients."""
    mean = _mean_hand(hand)
    joints, vertices = [], []
    for i in range(len(SHAPES)):
        # central differences: linear, and the same far to both sides
        more, less = (_reshaped_by(mean, sign * np.eye(len(SHAPES))[i]) for sign in (1, -1))
        joints.append((more.rest_joints - less.rest_joints) / 2)
        vertices.append((more.rest_vertices - less.rest_vertices) / 2)
    return ShapeOfDefault(
        mean.rest_joints, np.stack(joints, -1), mean.rest_vertices, np.stack(vertices, -1)
    )


def _reshaped_by(mean: HandModel, coefficients: Array) -> HandModel:
    size, finger, palm, thick = 1 + coefficients * list(SHAPES.values())
    new = mean.rest_joints.copy()
    new[PALM, 1] *= palm
    for base in BASES:
        chain = mean.rest_joints[base : base + 4]
        # the first bone of the thumb is a metacarpal, but moves like a finger's
        new[base : base + 4] = new[base] + finger * (chain - chain[0])
    return reshaped(mean, size * new, thickness=thick)


def default_hand(hand: Hand, limits: Limits, shape: ArrayLike | None = None) -> HandModel:
    """The free hand, right or left, at rest in its root frame.

    Args:
        hand: "left" or "right".
        limits: of its angles.
        shape: up to four coefficients, in the order of `SHAPES`, in standard deviations; the
            mean hand by default.

    Raises:
        SettingsError: the shape has more than four coefficients, or some beyond 5.
    """
    mean = replace(_mean_hand(hand), limits=limits)
    coefficients = np.zeros(len(SHAPES))
    if shape is None:
        return replace(mean, shape=coefficients)
    given = np.asarray(shape, dtype=np.float64)
    if given.ndim != 1 or len(given) > len(SHAPES) or not (np.abs(given) <= 5).all():
        raise SettingsError(
            f"shape has {given.size} coefficients, expected up to {len(SHAPES)}"
            f" ({', '.join(SHAPES)}), each within 5 standard deviations"
        )
    coefficients[: len(given)] = given
    space = default_shape(hand)
    return replace(
        mean,
        rest_joints=space.joint_template + space.joint_basis @ coefficients,
        rest_vertices=space.template + space.shape_basis @ coefficients,
        shape=coefficients,
    )


@cache
def _mean_hand(hand: Hand) -> HandModel:
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
    limits = preset(DEFAULT_LIMITS)
    return HandModel("default", hand, joints, axes, limits, vertices, faces, weights)
