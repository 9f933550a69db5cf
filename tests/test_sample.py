"""The sample recording is what its README says, and the makers of recordings work."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from handtrack.evaluation import metrics
from handtrack.hand.limits import preset
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS, TIPS
from tools.make import panoptic as make_panoptic
from tools.make import sample as make_sample

ROOT = Path(__file__).resolve().parent.parent


GAP = slice(200, 210)


@pytest.fixture(scope="module")
def data():
    with np.load(ROOT / "recordings" / "sample.npz", allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def test_the_file_is_what_the_tool_makes(data):
    rebuilt = make_sample.stored(make_sample.make())
    assert set(data) == set(rebuilt)
    for name, value in rebuilt.items():
        assert data[name].dtype == value.dtype
        if value.dtype.kind == "f":
            # another processor may round the last bit otherwise
            np.testing.assert_allclose(data[name], value, atol=2.0**-15, err_msg=name)
        else:
            np.testing.assert_array_equal(data[name], value, err_msg=name)


def test_shapes_and_size(data):
    assert data["joints_m"].shape == data["truth_m"].shape == (300, 21, 3)
    assert data["truth_angles_rad"].shape == (300, 20)
    assert (str(data["hand"]), float(data["fps"])) == ("right", 30.0)
    assert np.all(np.abs(np.diff(data["time_ns"]) - 1e9 / 30) < 1)
    assert (ROOT / "recordings" / "sample.npz").stat().st_size < 150_000


def test_the_truth_is_one_rigid_hand(data):
    assert metrics.bone_length_drift(data["truth_m"]).max() < 1e-4
    lengths = metrics.bone_lengths(data["truth_m"][0])
    ratio = lengths / HandModel.default("right").bone_lengths
    assert 0.9 < ratio.min() < 0.97
    assert 1.03 < ratio.max() < 1.1


def test_the_truth_comes_from_the_angles(data):
    sample = make_sample.make()
    joints = sample.model.joints(data["truth_angles_rad"], sample.rotation, sample.translation)
    assert np.abs(joints - data["truth_m"]).max() < 2e-5


def test_missing_joints(data):
    missing = np.isnan(data["joints_m"][..., 0])
    assert missing[GAP].all()
    outside = np.delete(missing, np.r_[GAP], axis=0)
    assert not outside.all(1).any()
    assert 0.015 < outside.mean() < 0.025
    np.testing.assert_array_equal(data["confidence"], (~missing).astype(np.float32))
    assert not np.isnan(data["truth_m"]).any()


def test_noise_is_white_and_2_mm(data):
    noise = data["joints_m"] - data["truth_m"]
    assert np.nanstd(noise) == pytest.approx(0.002, rel=0.02)
    assert np.abs(np.nanmean(noise, (0, 1))).max() < 1e-4
    together = np.nanmean(noise[1:] * noise[:-1]) / np.nanvar(noise)
    assert abs(together) < 0.03


def test_the_motion_stays_inside_the_limits_and_uses_them(data):
    angles = data["truth_angles_rad"]
    for name in ("li2021", "anatomical"):
        assert metrics.limit_violations(angles, preset(name)).max_deg < 0.01
    flexion = np.rad2deg(np.ptp(angles, axis=0)).reshape(5, 4)
    assert (flexion[1:, [0, 2, 3]] > 50).all()
    assert (flexion[0] > 10).all()


def test_speeds_are_those_of_a_hand(data):
    truth = data["truth_m"].astype(float)
    speed = np.linalg.norm(np.diff(truth, axis=0), axis=-1) * 30
    assert 0.8 < speed[:, TIPS].max() < 3.0
    assert np.nanmean(metrics.acceleration(truth, fps=30)) < 5.0
    assert np.nanmean(metrics.jitter(truth, fps=30)) < 100
    assert np.nanmean(metrics.jitter(data["joints_m"], fps=30)) > 300


def test_what_is_in_it(data):
    truth = data["truth_m"].astype(float)
    reach = np.linalg.norm(truth[:, TIPS] - truth[:, :1], axis=-1)
    assert (reach[26, 1:] > 0.12).all()  # open
    assert (reach[50, 1:] < 0.10).all()  # fist
    assert np.linalg.norm(truth[92, 4] - truth[92, 8]) < 0.02  # pinch
    stretched = [int((reach[t, 1:] > 0.12).sum()) for t in (125, 143, 157, 169, 184)]
    assert stretched == [0, 1, 2, 3, 4]
    # the palm's normal turns right round between 6.5 and 7.2 s
    normal = np.cross(truth[:, 5] - truth[:, 0], truth[:, 17] - truth[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert normal[195] @ normal[217] < 0
    assert metrics.self_intersection(truth).max() < 0.010


def test_motion_is_longer_or_faster_on_demand():
    angles, rotation, translation = make_sample.motion(25.0, 60.0, np.random.default_rng(5))
    assert angles.shape == (1500, 20)
    assert np.allclose(rotation @ rotation.swapaxes(1, 2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(rotation), 1.0)
    assert preset("li2021").contains(angles).all()
    assert not np.allclose(angles[:600], angles[600:1200], atol=0.05)
    again = make_sample.motion(25.0, 60.0, np.random.default_rng(5))
    np.testing.assert_array_equal(again[0], angles)
    assert np.abs(np.diff(translation, axis=0)).max() < 0.05


@pytest.mark.parametrize("people", [1, 2])
def test_panoptic_folder(tmp_path, people):
    truth, joints = make_panoptic.make(frames=12, noise_mm=2.0, people=people)
    folder = make_panoptic.write(tmp_path, joints)
    make_panoptic.write_truth(tmp_path / "truth", truth)
    files = sorted(folder.glob("handRecon3D_hd*.json"))
    assert [f.name for f in files[:2]] == [
        "handRecon3D_hd00020701.json",
        "handRecon3D_hd00020702.json",
    ]
    assert len(files) == 12
    frame = json.loads(files[3].read_text())
    assert [p["id"] for p in frame["people"]] == list(range(people))
    for person in frame["people"]:
        for hand in HANDS:
            entry = person[f"{hand}_hand"]
            x = np.array(entry["landmarks"]).reshape(21, 3)
            np.testing.assert_allclose(x, joints[person["id"], hand][3], atol=1e-4)
            assert all(len(entry[k]) == 21 for k in ("averageScore", "validity", "visibility"))
            with np.load(tmp_path / "truth" / f"person{person['id']}_{hand}.npz") as file:
                assert np.abs(file["joints_m"][3] * 100 - x).max() < 1.5


def test_panoptic_left_hand_is_the_mirror_kind_of_a_right_one():
    truth, _ = make_panoptic.make(frames=5, noise_mm=0.0)
    lengths = {h: metrics.bone_lengths(truth[0, h])[0] for h in HANDS}
    np.testing.assert_allclose(lengths["left"], lengths["right"], rtol=1e-6)
    mirrored = truth[0, "left"] * [-1.0, 1.0, 1.0]
    # alike as mirror images, unlike as they are
    assert metrics.pa_mpjpe(truth[0, "left"], truth[0, "right"])[0] > 0.5
    assert metrics.pa_mpjpe(mirrored, truth[0, "right"])[0] < 0.3
