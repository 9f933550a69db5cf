"""Tracks as tables: a row for each frame, as CSV and as Parquet."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.exporting.poses import joint_rotations, operator_frame, rotation_values
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.tracking.track import Track, mean_and_max

if TYPE_CHECKING:
    import pyarrow

_DIGITS = 6
"""Of degrees and millimetres in text: below what float32 input can tell."""
_TIME_DIGITS = 9


def columns(
    track: Track, origin_ns: int, rotations: str | None = None, frame: str = "world"
) -> dict[str, NDArray[Any]]:
    """The table of a track: names, with units at their ends, and columns of T values.

    `frame`, `time_ns`, `time_s` (from `origin_ns`), `hand`, `status`, `reason`; the 20 angles
    (`index_mcp_flexion_deg`), where a filter was used also as fitted
    (`index_mcp_flexion_raw_deg`), and their standard deviation (`..._sd_deg`); the pose of the
    root frame in the world (`rotation_w`, ..., `translation_x_mm`); the joints of that pose
    (`wrist_x_mm`), the observed and, if known, the true ones (`observed_wrist_x_mm`,
    `truth_wrist_x_mm`); distances of the observed joints to the fitted ones (`error_wrist_mm`,
    `error_mean_mm`, `error_max_mm`) and of the output to the truth (`truth_error_mean_mm`);
    the fit's `objective_mm2`. NaN where nothing is known: of a finger that no frame saw too.

    With `rotations` also the joints' in the world (see `joint_rotations`): `wrist_qw` ..., or
    `wrist_r00` ... row by row, or `wrist_rx_rad` ... along the axis; with the operator's `frame`
    `operator_wrist_x_mm` ... (see `operator_frame`).
    """
    table: dict[str, NDArray[Any]] = {
        "frame": track.frame_index,
        "time_ns": track.time_ns,
        "time_s": (track.time_ns - origin_ns) * 1e-9,
        "hand": np.full(len(track), track.hand),
        "status": track.status,
        "reason": track.reason,
    }

    def wide(names: list[str], values: NDArray[np.float64]) -> None:
        table.update(zip(names, values.reshape(len(track), len(names)).T, strict=True))

    mm = 1e3

    def deg(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(track.measured_angles, np.rad2deg(values), np.nan)

    known = track.measured_joints[:, None]
    wide([f"{name}_deg" for name in ANGLE_NAMES], deg(track.angles))
    kinds = [("", track.quaternion, track.translation)]
    if track.filtered:
        wide([f"{name}_raw_deg" for name in ANGLE_NAMES], deg(track.angles_raw))
        kinds.append(("_raw", track.quaternion_raw, track.translation_raw))
    wide([f"{name}_sd_deg" for name in ANGLE_NAMES], deg(np.sqrt(track.angle_variance)))
    for kind, quaternion, translation in kinds:
        wide([f"rotation{kind}_{c}" for c in "wxyz"], quaternion)
        wide([f"translation{kind}_{c}_mm" for c in "xyz"], translation * mm)
    filtered = np.where(known, track.filtered_joints, np.nan)
    joints = [("", filtered), ("observed_", track.observed)]
    if track.filtered:
        joints.insert(1, ("raw_", np.where(known, track.fitted_joints, np.nan)))
    if frame == "operator":
        joints.append(("operator_", operator_frame(filtered, track.hand)[0]))
    if track.model.has_landmarks:
        joints.append(("landmark_", np.where(known, track.landmarks, np.nan)))
    if track.truth is not None:
        joints.append(("truth_", track.truth))
    for kind, points in joints:
        wide([f"{kind}{name}_{c}_mm" for name in JOINT_NAMES for c in "xyz"], points * mm)
    if rotations is not None:
        kinds_of, values = rotation_values(joint_rotations(track), rotations)
        wide([f"{name}_{kind}" for name in JOINT_NAMES for kind in kinds_of], values)
    wide([f"error_{name}_mm" for name in JOINT_NAMES], track.error * mm)
    table["error_mean_mm"], table["error_max_mm"] = mean_and_max(track.error * mm)
    if track.truth is not None:
        off = np.linalg.norm(filtered - track.truth, axis=-1)
        table["truth_error_mean_mm"] = mean_and_max(off * mm)[0]
    table["objective_mm2"] = track.objective * 1e6
    return table


def write_csv(
    track: Track,
    path: Path,
    origin_ns: int,
    rotations: str | None = None,
    frame: str = "world",
) -> None:
    """Text with a line of names; an empty cell where nothing is known."""
    from pyarrow import csv

    table = _arrow(columns(track, origin_ns, rotations, frame), _DIGITS)
    csv.write_csv(table, path, csv.WriteOptions(quoting_style="needed"))


def write_parquet(
    track: Track,
    path: Path,
    origin_ns: int,
    rotations: str | None = None,
    frame: str = "world",
) -> None:
    """The same columns in full precision, null where nothing is known.

    What made the track is in the schema's metadata, key "handtrack", as JSON.
    """
    from pyarrow import parquet

    about = {
        "name": track.name,
        "hand": track.hand,
        "source": track.source,
        "subject": track.subject,
        "version": track.version,
        "model": track.model.name,
        "settings": dict(track.settings),
    }
    table = _arrow(columns(track, origin_ns, rotations, frame))
    metadata = {"handtrack": json.dumps(about)}
    parquet.write_table(table.replace_schema_metadata(metadata), path, compression="zstd")


def _arrow(table: dict[str, NDArray[Any]], digits: int | None = None) -> pyarrow.Table:
    import pyarrow

    arrays = {}
    for name, values in table.items():
        if values.dtype.kind == "f":
            known = np.isfinite(values)
            rounded = values
            if digits is not None:
                rounded = np.round(values, _TIME_DIGITS if name == "time_s" else digits)
            arrays[name] = pyarrow.array(rounded, mask=~known)
        else:
            arrays[name] = pyarrow.array(values.tolist() if values.dtype.kind == "U" else values)
    return pyarrow.table(arrays)
