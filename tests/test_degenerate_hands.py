"""Hands of which little was seen: tracked without what was not, or refused in one line."""

from __future__ import annotations

import csv
import json
import warnings

import numpy as np
import pytest

import handtrack as ht
from handtrack.calibration.explain import doubt
from handtrack.cli import run

ROOTS = [0, 1, 5, 9, 13, 17]
TIPS = [4, 8, 12, 16, 20]


def hand(frames: int = 30) -> np.ndarray:
    """(T, 21, 3) joints of the default hand, flexing and moving [m]."""
    model = ht.HandModel.default("right")
    t = np.linspace(0, 6, frames)[:, None]
    low, high = model.limits.lower, model.limits.upper
    angles = (low + high) / 2 + 0.3 * (high - low) * np.sin(t + np.arange(20))
    joints = model.joints(
        angles, np.broadcast_to(np.eye(3), (frames, 3, 3)), np.hstack([0.1 * t, t * 0, 0.5 + t * 0])
    )
    return joints + np.random.default_rng(0).normal(0, 5e-4, joints.shape)


def only(joints: np.ndarray, seen: list[int]) -> np.ndarray:
    out = np.full_like(joints, np.nan)
    out[:, seen] = joints[:, seen]
    return out


def without(joints: np.ndarray, *lost: int) -> np.ndarray:
    return only(joints, [j for j in range(21) if j not in lost])


def copied(joints: np.ndarray, place: int, source: int) -> np.ndarray:
    out = joints.copy()
    out[:, place] = out[:, source]
    return out


def one_frame_of(joints: np.ndarray) -> np.ndarray:
    out = np.full_like(joints, np.nan)
    out[7] = joints[7]
    return out


TRUE = hand()
TRACKED = {
    "one frame": TRUE[:1],
    "two frames": TRUE[:2],
    "no motion": np.repeat(TRUE[:1], 30, 0),
    "one frame among empty ones": one_frame_of(TRUE),
    "no thumb metacarpal": copied(TRUE, 1, 2),
    "two tips at one place": copied(TRUE, 12, 8),
    "a knuckle never seen": without(TRUE, 5),
    "no wrist": without(TRUE, 0),
    "no little finger": without(TRUE, 17, 18, 19, 20),
    "no tips": without(TRUE, *TIPS),
    "the palm alone": only(TRUE, ROOTS),
    "no thumb, no index": without(TRUE, *range(1, 9)),
}
REFUSED = {
    "tips alone": only(TRUE, TIPS),
    "the wrist alone": only(TRUE, [0]),
    "one finger alone": only(TRUE, [5, 6, 7, 8]),
    "all at one point": np.full_like(TRUE, 0.1),
    "noise": np.random.default_rng(1).normal(0, 0.05, TRUE.shape),
    "a line": np.linspace(0, 0.2, 21)[None, :, None] * np.ones((30, 1, 3)) + 0.5,
}


def saved(path, joints):
    truth = np.repeat(TRUE[:1], 30, 0) if np.ptp(joints, axis=0).max() == 0 else TRUE
    np.savez(path, joints_m=joints, truth_m=truth[: len(joints)], fps=30, hand="right")
    return str(path)


@pytest.mark.parametrize("calibrate", ["--calibrate", "--no-calibrate"])
@pytest.mark.parametrize("name", TRACKED)
def test_tracked_without_what_was_not_seen(tmp_path, capsys, name, calibrate):
    file = saved(tmp_path / "a.npz", TRACKED[name])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        status = run(
            ["track", file, "-o", str(tmp_path / "o.mcap"), "--json", calibrate, "--overwrite"]
        )
    out = capsys.readouterr()
    assert status == 0, out.err
    (row,) = json.loads(out.out)["sequences"]
    assert row["pa_mpjpe_mm"]["mean"] < 2.0


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_one_line_that_names_the_file(tmp_path, capsys, name):
    file = saved(tmp_path / "a.npz", REFUSED[name])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        status = run(["track", file, "-o", str(tmp_path / "o.mcap"), "--overwrite"])
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert status in (1, 2)
    assert len(error) == 1
    assert "a.npz" in error[0]
    assert "model default" not in error[0]


def test_bones_of_no_length_in_python_too():
    time = np.arange(30) * 33_333_333
    for a, b in [(1, 2), (7, 8), (5, 9)]:
        sequence = ht.Sequence(time, copied(TRUE, a, b), hand="right")
        for method in ("auto", "lengths", "proportions", "scale"):
            found = ht.calibrate(ht.HandModel.default("right"), sequence, method=method)
            assert np.isfinite(found.model.rest_vertices).all()


def test_a_finger_that_no_frame_saw_is_not_exported(tmp_path, capsys):
    file = saved(tmp_path / "a.npz", without(TRUE, 17, 18, 19, 20, 12))
    recording = str(tmp_path / "o.mcap")
    assert run(["track", file, "-o", recording]) == 0
    said = capsys.readouterr().out
    assert "never seen" in said
    for name in ("little_mcp", "little_tip", "middle_tip"):
        assert name in said
    for kind in ("csv", "npz"):
        assert run(["export", recording, str(tmp_path / f"o.{kind}")]) == 0
    with (tmp_path / "o.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    gone = ["little_mcp_flexion_deg", "little_dip_flexion_deg", "little_tip_x_mm",
            "middle_dip_flexion_deg", "middle_tip_z_mm"]  # fmt: skip
    kept = ["middle_pip_flexion_deg", "middle_dip_x_mm", "ring_dip_flexion_deg", "wrist_x_mm"]
    assert all(row[name] == "" for row in rows for name in gone)
    assert all(row[name] != "" for row in rows for name in kept)
    with np.load(tmp_path / "o.npz") as arrays:
        assert np.isnan(arrays["angles_rad"][:, [11, 16, 17, 18, 19]]).all()
        assert np.isfinite(arrays["angles_rad"][:, :11]).all()
        assert np.isnan(arrays["filtered_joints_m"][:, [12, 17, 18, 19, 20]]).all()
        assert np.isfinite(arrays["filtered_joints_m"][:, :12]).all()


def test_a_hand_that_explains_its_input_badly_is_doubted(tmp_path, capsys):
    mirrored = TRUE * [1, 1, -1]
    np.savez(tmp_path / "a.npz", joints_m=mirrored, fps=30, hand="right")
    recording = tmp_path / "o.mcap"
    assert run(["track", str(tmp_path / "a.npz"), "-o", str(recording), "--json"]) == 0
    warned = json.loads(capsys.readouterr().out)["warnings"]
    (track,) = ht.read_mcap(recording)
    assert doubt(track.settings["calibration"]) is not None
    for said in (warned, [event.text for event in track.events]):
        assert any("any hand of rigid bones" in text and "--mirror" in text for text in said)
    assert (
        run(
            ["track", str(tmp_path / "a.npz"), "-o", str(recording), "--mirror", "z", "--overwrite"]
        )
        == 0
    )
    assert "--mirror" not in capsys.readouterr().err


def test_good_hands_are_not_doubted():
    assert doubt({}) is None
    assert doubt({"residual_mean_mm": 8.25, "bound_mean_mm": 5.85}) is None
    assert doubt({"residual_mean_mm": 0.1, "bound_mean_mm": 0.0}) is None
    assert doubt({"residual_mean_mm": 13.7, "bound_mean_mm": 5.2}) is not None
