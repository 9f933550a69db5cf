"""Reader of emg2pose (Salter et al. 2024): 20 UmeTrack angles at 2 kHz beside the muscles.

    emg2pose/timeseries   (T,) records of time [s], joint_angles (20) [rad], emg (16)
    attributes of emg2pose: side, user, session, stage, sample_rate

Frames whose angles are all 0 are those in which no pose was found. The wrist's pose is not
stored: joints are in its frame.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import as_side
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.hdf5_arrays import said
from handtrack.sequences.readers.hdf5_file import dataset, member
from handtrack.sequences.readers.raw import Raw, stem
from handtrack.sequences.readers.umetrack import N_HINGES, Angles

_LARGEST = 1e3


def read(file: Any, path: Path) -> list[Raw] | None:
    """The hand of an open HDF5 file; None where it is none of emg2pose.

    Raises:
        InputError: records without times or angles, or without a side.
    """
    group = member(file, "emg2pose", path)
    if group is None or not hasattr(group, "keys"):
        return None
    table = dataset(group, "timeseries", path)
    fields = () if table is None else table.dtype.names or ()
    if table is None or not {"time", "joint_angles"} <= set(fields):
        there = shown(", ".join(fields)) or "no timeseries"
        raise InputError(f"emg2pose/timeseries holds {there}, expected time and joint_angles", path)
    if table.ndim != 1 or not len(table):
        raise InputError(f"emg2pose/timeseries has shape {table.shape}, expected (frames,)", path)
    angles = np.asarray(table["joint_angles"], dtype=np.float64)
    if angles.shape != (len(table), N_HINGES):
        raise InputError(
            f"joint_angles have shape {angles.shape}, expected (frames, {N_HINGES})", path
        )
    if not (np.abs(angles) < _LARGEST).all():
        raise InputError("a joint angle is no number of radians", path)
    times = np.asarray(table["time"], dtype=np.float64)
    side = as_side(said(group, "side", path)) or _in_name(path)
    if side is None:
        raise InputError("does not say which hand it is of (attribute side)", path)
    lost = ~angles.any(1)
    angles[lost] = np.nan
    raw = Raw(
        np.full((len(angles), 21, 3), np.nan),
        path,
        stem(path),
        hand=side,
        unit="m",
        stamps=Stamps(times, "time", "s"),
        subject=said(group, "user", path),
        pending=Angles(angles),
        notes=("the wrist's pose is not in it: joints are in the wrist's frame",),
    )
    if lost.any():
        raw.notes += (f"{lost.sum()} frames without a pose (angles all 0) were taken as missing",)
    return [raw]


def _in_name(path: Path) -> Any:
    return as_side(path.stem.rpartition("_")[2])


FORMATS = (
    Format(
        "emg2pose",
        "`.hdf5` sessions, 2000 poses a second; joints in the wrist's frame",
        "umetrack",
        "m, angles in rad",
        "one",
        "`emg2pose/timeseries`",
        "UmeTrack's `generic_hand_model.json` beside it (`--profile FILE`); extra `formats`",
        hdf5=read,
    ),
)
