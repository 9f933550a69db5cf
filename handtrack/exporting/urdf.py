"""A hand as URDF, what ROS and most simulators load."""

from __future__ import annotations

from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from numpy.typing import NDArray

from handtrack.exporting.robot import SPEED, TORQUE, Capsule, Hinge, Link

Array = NDArray[np.float64]

DAMPING = 0.02
"""Of a hinge [N m s/rad]: lets it come to rest without ringing."""
_LIGHT = 1e-4
"""Mass of a body that only stands between two hinges [kg]; simulators take none of nothing."""
_COLOUR = "0.886 0.698 0.58 1"


def urdf(name: str, links: list[Link], base: str, meshes: dict[str, str]) -> ElementTree[Element]:
    """The document.

    A saddle is two hinges with a small body between them; a capsule is a cylinder and two
    balls.

    Args:
        name: of the robot.
        links: of `robot.links`.
        base: "wrist", or the name of a frame in which the wrist floats.
        meshes: the mesh file of each link that has one.
    """
    robot = Element("robot", name=name)
    # MuJoCo's own: keep the tips' frames, the meshes and their folder
    options = {"fusestatic": "false", "discardvisual": "false", "strippath": "false"}
    SubElement(SubElement(robot, "mujoco"), "compiler", options)
    material = SubElement(robot, "material", name="skin")
    SubElement(material, "color", rgba=_COLOUR)
    if base != links[0].name:
        SubElement(robot, "link", name=base)
        _joint(robot, f"{base}_to_{links[0].name}", "floating", base, links[0].name, np.zeros(3))
    for link in links:
        _link(robot, link, meshes.get(link.name))
        parent, offset = link.parent, link.offset
        for i, hinge in enumerate(link.hinges):
            child = link.name
            if i < len(link.hinges) - 1:
                child = f"{link.name}_between_{i + 1}"
                _between(robot, child)
            _hinge(robot, hinge, parent, child, offset)
            parent, offset = child, np.zeros(3)
        if link.parent and not link.hinges:
            _joint(robot, f"{link.name}_fixed", "fixed", parent, link.name, offset)
    indent(robot)
    return ElementTree(robot)


def numbers(values: Array | tuple[float, ...]) -> str:
    """Values as text, with more digits than float32 holds."""
    return " ".join(f"{x:.9g}" for x in np.asarray(values, np.float64).ravel() + 0.0)


def _joint(robot: Element, name: str, kind: str, parent: str, child: str, offset: Array) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "origin", xyz=numbers(offset), rpy="0 0 0")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def _hinge(robot: Element, hinge: Hinge, parent: str, child: str, offset: Array) -> None:
    joint = _joint(robot, hinge.name, "revolute", parent, child, offset)
    SubElement(joint, "axis", xyz=numbers(hinge.axis))
    SubElement(
        joint,
        "limit",
        lower=numbers((hinge.lower,)),
        upper=numbers((hinge.upper,)),
        effort=numbers((TORQUE,)),
        velocity=numbers((SPEED,)),
    )
    SubElement(joint, "dynamics", damping=numbers((DAMPING,)))
    if hinge.follows:
        share = numbers((hinge.share,))
        SubElement(joint, "mimic", joint=hinge.follows, multiplier=share, offset="0")


def _between(robot: Element, name: str) -> None:
    tiny = _LIGHT * 0.005**2  # as a ball of some millimetres
    _inertial(SubElement(robot, "link", name=name), _LIGHT, np.zeros(3), tiny * np.eye(3))


def _link(robot: Element, link: Link, mesh: str | None) -> None:
    made = SubElement(robot, "link", name=link.name)
    if link.mass:
        _inertial(made, link.mass, link.centre, link.inertia)
    if mesh:
        visual = SubElement(made, "visual")
        SubElement(SubElement(visual, "geometry"), "mesh", filename=mesh)
        SubElement(visual, "material", name="skin")
    for capsule in link.capsules:
        _capsule(made, "collision", capsule)
        if not mesh:
            _capsule(made, "visual", capsule)


def _inertial(link: Element, mass: float, centre: Array, inertia: Array) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=numbers(centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=numbers((mass,)))
    ends = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    ends["izz"] = (2, 2)
    SubElement(inertial, "inertia", {k: numbers((inertia[at],)) for k, at in ends.items()})


def _capsule(link: Element, kind: str, capsule: Capsule) -> None:
    along, radius = capsule.last - capsule.first, numbers((capsule.radius,))
    length = float(np.linalg.norm(along))
    pieces: list[tuple[str, Array, Array, dict[str, str]]] = [
        ("sphere", end, np.zeros(3), {"radius": radius}) for end in (capsule.first, capsule.last)
    ]
    middle = (capsule.first + capsule.last) / 2
    tube = {"radius": radius, "length": numbers((length,))}
    if length:
        pieces.append(("cylinder", middle, _roll_pitch_yaw(along / length), tube))
    for shape, origin, turn, size in pieces:
        made = SubElement(link, kind)
        SubElement(made, "origin", xyz=numbers(origin), rpy=numbers(turn))
        SubElement(SubElement(made, "geometry"), shape, size)
        if kind == "visual":
            SubElement(made, "material", name="skin")


def _roll_pitch_yaw(along: Array) -> Array:
    """Angles of Rz(yaw) Ry(pitch) Rx(roll) that bring z to a direction."""
    x, y, z = along
    return np.array([0.0, np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)])
