"""A hand as MJCF, MuJoCo's own format."""

from __future__ import annotations

from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

from handtrack.exporting.robot import TORQUE, Hinge, Link
from handtrack.exporting.urdf import DAMPING, numbers

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
    SubElement(assets, "material", name="skin", rgba="0.886 0.698 0.58 1")
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
        SubElement(parent, "site", name=link.name, pos=numbers(link.offset), size="0.002")
        return parent
    body = SubElement(parent, "body", name=link.name, pos=numbers(link.offset))
    full = link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    mass = numbers((link.mass,))
    SubElement(body, "inertial", pos=numbers(link.centre), mass=mass, fullinertia=numbers(full))
    for hinge in link.hinges:
        SubElement(
            body,
            "joint",
            name=hinge.name,
            axis=numbers(hinge.axis),
            range=numbers((hinge.lower, hinge.upper)),
            damping=numbers((DAMPING,)),
            armature=numbers((_ARMATURE,)),
        )
    if skinned:
        look = {"material": "skin", "contype": "0", "conaffinity": "0", "group": "2"}
        SubElement(body, "geom", {"type": "mesh", "mesh": link.name, **look})
    for capsule in link.capsules:
        ends = numbers(np.concatenate([capsule.first, capsule.last]))
        group = "3" if skinned else "2"
        size = numbers((capsule.radius,))
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
            line = numbers((0.0, hinge.share, 0.0, 0.0, 0.0))
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
                kp=numbers((_STIFFNESS,)),
                ctrlrange=numbers((hinge.lower, hinge.upper)),
                forcerange=numbers((-TORQUE, TORQUE)),
            )
