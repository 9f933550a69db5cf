"""A hand as simulators of robots see one: links, hinges with limits, capsules, masses, meshes.

At zero all links' frames are parallel to the root frame and lie in their joints; hinges have the
names of the angles, as the JointState messages of a recording have.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.exporting.part_meshes import Mesh, part_meshes
from handtrack.hand.capsules import bone_joints, capsule_radii
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import (
    ANGLE_JOINT,
    ANGLE_NAMES,
    BASES,
    JOINT_NAMES,
    PARENTS,
    TIPS,
)

Array = NDArray[np.float64]

DENSITY = 1160.0
"""Of a hand [kg/m^3] (Winter, Biomechanics and Motor Control of Human Movement, table 4.1)."""
TORQUE = 5.0
"""Most that a hinge's motor may give [N m], a little above what a strong finger can."""
SPEED = 30.0
"""Fastest that a hinge may turn [rad/s], above what fingers reach."""
TWIST = "thumb_cmc_twist"
"""The hinge that follows the thumb's abduction (`HandModel.thumb_twist`)."""


class Hinge(NamedTuple):
    """A joint about an axis.

    Attributes:
        name: of `ANGLE_NAMES`, or `TWIST`.
        axis: (3,) of unit length, root frame.
        lower, upper: limits [rad].
        follows: the hinge whose angle, times `share`, is its own; "": it is free.
        share: see there.
    """

    name: str
    axis: Array
    lower: float
    upper: float
    follows: str = ""
    share: float = 0.0


class Capsule(NamedTuple):
    """A cylinder with two halves of a ball at its ends.

    Attributes:
        first, last: (3,) ends of its axis, in the link's frame [m].
        radius: [m].
    """

    first: Array
    last: Array
    radius: float


class Link(NamedTuple):
    """A rigid body.

    Attributes:
        name: of `JOINT_NAMES`: that joint is the origin of its frame.
        parent: the link that it hangs on; "" for the wrist.
        offset: (3,) of its origin in the parent's frame [m].
        hinges: what turns it, outermost last: the second turns about an axis that the first
            has turned. None for a tip, which is fixed to its parent.
        capsules: what it touches others with.
        mesh: its skin, or None.
        mass: [kg]; 0 for a tip.
        centre: (3,) of mass, in its frame [m].
        inertia: (3, 3) about the centre of mass [kg m^2].
    """

    name: str
    parent: str
    offset: Array
    hinges: tuple[Hinge, ...]
    capsules: tuple[Capsule, ...]
    mesh: Mesh | None
    mass: float
    centre: Array
    inertia: Array


def links(model: HandModel) -> list[Link]:
    """The hand's 21 links, parents first: 16 that move and 5 tips."""
    meshes = part_meshes(model)
    capsules = _capsules(model)
    out = []
    for joint, name in enumerate(JOINT_NAMES):
        tip, parent = joint in TIPS, int(PARENTS[joint])
        offset = model.rest_joints[joint] - model.rest_joints[max(parent, 0)]  # 0 for the wrist
        part = 0 if joint == 0 else 3 * ((joint - 1) // 4) + (joint - 1) % 4 + 1
        out.append(
            Link(
                name,
                JOINT_NAMES[parent] if joint else "",
                offset,
                () if tip else _hinges(model, joint),
                capsules[joint],
                None if tip else meshes[part],
                *_mass(capsules[joint]),
            )
        )
    return out


def _hinges(model: HandModel, joint: int) -> tuple[Hinge, ...]:
    """A joint's hinges; the thumb's base has one more where abduction twists it (eq. 2)."""
    low, high = model.limits.lower, model.limits.upper
    numbers = np.flatnonzero(joint == ANGLE_JOINT)
    made = [Hinge(ANGLE_NAMES[a], model.axes[a], float(low[a]), float(high[a])) for a in numbers]
    if joint == BASES[0] and model.thumb_twist:
        bone = model.rest_joints[joint + 1] - model.rest_joints[joint]
        lower, upper = sorted(model.thumb_twist * end for end in (made[1].lower, made[1].upper))
        along = bone / np.linalg.norm(bone)
        made.append(Hinge(TWIST, along, lower, upper, made[1].name, model.thumb_twist))
    return tuple(made)


def _capsules(model: HandModel) -> list[tuple[Capsule, ...]]:
    """Each joint's capsules: of the bone behind it, and of the palm's four for the wrist."""
    made: list[list[Capsule]] = [[] for _ in JOINT_NAMES]
    rest = model.rest_joints
    for (first, last), radius in zip(bone_joints(), capsule_radii(model), strict=True):
        along = rest[last] - rest[first]
        if last in TIPS:  # the fingertip is where the skin ends: the axis ends a radius before it
            along = along * max(1 - radius / float(np.linalg.norm(along)), 0.0)
        made[first].append(Capsule(np.zeros(3), along, float(radius)))
    return [tuple(capsules) for capsules in made]


def _mass(capsules: tuple[Capsule, ...]) -> tuple[float, Array, Array]:
    """Mass, its centre, and the inertia about it, of capsules as heavy as flesh and bone."""
    bodies = [_solid(capsule) for capsule in capsules]
    mass = sum(m for m, _, _ in bodies)
    if not mass:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = sum((m * c for m, c, _ in bodies), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, c, own in bodies:
        off = c - centre
        inertia += own + m * (off @ off * np.eye(3) - np.outer(off, off))
    return mass, centre, inertia


def _solid(capsule: Capsule) -> tuple[float, Array, Array]:
    along, r = capsule.last - capsule.first, capsule.radius
    length = float(np.linalg.norm(along))
    tube, balls = DENSITY * np.pi * r * r * length, DENSITY * 4 / 3 * np.pi * r**3
    about = tube * r * r / 2 + balls * 2 / 5 * r * r
    across = tube * (r * r / 4 + length**2 / 12)
    across += balls * (2 / 5 * r * r + length**2 / 4 + 3 / 8 * length * r)
    axis = along / length if length else np.array([1.0, 0.0, 0.0])
    turned = np.outer(axis, axis)
    inertia = about * turned + across * (np.eye(3) - turned)
    return tube + balls, (capsule.first + capsule.last) / 2, inertia
