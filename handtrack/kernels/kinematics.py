"""Forward kinematics: where the angles put joints and axes (Li et al. 2021, eq. 1, 2, 4, 5)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.exchange import load_skeleton, store_joints
from handtrack.kernels.vectors import add, cos_sin, lane, put_column, put_lane, reduced, rotate, row
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    BASE,
    BONES,
    FINGERS,
    FLEXION,
    HINGE_1,
    HINGE_2,
    LANES,
    WORK,
)

Array = NDArray[np.float64]

_UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@inline
def rotation_about(w, a, f):
    """Angle a's rotation exp(n_a phi_a) in lane f: axis, cosine and sine (eq. 1)."""
    c, s = cos_sin(reduced(w.angle[a, f]))
    return lane(w.rest_axis, a, f), c, s


@inline
def rotations_of(w, f):
    """Lane f's rotations: flexion, abduction, the inner turn about the first bone, two hinges."""
    z, y = rotation_about(w, FLEXION, f), rotation_about(w, ABDUCTION, f)
    first, second = rotation_about(w, HINGE_1, f), rotation_about(w, HINGE_2, f)
    e = (w.rest_along[0, f], w.rest_along[1, f], w.rest_along[2, f])
    c, s = cos_sin(reduced(w.twist[f] * w.angle[ABDUCTION, f]))
    return z, y, (e, c, s), first, second


@inline
def about(rotation, v):
    n, c, s = rotation
    return rotate(n, c, s, v)


@inline
def place_fingers(w):
    """Joints, axes and the first bone's direction, in the root frame, from the angles.

    With the thumb's inner turn about its first bone e: R_0 = exp(n_z phi_z) exp(n_y phi_y)
    exp(e alpha phi_y) (eq. 2), R_1, R_2 = exp(n phi) (eq. 1); A_i = A_(i-1) R_i (eq. 4) turns
    the bone behind joint i, x_(i+1) = x_i + A_i b_i (eq. 5).
    """
    for f in range(LANES):
        # `rotations_of`, which the compiler leaves a call here: that costs a fit half its speed
        z, y = rotation_about(w, FLEXION, f), rotation_about(w, ABDUCTION, f)
        first, second = rotation_about(w, HINGE_1, f), rotation_about(w, HINGE_2, f)
        e = (w.rest_along[0, f], w.rest_along[1, f], w.rest_along[2, f])
        c, s = cos_sin(reduced(w.twist[f] * w.angle[ABDUCTION, f]))
        inner = e, c, s
        # from the tip inwards: each joint turns all that hangs on it
        tip_bone = about(inner, about(first, about(second, lane(w.rest_bone, 2, f))))
        middle_bone = about(inner, about(first, lane(w.rest_bone, 1, f)))
        axis_2 = about(inner, about(first, second[0]))
        axis_1 = about(inner, first[0])
        base_bone = about(z, about(y, lane(w.rest_bone, 0, f)))
        middle_bone, tip_bone = about(z, about(y, middle_bone)), about(z, about(y, tip_bone))
        axis_1, axis_2 = about(z, about(y, axis_1)), about(z, about(y, axis_2))
        e = about(z, about(y, e))
        axis_y, twist = about(z, y[0]), w.twist[f]
        for i in range(3):
            w.axis[FLEXION, i, f] = z[0][i]
            # abduction also twists the thumb about its own bone
            w.axis[ABDUCTION, i, f] = axis_y[i] + twist * e[i]
            w.axis[HINGE_1, i, f], w.axis[HINGE_2, i, f] = axis_1[i], axis_2[i]
            w.along[i, f] = e[i]
        x = add(lane(w.joint, BASE, f), base_bone)
        put_lane(w.joint, 1, f, x)
        put_lane(w.mark, 1, f, x)
        x = add(x, middle_bone)
        put_lane(w.joint, 2, f, x)
        put_lane(w.mark, 2, f, x)
        x = add(x, tip_bone)
        put_lane(w.joint, 3, f, x)
        put_lane(w.mark, 3, f, x)


@inline
def place_marks(w):
    """Landmarks l_j = x_j + A_p o_j, with p the bone that arrives at joint j.

    `place_fingers` has left the joints there, and those of the bases never move.
    """
    if w.offset:
        for f in range(FINGERS):
            move_marks(w, f)


@inline
def move_marks(w, f):
    z, y, inner, first, second = rotations_of(w, f)
    middle = about(first, lane(w.rest_offset, 2, f))
    tip = about(first, about(second, lane(w.rest_offset, 3, f)))
    moved = lane(w.rest_offset, 1, f), middle, tip
    for j in range(BONES):
        o = about(z, about(y, about(inner, moved[j])))
        put_lane(w.mark, 1 + j, f, add(lane(w.mark, 1 + j, f), o))


@inline
def store_parts(w, out):
    """Accumulated rotations A_i (16, 3, 3) of the palm and of three parts a finger (eq. 4)."""
    for k in range(3):
        put_column(out[0], k, _UNITS[k])
    for f in range(FINGERS):
        z, y, inner, first, second = rotations_of(w, f)
        for k in range(3):
            hinged = about(first, _UNITS[k]), about(first, about(second, _UNITS[k]))
            turned = _UNITS[k], hinged[0], hinged[1]
            for i in range(BONES):
                v = about(z, about(y, about(inner, turned[i])))
                put_column(out[1 + BONES * f + i], k, v)


@kernel
def place_all(rest, axes, twist, angles, joints, parts, turning):
    """`place_poses` of poses in one row."""
    works = np.zeros(1, dtype=WORK)
    w = works[0]
    load_skeleton(w, rest, axes, twist)
    for i in range(3):
        w.rotation[i, i] = 1.0
    for n in range(len(angles)):
        for f in range(FINGERS):
            for a in range(ANGLES):
                w.angle[a, f] = angles[n, ANGLES * f + a]
        place_fingers(w)
        store_joints(w, joints[n])
        store_parts(w, parts[n])
        for f in range(FINGERS):
            for a in range(ANGLES):
                for i in range(3):
                    turning[n, ANGLES * f + a, i] = w.axis[a, i, f]


class Placed(NamedTuple):
    """Poses in the root frame.

    Attributes:
        joints: (..., 21, 3), in the unit of the skeleton at rest.
        parts: (..., 16, 3, 3) accumulated rotations A_k of the palm and the fingers' parts.
        axes: (..., 20, 3) what each angle turns about: its axis, where the rotations before it
            have brought it, and with the thumb's abduction the twist about its own bone.
    """

    joints: Array
    parts: Array
    axes: Array


def place_poses(rest: Array, axes: Array, twist: float, angles: Array) -> Placed:
    """Forward kinematics of any number of poses, called from Python.

    Args:
        rest: (21, 3) joints at rest; axes: (20, 3) unit vectors; twist: of the thumb, see
            `HandModel`.
        angles: (..., 20) [rad], of any size; a finger with a NaN is NaN from there on.
    """
    lead = angles.shape[:-1]
    # copies: one type of arrays, so that one machine code does
    flat = np.array(angles, dtype=np.float64, order="C").reshape(-1, ANGLES * FINGERS)
    n = len(flat)
    joints, parts = np.empty((n, 21, 3)), np.empty((n, 1 + BONES * FINGERS, 3, 3))
    turning = np.empty((n, ANGLES * FINGERS, 3))
    skeleton = np.array(rest, dtype=np.float64), np.array(axes, dtype=np.float64)
    place_all(*skeleton, float(twist), flat, joints, parts, turning)
    return Placed(
        joints.reshape(*lead, *joints.shape[1:]),
        parts.reshape(*lead, *parts.shape[1:]),
        turning.reshape(*lead, *turning.shape[1:]),
    )


@kernel
def turn_all(axes, angles, out):
    """`turns_about` of rotations in one row."""
    for n in range(len(angles)):
        axis, c, s = row(axes, n), math.cos(angles[n]), math.sin(angles[n])
        for k in range(3):
            put_column(out[n], k, rotate(axis, c, s, _UNITS[k]))


def turns_about(axis: Array, angle: Array) -> Array:
    """Rotation matrices (..., 3, 3) about unit axes (..., 3) by angles (...) [rad]."""
    lead = np.broadcast_shapes(axis.shape[:-1], angle.shape)
    out = np.empty((math.prod(lead), 3, 3))
    # copies: one type of arrays, so that one machine code does
    axes = np.array(np.broadcast_to(axis, (*lead, 3)), order="C").reshape(-1, 3)
    turn_all(axes, np.array(np.broadcast_to(angle, lead), order="C").reshape(-1), out)
    return out.reshape(*lead, 3, 3)
