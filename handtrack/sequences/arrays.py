"""A sequence of joints that are in memory: what `handtrack.track` takes beside sequences."""

from __future__ import annotations

import warnings
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS
from handtrack.hand.units import METRES
from handtrack.sequences.assemble import check_settings
from handtrack.sequences.load import finished
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.size import WrongUnit, absurd

Array = NDArray[np.float64]

_FPS = 30.0
_WANTED = f"expected a Sequence, or joints (T, {N_JOINTS}, 3) in metres"


def sequence_of(given: object) -> Sequence:
    """A sequence as it is; of joints one, judged as those of a file are.

    Args:
        given: a Sequence, or what NumPy makes an array of: (T, 21, 3) or (T, 63) joints in metres
            in MediaPipe's order, NaN where one is missing; (21, 3) is one frame.

    Returns:
        Of joints one at 30 frames/s, of the hand that its fingers bend like; both are warned of.

    Raises:
        InputError: it is neither, or no hand's joints in metres.
    """
    if isinstance(given, Sequence):
        return given
    if isinstance(given, str | PathLike):
        raise InputError(f"{given} is a path, {_WANTED}; handtrack.load reads files")
    if isinstance(given, list | tuple) and any(isinstance(one, Sequence) for one in given):
        raise InputError(f"a list of {len(given)} sequences, {_WANTED}: track each by itself")
    joints = _joints(given)
    times = np.round(np.arange(len(joints)) * 1e9 / _FPS).astype(np.int64)
    raw = Raw(joints, Path("joints"), "joints", unit="m", time_ns=times)
    try:
        (sequence,) = finished([raw], check_settings(None, None, None), "auto", None)
    except WrongUnit as error:
        if error.fits is None:
            raise
        cure = f"; {error.fits} would fit: divide by {1 / METRES[error.fits]:.0f}"
        raise InputError(absurd(error.palm, " with unit m", cure), error.path) from None
    assumed = f"no times given: {_FPS:g} frames/s assumed"
    notes = (assumed, *sequence.notes)
    told = "; ".join(notes)
    warnings.warn(f"joints: {told} (handtrack.Sequence holds times and hand)", stacklevel=3)
    return replace(sequence, notes=notes, timed=False, numbered=False, source="")


def _joints(given: object) -> Array:
    """(T, 21, 3), NaN where missing."""
    try:
        array: NDArray[Any] = np.asarray(given)
        if array.dtype.kind not in "fiuO" or not array.ndim:
            raise TypeError
        joints: Array = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"a {type(given).__name__} is no joints, {_WANTED}") from error
    if joints.shape == (N_JOINTS, 3):
        joints = joints[None]
    if joints.ndim == 2 and joints.shape[1] == 3 * N_JOINTS:
        joints = joints.reshape(-1, N_JOINTS, 3)
    if joints.ndim == 3 and joints.shape[1:] == (N_JOINTS, 3):
        if not len(joints):
            raise InputError(f"joints of no frame, {_WANTED}")
        return joints
    cure = ""
    if joints.ndim > 1 and int(np.prod(joints.shape[1:])) == 6 * N_JOINTS:
        cure = "; of two hands each is tracked by itself"
    elif joints.shape[1:] == (N_JOINTS, 2):
        cure = "; x and y alone are places in a picture, which files may hold: handtrack.load"
    elif joints.ndim == 3 and joints.shape[2] == 3:
        cure = "; handtrack.load reads files with joints in other orders"
    raise InputError(f"joints have shape {joints.shape}, {_WANTED}{cure}")
