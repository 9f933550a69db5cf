"""A track as NumPy arrays in an .npz file, units in their names."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.exporting.table import joint_rotations, operator_frame, rotation_values
from handtrack.hand.mano_pose import to_mano
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES, PARENTS, PART_NAMES
from handtrack.tracking.track import Track

_ROTATIONS = {
    "quaternion": "joint_quaternions_wxyz",
    "matrix": "joint_rotations",
    "axis-angle": "joint_axis_angles_rad",
}


def arrays(track: Track, rotations: str | None = None, frame: str = "world") -> dict[str, Any]:
    """All of a track by name; shapes are for T frames, NaN where nothing is known, of a
    finger that no frame saw too.

    The observed joints are `joints_m`, with `confidence`, `time_ns`, `frame_index`, `hand` and,
    if known, `truth_m`: `handtrack.load` reads the file again as the sequence that was tracked.

    With a detector's profile `landmarks_m` are where the filtered poses have its landmarks, beside
    the joint centres of `filtered_joints_m`.

    Of a MANO hand there are also `mano_global_orient_rad` (T, 3), `mano_hand_pose_rad` (T, 45),
    `mano_transl_m` (T, 3) and `mano_betas` (S,), as smplx takes them with flat_hand_mean=True
    and use_pca=False (see `to_mano`); no betas where calibration changed the hand.

    Args:
        track: it.
        rotations: adds the joints' rotations in the world (see `joint_rotations`):
            `joint_quaternions_wxyz` (T, 21, 4), `joint_rotations` (T, 21, 3, 3) or
            `joint_axis_angles_rad` (T, 21, 3), by "quaternion", "matrix" or "axis-angle".
        frame: "operator" adds `operator_positions_m` (T, 21, 3) and `operator_axes` (T, 3, 3), see
            `operator_frame`.
    """
    model = track.model
    angles, joints = track.measured_angles, track.measured_joints
    made: dict[str, Any] = {
        "joints_m": track.observed,
        "confidence": track.confidence,
        "time_ns": track.time_ns,
        "frame_index": track.frame_index,
        "hand": track.hand,
        "name": track.name,
        "subject": track.subject,
        "angles_rad": np.where(angles, track.angles, np.nan),
        "angles_raw_rad": np.where(angles, track.angles_raw, np.nan),
        "angle_variance_rad2": track.angle_variance,
        "quaternion_wxyz": track.quaternion,
        "quaternion_raw_wxyz": track.quaternion_raw,
        "translation_m": track.translation,
        "translation_raw_m": track.translation_raw,
        "fitted_joints_m": np.where(joints[:, None], track.fitted_joints, np.nan),
        "filtered_joints_m": np.where(joints[:, None], track.filtered_joints, np.nan),
        "error_m": track.error,
        "objective_m2": track.objective,
        "sweeps": track.iterations,
        "status": track.status,
        "reason": track.reason,
        "rejected": track.rejected,
        "restart": track.restart,
        "event_time_ns": np.array([e.time_ns for e in track.events], np.int64),
        "event_level": np.array([e.level for e in track.events], "<U16"),
        "event_text": np.array([e.text for e in track.events], np.str_),
        "angle_names": np.array(ANGLE_NAMES),
        "joint_names": np.array(JOINT_NAMES),
        "joint_parents": PARENTS,
        "part_names": np.array(PART_NAMES),
        "rest_joints_m": model.rest_joints,
        "angle_axes": model.axes,
        "thumb_twist": model.thumb_twist,
        "limits_lower_rad": model.limits.lower,
        "limits_upper_rad": model.limits.upper,
        "model": model.name,
        "settings_json": json.dumps(dict(track.settings)),
        "version": track.version,
        "source": track.source,
    }
    if model.has_landmarks:
        made["landmarks_m"] = np.where(joints[:, None], track.landmarks, np.nan)
        made["landmark_offsets_m"] = model.landmark_offsets
    if track.truth is not None:
        made["truth_m"] = track.truth
    if model.name == "mano":
        pose = to_mano(
            model, track.angles, quaternion_to_matrix(track.quaternion), track.translation
        )
        made |= {
            "mano_global_orient_rad": pose.global_orient,
            "mano_hand_pose_rad": pose.hand_pose,
            "mano_transl_m": pose.transl,
            "mano_betas": pose.betas,
        }
    if rotations is not None:
        turned = joint_rotations(track)
        _, values = rotation_values(turned, rotations)
        made[_ROTATIONS[rotations]] = turned if rotations == "matrix" else values
    if frame == "operator":
        filtered = made["filtered_joints_m"]
        made["operator_positions_m"], made["operator_axes"] = operator_frame(filtered, track.hand)
    if len(model.rest_vertices) and not model.licensed:
        made |= {
            "rest_vertices_m": model.rest_vertices,
            "faces": model.faces,
            "skin_weights": model.weights,
        }
    return made


def write_npz(track: Track, path: Path, rotations: str | None = None, frame: str = "world") -> None:
    """Write the arrays, compressed; no pickles are in it."""
    with path.open("wb") as stream:
        np.savez_compressed(stream, **arrays(track, rotations, frame))
