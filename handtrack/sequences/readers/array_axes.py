"""The axes of arrays of joints: frames first, places alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import N_JOINTS, ORDER_JOINTS

JOINT_COUNTS = sorted(set(ORDER_JOINTS.values()))
_FEW = 25
"""Joints of a frame, at most: a longer axis is that of the frames."""


def frames_first(array: NDArray[Any]) -> NDArray[Any]:
    """An array (21, 3, T) or (3, 21, T), as MATLAB has them, or (2, T, 21, 3), a clip of each
    hand, with the frames first; of anything else the same."""
    if array.ndim == 4 and array.shape[::2] == (2, N_JOINTS) and array.shape[1] > _FEW:
        return array.transpose(1, 0, 2, 3).reshape(array.shape[1], -1, 3)
    if array.ndim != 3 or array.shape[2] <= _FEW:
        return array
    if array.shape[:2] == (N_JOINTS, 3):
        return array.transpose(2, 0, 1)
    return array.transpose(2, 1, 0) if array.shape[:2] == (3, N_JOINTS) else array


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
