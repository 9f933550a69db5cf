"""A hand as ROS, Rerun and Foxglove draw a robot: capsules on the frames of its parts."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, tostring

from handtrack.hand.capsule_shapes import add_capsule, add_skin_material, joint_capsules
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import PART_JOINT, PART_NAMES, PART_PARENT
from handtrack.mcap.foxglove import cdr_string


def robot_description(topic: str, model: HandModel) -> bytes:
    """std_msgs/msg/String, in little-endian CDR, of a URDF whose links are the frames of
    `TransformEncoder`: those move it, so its joints only say which link hangs on which.

    Args:
        topic: of the hand; names the frames.
        model: the hand, with or without a skin.
    """
    robot = Element("robot", name=topic)
    add_skin_material(robot)
    SubElement(robot, "link", name=topic)
    capsules = joint_capsules(model)
    names = [f"{topic}/{name}" for name in PART_NAMES]
    for part, name in enumerate(names):
        link = SubElement(robot, "link", name=name)
        for capsule in capsules[PART_JOINT[part]]:
            add_capsule(link, "visual", capsule)
        joint = SubElement(robot, "joint", name=f"{name}_frame", type="floating")
        SubElement(joint, "parent", link=names[PART_PARENT[part]] if part else topic)
        SubElement(joint, "child", link=name)
    return b"\x00\x01\x00\x00" + cdr_string(tostring(robot, encoding="unicode"))
