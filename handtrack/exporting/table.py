"""Tracks as tables, a row for each frame, as CSV and as Parquet; poses of joints in the world."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import (
    matrix_to_quaternion,
    matrix_to_vector,
    quaternion_to_matrix,
)
from handtrack.hand.skeleton import ANGLE_NAMES, BASES, JOINT_NAMES, N_JOINTS, TIPS
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
