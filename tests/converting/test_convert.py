"""Conversions, read back by a few independent lines: the same joints, and what they say of loss."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from screens import lacking

import handtrack as ht
from handtrack.cli import run
from handtrack.converting.complete import METACARPAL_SD
from handtrack.converting.egodex import NAMES
from handtrack.converting.loss import loss
from handtrack.converting.openxr import XR_JOINTS
from handtrack.converting.source import Source
from handtrack.converting.umetrack import fit_profile
from handtrack.errors import SettingsError
from handtrack.hand.rotations import quaternion_to_matrix, vector_to_matrix
from handtrack.hand.skeleton import ANGLE_JOINT, ORDERS
from handtrack.sequences.readers.umetrack import load_profile
from tools.make import mano_like

FPS = 30


def poses(frames: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles, rotations and translations of a hand that moves through its range."""
    t = np.arange(frames)[:, None] / FPS
    rng = np.random.default_rng(seed)
    speed, shift = rng.uniform(1.5, 4, (1, 20)), rng.uniform(0, 6, (1, 20))
    middle = np.tile([0.4, 0.02, 0.5, 0.4], 5)
    angles = middle + np.tile([0.4, 0.08, 0.4, 0.3], 5) * np.sin(speed * t + shift)
    turn = vector_to_matrix(np.concatenate([0.8 * np.sin(t), 0.5 * t, np.cos(2 * t)], 1))
    move = np.concatenate([0.2 * np.sin(t), 0.1 * t, 0.4 + 0.1 * np.cos(t)], 1)
    return angles, turn, move


def moving(hand: str = "right", frames: int = 40, start_ns: int = 5_000_000_000) -> ht.Sequence:
    """The default hand in such poses."""
    model = ht.HandModel.default(hand)
    time = start_ns + np.round(np.arange(frames) * 1e9 / FPS).astype(np.int64)
    joints = model.joints(*poses(frames))
    return ht.Sequence(time, joints, hand=hand, frame_index=np.arange(100, 100 + frames))


def exact(sequence: ht.Sequence) -> tuple[ht.HandModel, str]:
    return ht.HandModel.default(sequence.hand), "none"


def holed(sequence: ht.Sequence) -> ht.Sequence:
    """With a thumb's base that is never seen, a tip that is not for a while."""
    joints = sequence.joints.copy()
    joints[:, 1] = np.nan
    joints[10:13, 12] = np.nan
    return dataclasses.replace(sequence, joints=joints, confidence=None)


@pytest.fixture(scope="module")
def h5py() -> Any:
    try:
        import h5py
    except ImportError:
        lacking("h5py", "it reads the HDF5 that is written")
    return h5py


def test_csv_and_npz_keep_what_there_is(tmp_path: Path) -> None:
    sequence = holed(moving())
    for ending in ("csv", "npz", "parquet"):
        (made,) = ht.convert([sequence], tmp_path / f"x.{ending}")
        assert (made.loss.joints, made.made) == (0, {})
        assert made.loss.max_mm < 1e-5
        (back,) = ht.load(made.path)
        assert back.hand == "right"
        np.testing.assert_array_equal(back.time_ns, sequence.time_ns)
        np.testing.assert_array_equal(back.frame_index, sequence.frame_index)
        np.testing.assert_allclose(back.joints, sequence.joints, atol=1e-8)
    with (tmp_path / "x.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert rows[11]["middle_tip_x_mm"] == rows[11]["thumb_cmc_z_mm"] == ""
    found = [[float(row[f"index_dip_{c}_mm"]) for c in "xyz"] for row in rows]
    np.testing.assert_allclose(found, sequence.joints[:, 7] * 1e3, atol=1e-6)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_openxr_has_26_joints_and_says_which_are_made(hand: str, tmp_path: Path) -> None:
    whole = moving(hand)
    sequence = holed(whole)
    (made,) = ht.convert([sequence], tmp_path / "x.jsonl", models=exact)
    lines = [json.loads(line) for line in (tmp_path / "x.jsonl").read_text().splitlines()]
    assert [line["time_ns"] for line in lines] == sequence.time_ns.tolist()
    assert all(tuple(line["joints"]) == XR_JOINTS for line in lines)
    place = np.array(
        [[[line["joints"][n]["position"][c] for c in "xyz"] for n in XR_JOINTS] for line in lines]
    )
    ours = place[:, list(ORDERS["openxr"])]
    kept = np.isfinite(sequence.joints)
    np.testing.assert_array_equal(ours[kept], sequence.joints[kept])
    assert np.linalg.norm(ours - whole.joints, axis=-1).max() < 0.004  # the fit knows the hand
    assert made.loss.max_mm == 0
    never = {name for name, of in made.made.items() if of.never}
    metacarpals = {f"{f}_metacarpal" for f in ("index", "middle", "ring", "little")}
    assert never == {"palm", "thumb_metacarpal"} | metacarpals
    assert made.made["middle_tip"].frames == 3
    assert "sd_m" in lines[11]["joints"]["middle_tip"]
    assert "sd_m" not in lines[20]["joints"]["middle_tip"]
    xyzw = np.array(
        [
            [[line["joints"][n]["orientation"][c] for c in "wxyz"] for n in XR_JOINTS]
            for line in lines
        ]
    )
    turn = quaternion_to_matrix(xyzw)
    # -z points along the bone, y out of the back of the hand
    bones = [
        (a, a + 1) for a, n in enumerate(XR_JOINTS[:-1]) if not n.endswith(("tip", "palm", "wrist"))
    ]
    for a, b in bones:
        if XR_JOINTS[a].endswith("metacarpal") and not XR_JOINTS[a].startswith("thumb"):
            continue  # rigid in the palm, whose direction they have
        along = place[:, b] - place[:, a]
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        assert (-(turn[:, a, :, 2] * along).sum(-1)).min() > 0.98
    root = poses(len(lines))[1]
    for name in ("palm", "index_proximal", "little_proximal"):
        j = XR_JOINTS.index(name)
        if name == "palm":
            assert (turn[:, j, :, 1] * root[:, :, 2]).sum(-1).min() > 0.95
        # a finger that bends turns its back away from the wrist, about x
        assert np.linalg.det(turn[:, j]).min() > 0.99
    flat = ht.HandModel.default(hand)
    base = place[:, XR_JOINTS.index("index_metacarpal")] - place[:, 1]
    assert np.linalg.norm(base, axis=-1).mean() == pytest.approx(0.28 * flat.size, rel=0.2)
    assert made.made["index_metacarpal"].sd_mm == pytest.approx(1e3 * METACARPAL_SD * flat.size)


def test_what_the_fitted_hand_gives_is_as_good_as_it_says(sample: ht.Sequence) -> None:
    assert sample.truth is not None
    rng = np.random.default_rng(0)
    for gone in ([1], [9], [3, 7, 11, 15, 19], None):
        joints = sample.joints.copy()
        if gone is None:
            joints[rng.random(joints.shape[:2]) < 0.15] = np.nan
        else:
            joints[:, gone] = np.nan
        source = Source.of(dataclasses.replace(sample, joints=joints, confidence=None), "right")
        whole = source.whole
        off = np.linalg.norm(whole.joints - sample.truth, axis=-1)[whole.made]
        share = np.sqrt(np.nanmean((off / whole.sd[whole.made]) ** 2))
        assert 0.4 < share < 1.3, (gone, share)


def test_lerobot_has_a_state_of_63_numbers(tmp_path: Path) -> None:
    from pyarrow import parquet

    whole = moving()
    (made,) = ht.convert([holed(whole)], tmp_path / "x.parquet", "lerobot", models=exact)
    table = parquet.read_table(made.path)
    state = np.array(table.column("observation.state").to_pylist())
    assert state.shape == (40, 63)
    assert np.linalg.norm(state.reshape(-1, 21, 3) - whole.joints, axis=-1).max() < 0.004
    assert table.column("timestamp").to_pylist()[3] == pytest.approx(0.1)
    assert made.made["thumb_cmc"].never
    assert made.loss.max_mm < 1e-4  # float32
    (back,) = ht.load(made.path)
    assert back.hand == "right"


def test_egodex_of_both_hands(h5py: Any, tmp_path: Path) -> None:
    right, left = moving("right"), moving("left", 30, 5_000_000_000 + 5 * 10**9 // FPS)
    made = ht.convert([left, right], tmp_path / "x.hdf5", models=exact)
    assert [m.hand for m in made] == ["left", "right"]
    with h5py.File(tmp_path / "x.hdf5") as file:
        assert len(file["transforms"]) == 2 * len(NAMES) == 50
        tip = file["transforms/rightIndexFingerTip"][:]
        late = file["transforms/leftHand"][:]
        sure = file["confidences/leftHand"][:]
        wrist = file["transforms/rightHand"][:]
    np.testing.assert_allclose(tip[:, :3, 3], right.joints[:, 8], atol=1e-6)
    np.testing.assert_allclose(late[5:35, :3, 3], left.joints[:, 0], atol=1e-6)
    assert np.isnan(late[:5, :3, 3]).all()
    assert not sure[:5].any()
    assert sure[6] == 1
    middle = right.joints[:, 9] - right.joints[:, 0]
    middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
    assert (wrist[:, :3, 0] * middle).sum(-1).min() > 0.99  # x along the hand
    assert max(m.loss.max_mm for m in made) < 1e-3


def test_egodex_of_another_rate_is_30_frames_a_second(h5py: Any, tmp_path: Path) -> None:
    fast = moving(frames=120)
    fast = dataclasses.replace(fast, time_ns=fast.time_ns[0] + np.arange(120) * 10**9 // 90)
    (made,) = ht.convert([fast], tmp_path / "x.hdf5", models=exact)
    assert made.notes == ("brought onto 30 frames/s (40 frames)",)
    with h5py.File(made.path) as file:
        tip = file["transforms/rightIndexFingerTip"][:, :3, 3]
    np.testing.assert_allclose(tip, fast.joints[::3, 8], atol=1e-5)
    assert 0.01 < made.loss.max_mm < 10  # what lies between is lost


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
    other = moving()
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
