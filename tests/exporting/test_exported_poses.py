"""Rotations of joints and the operator's frame in exports, against formulas of their own."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_tracks import make_track
from pyarrow import parquet
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import SettingsError
from handtrack.exporting.table import operator_frame
from handtrack.hand.rotations import quaternion_to_matrix, vector_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES, PARENTS, TIPS


def dex_retargeting(points: np.ndarray, hand: str) -> np.ndarray:
    """(21, 3) in the operator's frame, as dex-retargeting's single_hand_detector.py computes it:
    the plane's normal by an SVD, its axes put upright by Gram and Schmidt."""
    about = points - points[0]
    three = about[[0, 5, 9]]
    along = three[0] - three[2]
    normal = np.linalg.svd(three - three.mean(0))[2][2]
    x = along - (along @ normal) * normal
    x /= np.linalg.norm(x)
    z = np.cross(x, normal)
    if z @ (three[1] - three[2]) < 0:
        normal, z = -normal, -z
    to_mano = {
        "right": [[0, 0, -1], [-1, 0, 0], [0, 1, 0]],
        "left": [[0, 0, -1], [1, 0, 0], [0, -1, 0]],
    }
    return about @ np.stack([x, normal, z], axis=1) @ np.array(to_mano[hand])


@pytest.mark.parametrize("hand", ["right", "left"])
def test_operator_frame_is_dex_retargetings(hand: str, tmp_path: Path) -> None:
    track = make_track(40, hand)
    ht.export(track, tmp_path / "x.npz", frame="operator")
    ht.export(track, tmp_path / "x.csv", frame="operator")
    with np.load(tmp_path / "x.npz") as arrays:
        found, axes = arrays["operator_positions_m"], arrays["operator_axes"]
    lost = np.isnan(track.angles).any(1)
    assert lost.any()
    assert np.isnan(found[lost]).all()
    for t in np.flatnonzero(~lost):
        expected = dex_retargeting(track.filtered_joints[t], hand)
        np.testing.assert_allclose(found[t], expected, atol=1e-12)
        # the axes bring them back
        again = found[t] @ axes[t].T + track.filtered_joints[t, 0]
        np.testing.assert_allclose(again, track.filtered_joints[t], atol=1e-12)
    with (tmp_path / "x.csv").open() as file:
        rows = list(csv.DictReader(file))
    t = int(np.flatnonzero(~lost)[0])
    written = [float(rows[t][f"operator_index_tip_{c}_mm"]) for c in "xyz"]
    np.testing.assert_allclose(written, 1e3 * found[t, 8], atol=1e-5)


def test_operator_frame_on_real_joints(shared_data: Path) -> None:
    with np.load(shared_data / "dex" / "joints.npz") as arrays:
        joints, hand = arrays["joints_m"].astype(np.float64), str(arrays["hand"])
    found, _ = operator_frame(joints, hand)
    seen = np.isfinite(joints).all((1, 2))
    assert seen.sum() > 500
    expected = np.array([dex_retargeting(x, hand) for x in joints[seen]])
    np.testing.assert_allclose(found[seen], expected, atol=1e-9)
    assert np.median(found[seen, 9, 2]) > 0.05  # the middle finger's base lies along z


def test_operator_frame_of_joints_that_are_missing_or_on_a_line() -> None:
    joints = np.tile(ht.HandModel.default().rest_joints, (3, 1, 1))
    joints[0, 5] = np.nan
    joints[1, 5] = (joints[1, 0] + joints[1, 9]) / 2
    joints[2, 8] = np.nan
    found, _ = operator_frame(joints, "right")
    assert np.isnan(found[:2]).all()
    assert np.isnan(found[2, 8]).all()
    assert np.isfinite(found[2, 9]).all()


def by_scipy(read: Callable[[np.ndarray], Rotation], values: np.ndarray) -> np.ndarray:
    """Matrices of rotations (T, 21, n), NaN where these are."""
    flat = values.reshape(-1, values.shape[-1])
    known = np.isfinite(flat).all(1)
    out = np.full((len(flat), 3, 3), np.nan)
    out[known] = read(flat[known]).as_matrix()
    return out.reshape(*values.shape[:2], 3, 3)


@pytest.mark.parametrize("form", ["quaternion", "matrix", "axis-angle"])
def test_rotations_move_the_joints(form: str, tmp_path: Path) -> None:
    track = make_track(40)
    ht.export(track, tmp_path / "x.npz", rotations=form)
    ht.export(track, tmp_path / "x.parquet", rotations=form)
    with np.load(tmp_path / "x.npz") as arrays:
        joints, rest = arrays["filtered_joints_m"], arrays["rest_joints_m"]
        if form == "quaternion":
            turn = by_scipy(Rotation.from_quat, arrays["joint_quaternions_wxyz"][..., [1, 2, 3, 0]])
        elif form == "matrix":
            turn = arrays["joint_rotations"]
        else:
            turn = by_scipy(Rotation.from_rotvec, arrays["joint_axis_angles_rad"])
    assert turn.shape == (40, 21, 3, 3)
    known = np.isfinite(joints).all((1, 2))
    for joint in range(1, 21):
        # each bone is turned as the joint at its beginning is
        parent = int(PARENTS[joint])
        bone = turn[:, parent] @ (rest[joint] - rest[parent])
        np.testing.assert_allclose(
            bone[known], (joints[:, joint] - joints[:, parent])[known], atol=1e-9
        )
        if joint in TIPS:
            np.testing.assert_allclose(turn[known, joint], turn[known, joint - 1])
    assert np.isnan(turn[~known]).all()
    names = {
        "quaternion": ["qw", "qx", "qy", "qz"],
        "matrix": [f"r{i}{j}" for i in range(3) for j in range(3)],
        "axis-angle": ["rx_rad", "ry_rad", "rz_rad"],
    }[form]
    table = parquet.read_table(tmp_path / "x.parquet")
    values = np.array(
        [table.column(f"{JOINT_NAMES[6]}_{name}").to_numpy(zero_copy_only=False) for name in names]
    ).T
    as_matrix = {
        "quaternion": quaternion_to_matrix,
        "matrix": lambda v: v.reshape(-1, 3, 3),
        "axis-angle": vector_to_matrix,
    }[form]
    np.testing.assert_allclose(as_matrix(values)[known], turn[known, 6], atol=1e-9)


def test_the_command_and_what_makes_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ht.write_mcap(make_track(5), tmp_path / "x.mcap")
    where = ["export", str(tmp_path / "x.mcap"), str(tmp_path / "x.csv")]
    assert run([*where, "--rotations", "axis-angle", "--frame", "operator"]) == 0
    head = (tmp_path / "x.csv").read_text().splitlines()[0]
    assert '"wrist_rx_rad"' in head
    assert '"operator_wrist_x_mm"' in head
    assert run(["export", where[1], str(tmp_path / "x.bvh"), "--rotations", "matrix"]) == 2
    assert "rotations and frame are for .csv, .parquet, .npz" in capsys.readouterr().err
    with pytest.raises(SettingsError, match="rotations 'euler' is unknown"):
        ht.export(make_track(5), tmp_path / "y.csv", rotations="euler")
