"""A hand as simulators of robots see one: links, hinges with limits, capsules, masses, meshes.

At zero all links' frames are parallel to the root frame and lie in their joints; hinges have the
names of the angles, as the JointState messages of a recording have.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.capsules import Capsule, joint_capsules
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import (
    ANGLE_JOINT,
    ANGLE_NAMES,
    BASES,
    JOINT_NAMES,
    N_PARTS,
    PARENTS,
    PART_JOINT,
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
    capsules = joint_capsules(model)
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


_ENOUGH = 0.1
"""Of a triangle's weights: a part that has so much of it takes it too."""
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("about", "<u2")])
"""A triangle of a binary STL file."""


class Mesh(NamedTuple):
    """A closed surface.

    Attributes:
        vertices: (V, 3) [m].
        faces: (F, 3) counter-clockwise from outside.
    """

    vertices: Array
    faces: NDArray[np.int64]


def part_meshes(model: HandModel) -> list[Mesh | None]:
    """The skin of each of the 16 moving parts, about the part's own joint at rest.

    A triangle goes with every part that moves enough of it, so that neighbours overlap where
    they bend; where the skin was cut the hole is closed by a fan about its middle. None for a
    part without skin.
    """
    if not len(model.faces):
        return [None] * N_PARTS
    moved = model.weights[model.faces].mean(1)
    belongs = moved >= np.minimum(_ENOUGH, moved.max(1))[:, None]
    made: list[Mesh | None] = []
    for part in range(N_PARTS):
        faces = model.faces[belongs[:, part]].astype(np.int64)
        if not len(faces):
            made.append(None)
            continue
        used, inside = np.unique(faces, return_inverse=True)
        vertices = model.rest_vertices[used] - model.rest_joints[PART_JOINT[part]]
        made.append(_closed(vertices, inside.reshape(-1, 3)))
    return made


def _closed(vertices: Array, faces: NDArray[np.int64]) -> Mesh:
    """The surface with a fan in each of its holes."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = {(int(a), int(b)) for a, b in edges}
    rim = [(a, b) for a, b in there if (b, a) not in there]
    hole = _holes(rim)
    points, more = [vertices], []
    for number in sorted(set(hole.values())):
        around = sorted(v for v, h in hole.items() if h == number)
        middle = len(vertices) + number
        points.append(vertices[around].mean(0)[None])
        more += [(b, a, middle) for a, b in sorted(rim) if hole[a] == number]
    return Mesh(np.concatenate(points), np.concatenate([faces, np.array(more, int).reshape(-1, 3)]))


def _holes(rim: list[tuple[int, int]]) -> dict[int, int]:
    """The number of its hole for each vertex of a rim: 0, 1, ..."""
    beside: dict[int, list[int]] = {}
    for a, b in rim:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    found: dict[int, int] = {}
    number = 0
    for start in sorted(beside):
        if start in found:
            continue
        waiting = [start]
        while waiting:
            vertex = waiting.pop()
            if vertex not in found:
                found[vertex] = number
                waiting += beside[vertex]
        number += 1
    return found


def write_stl(mesh: Mesh, path: Path) -> None:
    """Write a surface as binary STL."""
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    facets = np.zeros(len(corners), _FACET)
    facets["normal"] = normal / np.where(length > 0, length, 1)
    facets["corners"] = corners
    head = b"handtrack".ljust(80, b" ") + len(facets).to_bytes(4, "little")
    path.write_bytes(head + facets.tobytes())
