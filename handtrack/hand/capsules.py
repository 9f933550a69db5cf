"""A hand as capsules: bones with a radius, which of them may meet (Li et al. 2021), the bodies
that they are, and how URDF writes these."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES, TIPS

Array = NDArray[np.float64]

FINGER_RADII = np.array(
    [
        [0.0100, 0.0095, 0.0090],
        [0.0090, 0.0080, 0.0070],
        [0.0090, 0.0080, 0.0075],
        [0.0085, 0.0080, 0.0070],
        [0.0080, 0.0070, 0.0065],
    ]
)
"""(5, 3) radii of the finger bones' capsules [m], base to tip, for a hand without a skin: our
choice, a little below half the breadth of an adult's fingers, for flesh gives way where fingers
touch."""
PALM_RADIUS = 0.0095
"""Radius of the palm's four bones, from the wrist to the fingers' bases [m]."""
SIZE = 0.091
"""Length of the palm of the hand that these radii belong to (`HandModel.size`) [m]."""

N_BONES = 19
"""Capsules: three of each finger, thumb first, base to tip; then the palm's, index to little."""

# of the distances of a bone's skin from it: below the middle, for flesh gives way
_SHARE = 0.25
# the palm is broader than thick
_PALM_SHARE = 0.05
# bones that lie side by side at rest do not push each other
_AT_REST = 0.9


def bone_joints() -> NDArray[np.int64]:
    """(19, 2) first and last joint of each capsule's bone."""
    fingers = [(4 * f + 1 + i, 4 * f + 2 + i) for f in range(5) for i in range(3)]
    return np.array(fingers + [(0, 4 * f + 1) for f in range(1, 5)])


def capsule_radii(model: HandModel) -> Array:
    """(19,) radii of a hand's capsules [m], from its skin; scaled standard ones without one."""
    radii = np.append(FINGER_RADII.ravel(), np.full(4, PALM_RADIUS)) * (model.size / SIZE)
    if not len(model.rest_vertices):
        return radii
    strongest = model.weights.argmax(1)
    rest = model.rest_joints
    for bone, (first, last) in enumerate(bone_joints()):
        palm = bone >= 15
        skin = model.rest_vertices[strongest == (0 if palm else bone + 1)]
        along = rest[last] - rest[first]
        offset = skin - rest[first]
        share = offset @ along / (along @ along)
        # away from its ends, where other bones' skin begins
        beside = (share > 0.2) & (share < 0.9)
        distance = np.linalg.norm(offset - share[:, None] * along, axis=1)[beside]
        if len(distance):
            radii[bone] = np.quantile(distance, _PALM_SHARE if palm else _SHARE)
    return radii


def contacts(model: HandModel) -> Array:
    """(P, 5) pairs of capsules that may meet: their numbers; how near the bones may come [m];
    and the part of each bone, from its base, that is the axis of its capsule.

    Bones of different fingers; the last two of each finger and the palm. They may come as near
    as the sum of the radii, or as the flat hand has them. A fingertip is where the skin ends, so
    the last capsule's axis ends a radius before it.
    """
    radii = capsule_radii(model)
    pairs = [
        (a, b)
        for a in range(15)
        for b in range(a + 1, N_BONES)
        if (a // 3 != b // 3 if b < 15 else a % 3 > 0)
    ]
    numbers = np.array(pairs)
    share = np.ones(N_BONES)
    tips = np.arange(2, 15, 3)
    share[tips] = np.maximum(1.0 - radii[tips] / model.bone_lengths[4 * np.arange(5) + 3], 0.0)
    out = np.column_stack([numbers, radii[numbers].sum(1), share[numbers]])
    at_rest = out[:, 2] - contact_depths(model.rest_joints[None], out)[0]
    out[:, 2] = np.minimum(out[:, 2], _AT_REST * at_rest)
    return out


def contact_depths(x: Array, pairs: Array) -> Array:
    """How deep pairs of capsules sink into each other; negative where they are apart.

    Args:
        x: (T, 21, 3) joints [m].
        pairs: (P, 5) as `contacts` gives them; (P, 3) for capsules as long as their bones.

    Returns:
        (T, P) [m], NaN where a joint is missing.
    """
    sides = []
    for side in (0, 1):
        first, last = bone_joints()[pairs[:, side].astype(int)].T
        share = pairs[:, 3 + side, None] if pairs.shape[1] > 3 else 1.0
        sides += [x[:, first], x[:, first] + share * (x[:, last] - x[:, first])]
    return np.asarray(pairs[:, 2] - segment_distance(*sides))


def segment_distance(p0: ArrayLike, p1: ArrayLike, q0: ArrayLike, q1: ArrayLike) -> Array:
    """Distance (...) of the segments p0-p1 and q0-q1, each end (..., 3).

    The least of |p0 + s u - q0 - t v| over the unit square is inside it, where the gradient
    is zero, or on one of its four sides, where it is a point-to-segment distance.
    """
    p0, p1, q0, q1 = (np.asarray(v, dtype=np.float64) for v in (p0, p1, q0, q1))
    u, v, w = p1 - p0, q1 - q0, p0 - q0
    a, b, c = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    d, e = (u * w).sum(-1), (v * w).sum(-1)
    det = a * c - b * b
    skew = det > 1e-12 * a * c
    safe = np.where(skew, det, 1.0)
    s, t = (b * e - c * d) / safe, (a * e - b * d) / safe
    inside = skew & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    between = np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)
    sides = np.minimum(
        np.minimum(_point_segment(p0, q0, v, c), _point_segment(p1, q0, v, c)),
        np.minimum(_point_segment(q0, p0, u, a), _point_segment(q1, p0, u, a)),
    )
    return np.asarray(np.where(inside, np.minimum(between, sides), sides))


def _point_segment(
    point: Array, start: Array, along: Array, squared_length: NDArray[np.float64]
) -> Array:
    offset = point - start
    safe = np.where(squared_length > 0, squared_length, 1.0)
    t = np.clip((offset * along).sum(-1) / safe, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - t[..., None] * along, axis=-1))


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
