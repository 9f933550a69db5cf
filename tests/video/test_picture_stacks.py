"""Joints in the pictures of several cameras in one array are followed as their videos would be."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from handtrack.sequences.picture_stacks import stack_in

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "cameras")]
from rigs import rig  # noqa: E402

SQUARE = 0.042


@pytest.fixture
def seen(tmp_path, monkeypatch) -> np.ndarray:
    """(2, 30, 21, 2) [px] of a left hand that closes, and its cameras as .dat in squares."""
    monkeypatch.chdir(tmp_path)
    model = ht.HandModel.default("left")
    angles = np.linspace(0.1, 1.0, 30)[:, None] * np.tile([1.0, 0.0, 1.0, 0.6], 5)
    joints = np.stack([model.joints(a, np.eye(3), np.zeros(3)) for a in angles])
    joints -= joints.mean((0, 1))
    cameras = rig(2)
    Path("dats").mkdir()

    def rows(value):
        return "\n".join(" ".join(map(repr, map(float, np.atleast_1d(r)))) for r in value)

    for i, c in enumerate(cameras):
        lens = f"intrinsic:\n{rows(c.matrix)}\ndistortion:\n{rows(c.distortion[None])}\n"
        Path(f"dats/c{i}.dat").write_text(lens)
        place = f"R:\n{rows(c.rotation)}\nT:\n{rows(c.translation / SQUARE)}\n"
        Path(f"dats/rot_trans_c{i}.dat").write_text(place)
    np.save("joints.npy", joints)
    noise = np.random.default_rng(6).normal(0, 0.5, (2, 30, 21, 2))
    return np.stack([c.project(joints) for c in cameras]) + noise


@pytest.mark.parametrize("kind", ["pixels", "shares", "frames first", "with confidence"])
def test_a_stack_is_followed(seen, kind, capsys):
    arrays = {"pixels": seen, "frames first": seen.swapaxes(0, 1)}
    arrays["shares"] = seen / [1280, 720]
    arrays["with confidence"] = np.concatenate([seen, np.full((2, 30, 21, 1), 0.8)], -1)
    size = {"size": [1280, 720]} if kind == "shares" else {}
    np.savez("seen.npz", uv=arrays[kind], fps=60.0, **size)
    camera = ["--camera", "dats", "--board-unit", "42mm"]
    assert run(["track", "seen.npz", *camera, "-o", "a.mcap"]) == 0
    said = capsys.readouterr()
    assert "taken as left from the way the fingers flex" in said.err
    assert "reprojection, px" in said.out
    assert "PA-MPJPE" not in said.out.partition("Joints that")[0]
    (track,) = ht.read_mcap("a.mcap")
    assert (track.hand, track.fps) == ("left", pytest.approx(60))
    error = np.linalg.norm(track.filtered_joints - np.load("joints.npy"), axis=-1)
    assert 1e3 * error.mean() < 2.0
    assert track.settings["cameras"]["reprojection_px"]["median"] < 1.5


def test_what_does_not_fit_is_said(seen, capsys):
    np.savez("seen.npz", uv=seen / [1280, 720], other=seen)
    camera = ["--camera", "dats"]
    assert run(["track", "seen.npz", *camera]) == 2  # two arrays, neither chosen
    capsys.readouterr()
    assert run(["track", "seen.npz", *camera, "--key", "uv"]) == 2
    assert "size" in capsys.readouterr().err
    assert run(["track", "seen.npz", *camera, "--key", "vu"]) == 2
    assert "there is no vu in it, only uv, other" in capsys.readouterr().err
    assert run(["track", "seen.npz", "--board-unit", "mm"]) == 2
    assert "--camera" in capsys.readouterr().err
    np.savez("three.npz", uv=np.concatenate([seen, seen[:1]]))
    assert run(["track", "three.npz", *camera]) == 2
    assert "2 cameras (c0, c1) for 3" in capsys.readouterr().err
    assert stack_in(Path("joints.npy")) is None


@pytest.mark.parametrize(
    ("said", "fits"), [([], "23 times shorter"), (["--board-unit", "mm"], "44 times longer")]
)
def test_cameras_in_a_unit_that_makes_no_hand(seen, capsys, said, fits):
    np.savez("seen.npz", uv=seen)
    assert run(["track", "seen.npz", "--camera", "dats", *said]) == 2
    err = capsys.readouterr().err
    assert err.startswith("error: dats: the hand would be ")
    assert fits in err
    assert not Path("recordings").exists()


def test_the_real_detections(tmp_path, monkeypatch):
    data = Path(__file__).resolve().parents[3] / "shared" / "data" / "stereo"
    if not data.is_dir():
        pytest.skip("../shared/data is not there")
    monkeypatch.chdir(tmp_path)
    camera = ["--camera", str(data / "camera_parameters"), "--board-unit", "42mm"]
    options = ["--frames", "100:160", "-q", "-o", "a.mcap"]
    assert run(["track", str(data / "detections_2d.npz"), *camera, *options]) == 0
    (track,) = ht.read_mcap("a.mcap")
    with np.load(data / "joints.npz") as file:
        triangulated = file["joints_m"][100:161]
    # both say how large the hand is and where; they differ by what a hand of rigid bones cannot do
    error = np.nanmedian(np.linalg.norm(track.filtered_joints - triangulated, axis=-1))
    assert track.hand == "right"
    assert error < 0.012
