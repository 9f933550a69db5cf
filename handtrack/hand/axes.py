"""Directions in a hand at rest, from its skeleton alone: of its axes, and of each bone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import ModelError
from handtrack.hand.skeleton import BASES, N_ANGLES, PALM, PARENTS, Hand

Array = NDArray[np.float64]

# the bases on either side of a finger, thumb's side first: the palm is an arch, and a finger
# bends in the plane across it there
_ACROSS = {1: (5, 9), 2: (5, 13), 3: (9, 17), 4: (13, 17)}

# the thumb bends towards a point below the little finger's base, this far in palm lengths. In
# 55 hand-made poses of each hand it leaves 4 degrees at the MCP joint and 7 at the IP joint
# (medians), in a video's triangulated joints 13 at the MCP joint.
_THUMB_BELOW = 0.4

# how bent (sum of sines) a resting finger must be for its own plane to count like the palm
_OWN_PLANE = 1.0


def palm_frame(rest_joints: ArrayLike, hand: Hand) -> Array:
    """Axes of the palm.

    Args:
        rest_joints: (21, 3), any unit and frame.
        hand: "left" or "right".

    Returns:
        (3, 3), its rows: x from the wrist to the middle finger's base, y across the palm, z
        out of the back of the hand; right-handed.

    Raises:
        ModelError: wrist, index, middle and little finger base lie on one line.
    """
    j = np.asarray(rest_joints, dtype=np.float64)
    x = _unit(j[9] - j[0])
    up = np.cross(x, j[5] - j[17]) * _side(hand)
    if np.linalg.norm(up) < 0.1 * np.linalg.norm(j[5] - j[0]):
        raise ModelError("the palm has no width: its joints lie on one line")
    z = _unit(up)
    return np.stack([x, np.cross(z, x), z])


def local_axes(rest_joints: ArrayLike, hand: Hand) -> Array:
    """The axis of each of the 20 angles, from a hand's geometry at rest.

    Li et al. 2021 (section 3.1, Fig. 4) want z, the flexion axis, across the bone. A finger's is
    across the palm where the finger starts (its neighbours' bases), drawn towards the normal
    of the finger's own plane as far as the finger rests bent towards the palm. The thumb's is
    across the plane of its bones and a point under the little finger's base, to which it
    bends. Every axis is perpendicular to the bone that it turns.

    Args:
        rest_joints: (21, 3) with the fingers about straight, in any unit and frame.
        hand: "left" or "right".

    Returns:
        (20, 3) unit axes: flexion positive towards the palm, abduction towards the thumb's
        side (of the thumb: away from the index finger).

    Raises:
        ModelError: a bone has no length, or the palm no width.
    """
    j = np.asarray(rest_joints, dtype=np.float64)
    side = _side(hand)
    frame = palm_frame(j, hand)
    size = np.linalg.norm(j[BASES[1:]] - j[0], axis=1).mean()
    axes = np.empty((N_ANGLES, 3))
    for f, base in enumerate(BASES):
        bones = np.diff(j[base : base + 4], axis=0)
        length = np.linalg.norm(bones, axis=1)
        if length.min() < 1e-6 * size:
            raise ModelError(f"the bone to joint {base + 1 + int(np.argmin(length))} has no length")
        bones /= length[:, None]
        if f == 0:
            palmar = j[17] - _THUMB_BELOW * size * frame[2] - j[base + 1]
            hinge = np.cross(bones[1], palmar)
        else:
            thumb_side, little_side = _ACROSS[f]
            hinge = side * (j[thumb_side] - j[little_side])
        hinge = _unit(_across(hinge, bones.mean(0)))
        own = np.cross(bones[:-1], bones[1:]).sum(0)
        hinge = hinge * _OWN_PLANE + own * (own @ hinge > 0)
        z = [_unit(_across(hinge, bone)) for bone in bones]
        # x along the bone, z across it: y turns to the thumb's side
        axes[4 * f : 4 * f + 4] = [z[0], side * np.cross(bones[0], z[0]), z[1], z[2]]
    return axes


def _side(hand: Hand) -> float:
    return 1.0 if hand == "right" else -1.0


def _across(v: Array, direction: Array) -> Array:
    """What of v is perpendicular to a direction."""
    d = _unit(direction)
    return np.asarray(v - d * (v @ d))


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v)
    if length < 1e-12:
        raise ModelError("a direction of the hand at rest is not defined: joints coincide")
    return np.asarray(v / length)


_INDEX, _MIDDLE, _LITTLE = 5, 9, 17


def rest_frames(rest_joints: ArrayLike, hand: Hand) -> Array:
    """The frames of the bones that arrive at the joints of a hand at rest.

    Args:
        rest_joints: (21, 3), any unit.
        hand: "left" or "right".

    Returns:
        (21, 3, 3), columns: along the bone (of the wrist: to the middle finger's base), towards
        the thumb's side, and their normal out of the back of the hand. A left hand's are the
        mirror images of a right hand's.

    Raises:
        ModelError: a bone has no length, or lies along the palm's breadth.
    """
    j = np.asarray(rest_joints, dtype=np.float64)
    along = j - j[np.maximum(PARENTS, 0)]
    along[0] = j[_MIDDLE] - j[0]
    across = j[_INDEX] - j[_LITTLE]
    x = _units(along)
    y = _units(across - (x @ across)[:, None] * x)
    z = np.cross(x, y) * (1.0 if hand == "right" else -1.0)
    return np.stack([x, y, z], -1)


def palm_length(joints: ArrayLike) -> float:
    """Mean distance from the wrist to the four finger bases, of (21, 3) joints."""
    j = np.asarray(joints, dtype=np.float64)
    return float(np.linalg.norm(j[PALM[2:]] - j[0], axis=1).mean())


def _units(v: Array) -> Array:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    if length.min() < 1e-9:
        raise ModelError(f"joint {int(length.argmin())}: its bone has no frame at rest")
    return np.asarray(v / length)
