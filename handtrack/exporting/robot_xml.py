"""A hand as URDF, what ROS and most simulators load, and as MuJoCo's MJCF."""

from __future__ import annotations

from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from numpy.typing import NDArray

from handtrack.exporting.robot import SPEED, TORQUE, Hinge, Link
from handtrack.hand.capsules import SKIN_RGBA, add_capsule, add_skin_material, as_text

Array = NDArray[np.float64]

DAMPING = 0.02
"""Of a hinge [N m s/rad]: lets it come to rest without ringing."""
_LIGHT = 1e-4
"""Mass of a body that only stands between two hinges [kg]; simulators take none of nothing."""


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
    add_skin_material(robot)
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


def _joint(robot: Element, name: str, kind: str, parent: str, child: str, offset: Array) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "origin", xyz=as_text(offset), rpy="0 0 0")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def _hinge(robot: Element, hinge: Hinge, parent: str, child: str, offset: Array) -> None:
    joint = _joint(robot, hinge.name, "revolute", parent, child, offset)
    SubElement(joint, "axis", xyz=as_text(hinge.axis))
    SubElement(
        joint,
        "limit",
        lower=as_text((hinge.lower,)),
        upper=as_text((hinge.upper,)),
        effort=as_text((TORQUE,)),
        velocity=as_text((SPEED,)),
    )
    SubElement(joint, "dynamics", damping=as_text((DAMPING,)))
    if hinge.follows:
        share = as_text((hinge.share,))
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
        add_capsule(made, "collision", capsule)
        if not mesh:
            add_capsule(made, "visual", capsule)


def _inertial(link: Element, mass: float, centre: Array, inertia: Array) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=as_text(centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=as_text((mass,)))
    ends = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    ends["izz"] = (2, 2)
    SubElement(inertial, "inertia", {k: as_text((inertia[at],)) for k, at in ends.items()})


_ARMATURE = 1e-4
"""Inertia added to every hinge [kg m^2]: fingers are so light that solvers become stiff."""
_STIFFNESS = 1.0
"""Of the motors that hold an angle [N m/rad]; with `DAMPING` and `_ARMATURE` just not ringing."""


def mjcf(
    name: str, links: list[Link], base: str, meshes: dict[str, str], may_touch: set[frozenset[str]]
) -> ElementTree[Element]:
    """The document: bodies with the hinges of a joint together, and a motor for each angle.

    Args:
        name: of the model.
        links: of `robot.links`.
        base: "wrist", or the name of a frame in which the wrist floats: MuJoCo's world.
        meshes: the mesh file of each link that has one.
        may_touch: pairs of names of links whose capsules push each other away.
    """
    root = Element("mujoco", model=name)
    SubElement(root, "compiler", angle="radian", autolimits="true")
    SubElement(root, "option", integrator="implicitfast")
    assets = SubElement(root, "asset")
    SubElement(assets, "material", name="skin", rgba=SKIN_RGBA)
    for name, file in meshes.items():
        SubElement(assets, "mesh", name=name, file=file, inertia="shell")
    world = SubElement(root, "worldbody")
    bodies: dict[str, Element] = {}
    for link in links:
        parent = bodies[link.parent] if link.parent else world
        bodies[link.name] = _body(parent, link, link.name in meshes)
    if base != links[0].name:
        SubElement(world, "site", name=base, size="0.002")
        bodies[links[0].name].insert(0, Element("freejoint", name=f"{base}_to_{links[0].name}"))
    _contacts(root, links, may_touch)
    hinges = [hinge for link in links for hinge in link.hinges]
    _followers(root, hinges)
    _motors(root, hinges)
    indent(root)
    return ElementTree(root)


def _body(parent: Element, link: Link, skinned: bool) -> Element:
    if link.parent and not link.hinges:
        SubElement(parent, "site", name=link.name, pos=as_text(link.offset), size="0.002")
        return parent
    body = SubElement(parent, "body", name=link.name, pos=as_text(link.offset))
    full = link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    mass = as_text((link.mass,))
    SubElement(body, "inertial", pos=as_text(link.centre), mass=mass, fullinertia=as_text(full))
    for hinge in link.hinges:
        SubElement(
            body,
            "joint",
            name=hinge.name,
            axis=as_text(hinge.axis),
            range=as_text((hinge.lower, hinge.upper)),
            damping=as_text((DAMPING,)),
            armature=as_text((_ARMATURE,)),
        )
    if skinned:
        look = {"material": "skin", "contype": "0", "conaffinity": "0", "group": "2"}
        SubElement(body, "geom", {"type": "mesh", "mesh": link.name, **look})
    for capsule in link.capsules:
        ends = as_text(np.concatenate([capsule.first, capsule.last]))
        group = "3" if skinned else "2"
        size = as_text((capsule.radius,))
        SubElement(body, "geom", type="capsule", fromto=ends, size=size, group=group)
    return body


def _contacts(root: Element, links: list[Link], may_touch: set[frozenset[str]]) -> None:
    moving = [link.name for link in links if link.capsules]
    contact = SubElement(root, "contact")
    for i, one in enumerate(moving):
        for other in moving[i + 1 :]:
            if frozenset((one, other)) not in may_touch:
                SubElement(contact, "exclude", body1=one, body2=other)


def _followers(root: Element, hinges: list[Hinge]) -> None:
    equality = SubElement(root, "equality")
    for hinge in hinges:
        if hinge.follows:
            line = as_text((0.0, hinge.share, 0.0, 0.0, 0.0))
            SubElement(equality, "joint", joint1=hinge.name, joint2=hinge.follows, polycoef=line)


def _motors(root: Element, hinges: list[Hinge]) -> None:
    actuator = SubElement(root, "actuator")
    for hinge in hinges:
        if not hinge.follows:
            SubElement(
                actuator,
                "position",
                name=hinge.name,
                joint=hinge.name,
                kp=as_text((_STIFFNESS,)),
                ctrlrange=as_text((hinge.lower, hinge.upper)),
                forcerange=as_text((-TORQUE, TORQUE)),
            )
