"""The axes of arrays of joints: frames first, places alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import N_JOINTS, ORDER_JOINTS

JOINT_COUNTS = sorted(set(ORDER_JOINTS.values()))
_FEW = 25
"""Joints of a frame, at most: a longer axis is that of the frames."""
_WIDTHS = frozenset(n * k for n in (*JOINT_COUNTS, 2 * N_JOINTS) for k in (1, 3)) | {64}
"""Columns that a row of joints has: an array as wide has its frames first."""


def frames_first(array: NDArray[Any]) -> NDArray[Any]:
    """An array with the frames first: (21, 3, T) or (3, 21, T), as MATLAB has them, (21, T, 3),
    (3, T, 21), (63, T), or (2, T, 21, 3), a clip of each hand; (T, 63) of hands on an axis of
    their own; of anything else the same."""
    shape = array.shape
    if array.ndim == 4 and shape[::2] == (2, N_JOINTS) and shape[1] > _FEW:
        return array.transpose(1, 0, 2, 3).reshape(shape[1], -1, shape[3])
    if array.ndim == 2 and shape[0] == 3 * N_JOINTS and shape[1] not in _WIDTHS:
        return array.T if shape[1] > _FEW else array
    if array.ndim != 3:
        return array
    if shape[1] in (1, 2) and shape[2] in (3 * N_JOINTS, 4 * N_JOINTS):
        return array.reshape(shape[0], -1)
    if max(shape[1:]) <= _FEW:
        return array
    return array.transpose(
        _FRAMES_FIRST.get((shape[0], min(shape[1:]), shape[1] > shape[2]), _AS_IS)
    )


_AS_IS = (0, 1, 2)
_FRAMES_FIRST = {
    (N_JOINTS, 3, False): (2, 0, 1),
    (3, N_JOINTS, False): (2, 1, 0),
    (N_JOINTS, 3, True): (1, 0, 2),
    (3, N_JOINTS, True): (1, 2, 0),
}
"""By the first axis, the shorter of the others, and whether that is the last."""


def with_fourth(array: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any] | None]:
    """The places of joints that have a fourth number each, and that number; None where they have
    none, or one that is no share of certainty.

    Understood are (T, 21, 4), (T, 4, 21), (T, 2, 21, 4), (2, T, 21, 4), (21, 4)
    and rows of 84 or 168.
    """
    joints = frames_first(array) if array.ndim == 4 else array
    if joints.ndim == 3 and joints.shape[1] in (1, 2) and joints.shape[2] == 4 * N_JOINTS:
        joints = joints.reshape(len(joints), -1)
    if joints.ndim in (1, 2) and joints.shape[-1] in (4 * N_JOINTS, 8 * N_JOINTS):
        joints = joints.reshape(-1, joints.shape[-1] // 4, 4)
    if joints.ndim == 3 and joints.shape[1:] == (4, N_JOINTS):
        joints = joints.transpose(0, 2, 1)
    if joints.ndim == 4 and joints.shape[0] == 1:
        joints = joints[0]
    if joints.ndim == 4 and joints.shape[1] in (1, 2) and joints.shape[2:] == (N_JOINTS, 4):
        joints = joints.reshape(len(joints), -1, 4)
    if joints.ndim == 2 and joints.shape == (N_JOINTS, 4):
        joints = joints[None]
    if joints.ndim != 3 or joints.shape[1] not in (*JOINT_COUNTS, 2 * N_JOINTS):
        return array, None
    if joints.shape[2] != 4 or joints.dtype.kind not in "fiu":
        return array, None
    fourth = joints[..., 3]
    there = np.isfinite(fourth)
    low, high = (f(fourth, where=there, initial=0.0) for f in (np.min, np.max))
    return (joints[..., :3], fourth) if low >= 0 and high <= 1 else (array, None)


def of_poses(array: NDArray[Any]) -> NDArray[Any]:
    """The places of poses (T, N, 7), with their quaternions behind, or (T, N, 4, 4); of anything
    else the same."""
    if array.ndim == 3 and array.shape[2] == 7 and array.shape[1] in JOINT_COUNTS:
        length = np.linalg.norm(array[..., 3:], axis=-1)
        whole = np.isfinite(length) & (length > 0)
        turns = whole.any() and bool((np.abs(length[whole] - 1) < 0.01).all())
        return array[..., :3] if turns else array
    if array.ndim == 4 and array.shape[2:] == (4, 4) and array.shape[1] in JOINT_COUNTS:
        by_rows = not np.nan_to_num(array[..., 3, :3]).any()
        return array[..., :3, 3] if by_rows else array[..., 3, :3]
    return array
