"""Frames of joints from arrays of any of the shapes that people have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import by_blocks
from handtrack.hand.skeleton import N_JOINTS, ORDER_JOINTS
from handtrack.sequences.joint_order import with_as_many
from handtrack.sequences.readers.jsontext import nested_array
from handtrack.sequences.readers.raw import Array, usable_confidence

JOINT_COUNTS = sorted(set(ORDER_JOINTS.values()))
PAIRS = (42, 50, 52)
"""Joints in a frame of two hands."""
_COUNTS = (*JOINT_COUNTS, *PAIRS)
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


def of_numbers(array: NDArray[Any], k: int) -> NDArray[Any] | None:
    """Joints of k numbers each as (T, N, k), from an array of any shape that holds frames of them,
    of a hand or of two; None where it does not."""
    if array.ndim == 4 and array.shape[0] == 1:
        array = array[0]  # one sequence of a batch
    if array.ndim == 4 and array.shape[1] in (1, 2) and array.shape[2] in JOINT_COUNTS:
        array = array.reshape(len(array), -1, array.shape[3])  # hands of a frame
    if k == 3 or array.ndim > 2:
        array = frames_first(array)
    if k == 3:
        array = of_poses(array)
    shape, sizes = array.shape, [k * n for n in _COUNTS]
    if array.ndim == 3 and shape[2] == k and shape[1] in _COUNTS:
        return array
    if array.ndim == 3 and shape[1] == k and shape[2] in JOINT_COUNTS:
        return array.transpose(0, 2, 1)  # rows of x, of y and of z
    if array.ndim == 2 and shape[1] in sizes:
        return array.reshape(shape[0], -1, k)
    if (array.ndim == 2 and shape[1] == k and shape[0] in _COUNTS) or (
        array.ndim == 1 and shape[0] in sizes
    ):
        return array.reshape(1, -1, k)
    return None


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


def frames_and_sure(value: Any, path: Path, what: str) -> tuple[Array, Array | None]:
    """As `as_frames`, and (T, N) how sure each joint is, where a fourth number says it: None where
    it says nothing.

    Raises:
        InputError: as `as_frames`.
    """
    array = value if isinstance(value, np.ndarray) else nested_array(value, path, what)
    fours = of_numbers(array, 4) if array.dtype.kind in "fiu" else None
    if fours is None or not _are_shares(fours[..., 3]):
        return as_frames(array, path, what), None
    joints = _whole(fours[..., :3], path, what)
    sure = usable_confidence(fours[..., 3].astype(np.float64), joints)
    return joints, sure if sure is None or sure.min() < 1 else None


def _are_shares(values: NDArray[Any]) -> bool:
    """Whether they are shares of certainty: 0 to 1, or missing."""
    there = np.isfinite(values)
    low, high = (f(values, where=there, initial=0.0) for f in (np.min, np.max))
    return bool(low >= 0 and high <= 1)


def as_frames(value: Any, path: Path, what: str = "joints") -> Array:
    """Joints as (T, N, 3) from an array or nested lists; null = missing.

    Raises:
        InputError: not numbers, or not of a shape that makes frames of 21 (25, 26) joints.
    """
    array = value if isinstance(value, np.ndarray) else nested_array(value, path, what)
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} holds {array.dtype}, expected numbers", path)
    frames = of_numbers(array, 3)
    if frames is None:
        shape = frames_first(array).shape
        known = with_as_many(shape[1]) if len(shape) == 3 and shape[2] == 3 else ""
        if len(shape) == 3 and shape[2] == 4:
            known = (
                "; a fourth number of each joint is taken as its confidence where all are 0 to 1:"
                " leave it out"
            )
        raise InputError(
            f"{what} has shape {shape}, expected (frames, 21, 3) or (frames, 63){known}", path
        )
    return _whole(frames, path, what)


def _whole(frames: NDArray[Any], path: Path, what: str) -> Array:
    if not len(frames):
        raise InputError(f"{what} holds no frames", path)
    return by_blocks(lambda part: part.astype(np.float64), frames)
