"""Into the workspace and out of it: model, frame, pose, joints."""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import add, apply, dot, lane, matrix, part, put_row, row, scale, sub
from handtrack.kernels.workspace import ANGLES, BASE, BONES, FINGERS, JOINTS, WRIST


@inline
def load_model(w, model):
    """Write a model's constants into a workspace of zeros.

    Args:
        model: rest joints (21, 3) [m], axes (20, 3), lower and upper limits (20,) [rad], twist of
            the thumb, landmarks from their joints at rest (21, 3) [m].
    """
    rest, axes, lower, upper, twist, offsets = model
    load_skeleton(w, rest, axes, twist)
    load_offsets(w, offsets)
    for f in range(FINGERS):
        for a in range(ANGLES):
            w.lower[a, f], w.upper[a, f] = lower[4 * f + a], upper[4 * f + a]


@inline
def load_offsets(w, offsets):
    w.offset = 0
    for f in range(FINGERS + 1):
        for j in range(JOINTS):
            k = 0 if f == WRIST else 4 * f + 1 + j
            for i in range(3):
                v = offsets[k, i] if f < WRIST or j == BASE else 0.0
                w.rest_offset[j, i, f] = v
                w.mark[j, i, f] = w.joint[j, i, f] + v
                if v != 0.0:
                    w.offset = 1


@inline
def load_skeleton(w, rest, axes, twist):
    """The constants without the limits."""
    for f in range(FINGERS):
        for b in range(BONES):
            bone = sub(row(rest, 4 * f + b + 2), row(rest, 4 * f + b + 1))
            for i in range(3):
                w.rest_bone[b, i, f] = bone[i]
        along = lane(w.rest_bone, 0, f)
        along = scale(1.0 / math.sqrt(dot(along, along)), along)
        for i in range(3):
            w.joint[BASE, i, f] = rest[4 * f + 1, i]
            w.rest_along[i, f] = along[i]
        for a in range(ANGLES):
            for i in range(3):
                w.rest_axis[a, i, f] = axes[4 * f + a, i]
    w.twist[0] = twist
    for i in range(3):
        w.joint[BASE, i, WRIST] = rest[0, i]


@inline
def load_frame(w, targets, weights, top):
    """Write a frame's targets (21, 3) and weights (21,) over top; a missing target is not read.

    Weights of at most one keep the solver's absolute floors in proportion.
    """
    for f in range(FINGERS + 1):
        for j in range(JOINTS):
            k = 0 if f == WRIST else 4 * f + 1 + j
            weight = weights[k] / top if f < WRIST or j == BASE else 0.0
            w.weight[j, f] = weight
            for i in range(3):
                w.target[j, i, f] = targets[k, i] if weight > 0.0 else 0.0


@inline
def load_pose(w, angles, root):
    """Angles (20,) and root (12,): rotation by rows, translation."""
    for f in range(FINGERS):
        for a in range(ANGLES):
            w.angle[a, f] = angles[4 * f + a]
    for i in range(3):
        put_row(w.rotation, i, part(root, 3 * i))
        w.translation[i] = root[9 + i]


@inline
def store_pose(w, angles, root):
    for f in range(FINGERS):
        for a in range(ANGLES):
            angles[4 * f + a] = w.angle[a, f]
    for i in range(3):
        for j in range(3):
            root[3 * i + j] = w.rotation[i, j]
        root[9 + i] = w.translation[i]


@inline
def store_joints(w, out):
    """Joints (21, 3) of the placed pose in the world."""
    r, t = matrix(w.rotation), part(w.translation, 0)
    put_row(out, 0, add(apply(r, lane(w.joint, BASE, WRIST)), t))
    for f in range(FINGERS):
        for j in range(JOINTS):
            put_row(out, 4 * f + 1 + j, add(apply(r, lane(w.joint, j, f)), t))
