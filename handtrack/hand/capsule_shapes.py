"""The capsules of a hand as bodies of their own, and as URDF writes them."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.capsules import bone_joints, capsule_radii
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES, TIPS

Array = NDArray[np.float64]

SKIN_RGBA = "0.886 0.698 0.58 1"
"""Colour of the material "skin"."""


class Capsule(NamedTuple):
    """A cylinder with two halves of a ball at its ends.

    Attributes:
        first, last: (3,) ends of its axis, in the link's frame [m].
        radius: [m].
    """

    first: Array
    last: Array
    radius: float


def joint_capsules(model: HandModel) -> list[tuple[Capsule, ...]]:
    """Each joint's capsules: of the bone behind it, and of the palm's four for the wrist.

    Returns:
        of the 21 joints, each in a frame parallel to the root frame whose origin is the joint [m].
    """
    made: list[list[Capsule]] = [[] for _ in JOINT_NAMES]
    rest = model.rest_joints
    for (first, last), radius in zip(bone_joints(), capsule_radii(model), strict=True):
        along = rest[last] - rest[first]
        if last in TIPS:  # the fingertip is where the skin ends: the axis ends a radius before it
            along = along * max(1 - radius / float(np.linalg.norm(along)), 0.0)
        made[first].append(Capsule(np.zeros(3), along, float(radius)))
    return [tuple(capsules) for capsules in made]


def as_text(values: Array | tuple[float, ...]) -> str:
    """Values as text, with more digits than float32 holds."""
    return " ".join(f"{x:.9g}" for x in np.asarray(values, np.float64).ravel() + 0.0)


def add_skin_material(robot: Element) -> None:
    """The material "skin", that visual shapes name."""
    material = SubElement(robot, "material", name="skin")
    SubElement(material, "color", rgba=SKIN_RGBA)


def add_capsule(link: Element, kind: str, capsule: Capsule) -> None:
    """A capsule as URDF knows shapes: a cylinder and two balls.

    Args:
        link: the element that gets them.
        kind: "visual" or "collision".
        capsule: in the link's frame.
    """
    along, radius = capsule.last - capsule.first, as_text((capsule.radius,))
    length = float(np.linalg.norm(along))
    pieces: list[tuple[str, Array, Array, dict[str, str]]] = [
        ("sphere", end, np.zeros(3), {"radius": radius}) for end in (capsule.first, capsule.last)
    ]
    middle = (capsule.first + capsule.last) / 2
    tube = {"radius": radius, "length": as_text((length,))}
    if length:
        pieces.append(("cylinder", middle, _roll_pitch_yaw(along / length), tube))
    for shape, origin, turn, size in pieces:
        made = SubElement(link, kind)
        SubElement(made, "origin", xyz=as_text(origin), rpy=as_text(turn))
        SubElement(SubElement(made, "geometry"), shape, size)
        if kind == "visual":
            SubElement(made, "material", name="skin")


def _roll_pitch_yaw(along: Array) -> Array:
    """Angles of Rz(yaw) Ry(pitch) Rx(roll) that bring z to a direction."""
    x, y, z = along
    return np.array([0.0, np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)])
