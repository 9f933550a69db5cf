"""Frames of joints from arrays of any of the shapes that people have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.files.long_arrays import by_blocks
from handtrack.sequences.joint_order import with_as_many
from handtrack.sequences.readers.array_axes import (
    JOINT_COUNTS,
    frames_first,
    of_poses,
    with_fourth,
)
from handtrack.sequences.readers.jsontext import nested_array
from handtrack.sequences.readers.raw import Array, usable_confidence

PAIRS = (42, 50, 52)
"""Joints in a frame of two hands."""


def frames_and_sure(value: Any, path: Path, what: str) -> tuple[Array, Array | None]:
    """As `as_frames`, and (T, N) how sure each joint is, where a fourth number says it: None where
    it says nothing.

    Raises:
        InputError: as `as_frames`.
    """
    array = value if isinstance(value, np.ndarray) else nested_array(value, path, what)
    places, fourth = with_fourth(array)
    joints = as_frames(places, path, what)
    if fourth is None:
        return joints, None
    sure = usable_confidence(fourth.astype(np.float64), joints)
    return joints, sure if sure is None or sure.min() < 1 else None


def as_frames(value: Any, path: Path, what: str = "joints") -> Array:
    """Joints as (T, N, 3) from an array or nested lists; null = missing.

    Raises:
        InputError: not numbers, or not of a shape that makes frames of 21 (25, 26) joints.
    """
    array = value if isinstance(value, np.ndarray) else nested_array(value, path, what)
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} holds {array.dtype}, expected numbers", path)
    if array.ndim == 4 and array.shape[0] == 1:
        array = array[0]  # one sequence of a batch
    if array.ndim == 4 and array.shape[1] in (1, 2) and array.shape[2] in JOINT_COUNTS:
        array = array.reshape(len(array), -1, array.shape[3])  # hands of a frame
    array = of_poses(frames_first(array))
    shape = array.shape
    counts = [*JOINT_COUNTS, *PAIRS]
    flat_sizes = [3 * n for n in counts]
    if array.ndim == 3 and shape[2] == 3 and shape[1] in counts:
        frames = array
    elif array.ndim == 3 and shape[1] == 3 and shape[2] in JOINT_COUNTS:
        frames = array.transpose(0, 2, 1)  # rows of x, of y and of z
    elif array.ndim == 2 and shape[1] in flat_sizes:
        frames = array.reshape(shape[0], shape[1] // 3, 3)
    elif (array.ndim == 2 and shape[1] == 3 and shape[0] in counts) or (
        array.ndim == 1 and shape[0] in flat_sizes
    ):
        frames = array.reshape(1, -1, 3)
    else:
        known = with_as_many(shape[1]) if array.ndim == 3 and shape[2] == 3 else ""
        if array.ndim == 3 and shape[2] == 4:
            known = (
                "; a fourth number of each joint is taken as its confidence where all are 0 to 1:"
                " leave it out"
            )
        raise InputError(
            f"{what} has shape {shape}, expected (frames, 21, 3) or (frames, 63){known}", path
        )
    if not len(frames):
        raise InputError(f"{what} holds no frames", path)
    return by_blocks(lambda part: part.astype(np.float64), frames)
