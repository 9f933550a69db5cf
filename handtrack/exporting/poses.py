"""Poses of every joint in the world, and joints as robots' retargeters take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import (
    matrix_to_quaternion,
    matrix_to_vector,
    quaternion_to_matrix,
)
from handtrack.hand.skeleton import BASES, N_JOINTS, TIPS
from handtrack.tracking.track import Track

Array = NDArray[np.float64]

_TO_MANO = {
    "right": np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]]),
    "left": np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]),
}
"""From the axes along the palm, out of it and across it to MANO's, as dex-retargeting has them."""


def joint_parts() -> NDArray[np.int64]:
    """(21,) the moving part that each joint turns with: its own, of a tip the bone before it."""
    joint = np.arange(N_JOINTS)
    inside = np.where(np.isin(joint, TIPS), joint - 1, joint)
    return np.where(joint == 0, 0, 3 * ((inside - 1) // 4) + (inside - 1) % 4 + 1)


def joint_rotations(track: Track) -> Array:
    """(T, 21, 3, 3) rotations of the joints in the world, of the filtered poses; NaN where the
    hand is lost, or of fingers that no frame saw.

    They are what the joints turned since the flat hand whose root frame is the world's: all are
    equal where the fingers are straight. A tip turns with the bone before it.
    """
    turn = quaternion_to_matrix(track.quaternion)
    parts = turn[:, None] @ track.model.rotations(track.angles)
    out = parts[:, joint_parts()]
    return np.where(track.measured_joints[:, None, None], out, np.nan)


def rotation_values(rotations: Array, form: str) -> tuple[list[str], Array]:
    """Rotations (..., 3, 3) as numbers (..., n), and what each is called.

    Args:
        rotations: they.
        form: "quaternion" (w x y z), "matrix" (row by row) or "axis-angle" (a vector along the
            axis, as long as the angle [rad]).
    """
    known = np.asarray(np.isfinite(rotations).all((-1, -2), keepdims=True))
    safe = np.where(known, rotations, np.eye(3))
    if form == "matrix":
        names = [f"r{i}{j}" for i in range(3) for j in range(3)]
        values = rotations.reshape(*rotations.shape[:-2], 9)
    elif form == "quaternion":
        names, values = [f"q{c}" for c in "wxyz"], matrix_to_quaternion(safe)
    else:
        names, values = [f"r{c}_rad" for c in "xyz"], matrix_to_vector(safe)
    return names, np.where(known[..., 0], values, np.nan)


def operator_frame(joints: Array, hand: str) -> tuple[Array, Array]:
    """Joints about the wrist in the frame that dex-retargeting takes them in, its operator's.

    Its axes are of the plane of the wrist and the bases of index and middle finger: z from the
    wrist to the middle finger, y across towards the index finger, or away from it in a left
    hand, x out of the palm (`estimate_frame_from_hand_points` and `OPERATOR2MANO` there).

    Args:
        joints: (T, 21, 3) [m], in any right-handed frame.
        hand: "left" or "right".

    Returns:
        (T, 21, 3) joints [m], and (T, 3, 3) whose columns are the axes in the joints' frame; NaN
        where one of the three is missing or they lie on a line.
    """
    wrist, index, middle = joints[:, 0], joints[:, BASES[1]], joints[:, BASES[2]]
    with np.errstate(invalid="ignore", divide="ignore"):
        back = _unit(wrist - middle)
        normal = _unit(np.cross(back, index - middle))
        across = np.cross(back, normal)
        # towards the index finger
        sign = np.where((across * (index - middle)).sum(-1) < 0, -1.0, 1.0)[:, None]
    axes = np.stack([back, sign * normal, sign * across], -1) @ _TO_MANO[hand]
    return np.einsum("tji,tik->tjk", joints - wrist[:, None], axes), axes


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 1e-9, length, np.nan))
