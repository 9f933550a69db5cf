"""Converted poses: what is read back, and what is said to be lost."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from converted_clips import exact, holed, moving, poses

import handtrack as ht
from handtrack.cli import run
from handtrack.converting.loss import loss
from handtrack.converting.source import Source
from handtrack.converting.umetrack import fit_profile
from handtrack.errors import SettingsError
from handtrack.hand.skeleton import ANGLE_JOINT, ORDERS
from handtrack.sequences.readers.umetrack import load_profile
from tools.make import mano_like


def test_mano_parameters_are_read_back(tmp_path: Path) -> None:
    folder = tmp_path / "mano"
    folder.mkdir()
    with (folder / "MANO_RIGHT.pkl").open("wb") as file:
        mano_like.write_pickle(mano_like.make_mano_like("right"), file)
    with pytest.raises(SettingsError, match="--mano DIR"):
        ht.convert([moving()], tmp_path / "x.npz", "mano")
    model = ht.HandModel.from_mano(folder, "right")
    sequence = dataclasses.replace(moving(), joints=model.joints(*poses(40)))
    (made,) = ht.convert(
        [sequence], tmp_path / "x.npz", "mano", models=lambda _: (model, "none"), mano=folder
    )
    with np.load(made.path) as arrays:
        assert arrays["hand_pose"].shape == (40, 45)
        assert arrays["global_orient"].shape == arrays["transl"].shape == (40, 3)
        assert arrays["flat_hand_mean"]
    assert made.loss.max_mm < 1  # limits and the fit, not the format
    other = dataclasses.replace(moving(), joints=1.1 * moving().joints)
    (far,) = ht.convert(
        [other], tmp_path / "y.npz", "mano", models=lambda _: (model, "none"), mano=folder
    )
    assert far.loss.mean_mm > 1  # another hand than MANO's mean one is told


def profile_file(path: Path) -> Path:
    """A profile of UmeTrack with the joints and axes of the default left hand."""
    model = ht.HandModel.default("left")
    order = np.array(ORDERS["umetrack"])
    landmarks, bones = np.zeros((21, 3)), [[0] for _ in range(21)]
    for joint, place in enumerate(order):
        if place >= 0:
            landmarks[place] = model.rest_joints[joint] * 1e3
            finger, depth = divmod(joint - 1, 4)
            if joint and depth:
                bones[place] = [2 + 3 * finger + depth - 1]
    landmarks[20] = landmarks[11] / 2
    path.write_text(
        json.dumps(
            {
                "joint_rotation_axes": model.axes.tolist(),
                "joint_rest_positions": (model.rest_joints[ANGLE_JOINT] * 1e3).tolist(),
                "landmark_rest_positions": landmarks.tolist(),
                "landmark_rest_bone_indices": bones,
                "landmark_rest_bone_weights": [[1.0]] * 21,
            }
        )
    )
    return path


@pytest.mark.parametrize("hand", ["left", "right"])
def test_umetrack_angles_are_found(hand: str, tmp_path: Path) -> None:
    path = profile_file(tmp_path / "profile.json")
    sequence = moving(hand, 25)
    if hand == "right":  # the same hand in a mirror
        joints = ht.HandModel.default("left").joints(poses(25)[0]) * [-1, 1, 1]
        joints = np.einsum("tij,tkj->tki", poses(25)[1], joints) + poses(25)[2][:, None]
        sequence = dataclasses.replace(sequence, joints=joints)
    holes = sequence.joints.copy()
    holes[3, 8] = holes[4, 1:] = np.nan
    sequence = dataclasses.replace(sequence, joints=holes, confidence=None)
    found = fit_profile(load_profile(path), sequence.joints, hand)
    known = np.delete(np.arange(25), [3, 4])
    # the thumb's first joint is no landmark of UmeTrack's: its angles may trade
    assert np.abs(found.angles - poses(25)[0])[known][:, 4:].max() < 0.01
    assert np.isnan(found.angles[4]).all()
    (made,) = ht.convert([sequence], tmp_path / "x.jsonl", "umetrack", profile=path)
    lines = [json.loads(line) for line in made.path.read_text().splitlines()]
    pose = lines[0]["hand_poses"]["0" if hand == "left" else "1"]
    assert len(pose["joint_angles"]) == 22
    assert lines[4]["hand_poses"] == {}
    assert made.loss.max_mm < 0.2
    assert made.loss.max_deg < 1
    with pytest.raises(SettingsError, match="--profile FILE"):
        ht.convert([sequence], tmp_path / "y.jsonl", "umetrack")


def test_formats_of_poses_say_what_the_fit_loses(tmp_path: Path) -> None:
    noisy = moving()
    noise = np.random.default_rng(1).normal(0, 0.003, noisy.joints.shape)
    noisy = dataclasses.replace(noisy, joints=noisy.joints + noise)
    (glb,) = ht.convert([noisy], tmp_path / "x.glb", models=exact, up="z")
    assert 2 < glb.loss.mean_mm < 8
    assert 1 < glb.loss.mean_deg < 20
    (clean,) = ht.convert([moving()], tmp_path / "y.glb", models=exact)
    assert clean.loss.max_mm < 1
    (mcap,) = ht.convert([noisy], tmp_path / "x.mcap", models=exact)
    assert mcap.loss.max_mm == 0  # what was observed is in it


def test_skeletons_and_markers_are_read_back(tmp_path: Path) -> None:
    sequence = holed(moving())
    (trc,) = ht.convert([sequence], tmp_path / "x.trc")
    assert trc.loss.max_mm < 1e-5
    assert trc.loss.joints == 0
    lines = trc.path.read_text().splitlines()
    assert lines[3].split("\t")[2::3][:3] == ["right_wrist", "right_thumb_cmc", "right_thumb_mcp"]
    cells = lines[6 + 11].split("\t")
    assert cells[2 + 3 * 12 : 5 + 3 * 12] == [""] * 3
    written = [float(c) for c in cells[2 + 3 * 8 : 5 + 3 * 8]]
    np.testing.assert_allclose(written, 1e3 * sequence.joints[11, 8], atol=1e-5)
    for unit in ("cm", "mm"):
        path = tmp_path / f"{unit}.bvh"
        (bvh,) = ht.convert([moving()], path, models=exact, unit=unit, up="z")
        assert bvh.loss.max_mm < 1
        assert bvh.loss.joints == 0


def test_loss_finds_what_was_changed() -> None:
    sequence = moving()
    source = Source.of(sequence, "right")
    same = loss(source, sequence.time_ns, sequence.joints)
    assert (same.max_mm, same.joints, same.of) == (0, 0, 40 * 21)
    moved = sequence.joints.copy()
    moved[7, 8] += [0.003, 0, 0.004]
    moved[:, 20] = np.nan
    other = loss(source, sequence.time_ns, moved)
    assert other.max_mm == pytest.approx(5)
    assert other.joints == 40
    assert other.max_deg > 5
    late = loss(source, sequence.time_ns + 10**10, sequence.joints)
    assert late.joints == late.of


def test_recordings_and_folders_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    track = ht.track(moving(frames=12), ht.HandModel.default("right"), calibrate="none")
    ht.write_mcap([track], tmp_path / "run.mcap")
    assert run(["convert", str(tmp_path / "run.mcap"), str(tmp_path / "x.csv"), "--json"]) == 0
    (said,) = json.loads(capsys.readouterr().out)["files"]
    assert (said["to"], said["frames"], said["loss"]["joints"]) == ("csv", 12, 0)
    (back,) = ht.load(tmp_path / "x.csv")
    np.testing.assert_allclose(back.joints, track.filtered_joints, atol=1e-8)
    source = tmp_path / "in"
    source.mkdir()
    for name in ("a", "b"):
        ht.convert([moving(frames=5), moving("left", 5)], source / f"{name}.csv")
    assert sorted(p.name for p in source.iterdir()) == [
        *("a_left.csv", "a_right.csv", "b_left.csv", "b_right.csv")
    ]
    out = tmp_path / "out"
    assert run(["convert", str(source), str(out), "--to", "npz"]) == 0
    text = capsys.readouterr().out
    assert len(list(out.glob("*.npz"))) == 4
    assert text.count("read back: ") == 4


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["x.csv", "x.xyz"], "expected a name that ends in"),
        (["x.csv", "x.csv", "--to", "egodex"], "a file of egodex ends in .hdf5"),
        (["x.csv", "x.csv", "--to", "c3d"], "no format to convert to"),
        (["x.csv", "folder"], "say the format with --to"),
        (["nothing.csv", "x.npz"], "no such file"),
        (["x.csv", "x.csv"], "x.csv"),
    ],
)
def test_wrong_commands(
    arguments: list[str],
    text: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    ht.convert([moving(frames=3)], tmp_path / "x.csv")
    assert run(["convert", *arguments]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert text in said[0]


def test_one_hand_of_a_kind_in_formats_of_a_left_and_a_right(tmp_path: Path) -> None:
    two = [moving(), dataclasses.replace(moving(), name="other")]
    for name in ("x.hdf5", "x.jsonl"):
        with pytest.raises(SettingsError, match="one left and one right"):
            ht.convert(two, tmp_path / name)


def test_a_profile_of_what_is_written_is_asked_of_no_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An input that takes no profile was refused for it, so nothing became UmeTrack's."""
    path = profile_file(tmp_path / "profile.json")
    s = moving("left", 5)
    np.savez(tmp_path / "a.npz", joints_m=s.joints, time_ns=s.time_ns, hand="left")
    call = ["convert", str(tmp_path / "a.npz"), str(tmp_path / "x.jsonl"), "--to", "umetrack"]
    assert run([*call, "--profile", str(path), "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["files"]
    assert told["loss"]["max_mm"] < 0.2
    assert (
        run(["convert", str(tmp_path / "a.npz"), str(tmp_path / "y.npz"), "--profile", str(path)])
        == 2
    )
    assert "nothing in it takes --profile" in capsys.readouterr().err
