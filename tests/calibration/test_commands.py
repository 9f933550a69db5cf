"""handtrack calibrate, and tracks that use its hand."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from subjects import poses, subject

import handtrack as ht
from handtrack.cli import run


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """Two clips of a subject, and one of its other hand."""
    folder = tmp_path_factory.mktemp("clips")
    rng = np.random.default_rng(0)
    true = subject(rng)
    for name in ("a", "b"):
        joints = true.joints(*poses(rng, 90))
        joints = joints + 0.001 * rng.normal(size=joints.shape)
        np.savez(folder / f"{name}.npz", joints_m=joints, fps=30.0, hand="right")
    mirrored = joints * [-1.0, 1.0, 1.0]
    np.savez(folder / "left.npz", joints_m=mirrored, fps=30.0, hand="left")
    return folder


def test_clips_of_different_people_are_doubted(clips, tmp_path, capsys):
    rng = np.random.default_rng(5)
    joints = subject(rng).scaled(1.15).joints(*poses(rng, 90))
    other = tmp_path / "other.npz"
    np.savez(other, joints_m=joints + 0.001 * rng.normal(size=joints.shape), fps=30.0, hand="right")
    arguments = ["calibrate", str(clips / "a.npz"), str(other), "-o", str(tmp_path / "h.json")]
    assert run(arguments) == 0
    assert "are the clips of different people?" in capsys.readouterr().err
    same = ["calibrate", str(clips / "a.npz"), str(clips / "b.npz"), "-o", str(tmp_path / "s.json")]
    assert run(same) == 0
    assert capsys.readouterr().err == ""


def test_other_fingers_are_doubted_though_noise_hides_them(clips, tmp_path, capsys):
    """The residual is not twice what rigid bones leave, for noise is in both."""
    rng = np.random.default_rng(6)
    for name, longer in (("short", 1.0), ("long", 1.25)):
        joints = np.load(clips / "a.npz")["joints_m"].copy()
        for base in (5, 9, 13, 17):
            finger = joints[:, base + 1 : base + 4]
            finger += (longer - 1.0) * (finger - joints[:, base, None])
        noisy = joints + 0.002 * rng.normal(size=joints.shape)
        np.savez(tmp_path / f"{name}.npz", joints_m=noisy, fps=30.0, hand="right")
    short, long = (str(tmp_path / f"{name}.npz") for name in ("short", "long"))
    assert run(["calibrate", short, long, "-o", str(tmp_path / "h.json")]) == 0
    assert "warning: bones of every clip have other lengths" in capsys.readouterr().err


def test_clips_make_a_hand_that_tracks(clips, tmp_path, capsys):
    hand, out = tmp_path / "hand.json", tmp_path / "b.mcap"
    assert run(["calibrate", str(clips / "a.npz"), str(clips / "b.npz"), "-o", str(hand)]) == 0
    said = capsys.readouterr().out
    assert "right hand from 180 frames of 2 sequences" in said
    assert "any hand of rigid bones leaves" in said
    assert re.search(r"largest drift of a bone's length: a [\d.]+ mm, b [\d.]+ mm", said)
    stored = json.loads(hand.read_text())
    assert stored["calibration"]["method"] == "full"
    assert len(stored["calibration"]["sources"]) == 2
    assert stored["calibration"]["residual_mean_mm"] < 2.0
    track = ["track", str(clips / "b.npz"), "-o", str(out), "--no-mesh", "-q"]
    assert run([*track, "--hand-model", str(hand)]) == 0
    (used,) = ht.read_mcap(out)
    np.testing.assert_array_equal(used.model.rest_joints, ht.load_hand(hand).rest_joints)
    np.testing.assert_array_equal(used.model.axes, ht.load_hand(hand).axes)
    assert used.settings["calibrate"] == "none"
    # only its proportions are taken where that is asked for
    assert run([*track, "--hand-model", str(hand), "--calibrate", "--overwrite"]) == 0
    (anew,) = ht.read_mcap(out)
    assert anew.settings["calibration"]["method"] == "full"


def test_a_track_records_its_calibration(clips, tmp_path, capsys):
    out = tmp_path / "a.mcap"
    assert run(["track", str(clips / "a.npz"), "-o", str(out), "--no-mesh"]) == 0
    assert "a: the calibrated hand leaves" in capsys.readouterr().out
    (track,) = ht.read_mcap(out)
    found = track.settings["calibration"]
    assert (found["method"], found["frames"]) == ("full", 90)
    assert found["bound_rms_mm"] <= found["unlimited_rms_mm"] <= found["residual_rms_mm"]
    assert found["noise_mm"] == pytest.approx(1.0, abs=0.15)


def test_numbers_for_machines(clips, tmp_path, capsys):
    out = str(tmp_path / "hand.json")
    assert run(["calibrate", str(clips / "a.npz"), "-o", out, "--method", "scale", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["hand"], found["method"], found["output"]) == ("right", "scale", out)
    assert len(found["kept_axes"]) == 20


@pytest.mark.parametrize(
    ("inputs", "options", "message"),
    [
        (["a", "left"], [], "left and right hands are in the input: choose one with --hand"),
        (["a"], ["-o", "hand.txt"], "expected a name that ends in .json"),
        (["a"], ["--frames", "0:6"], "7 frames with 12 joints or more, a full calibration needs"),
        (["a", "a"], [], "holds several right hands, a calibration is of one"),
    ],
)
def test_what_cannot_be_calibrated(inputs, options, message, clips, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = [str(clips / f"{name}.npz") for name in inputs]
    assert run(["calibrate", *files, *options]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_hand_of_the_other_side_is_refused(clips, tmp_path, capsys):
    hand = str(tmp_path / "hand.json")
    assert run(["calibrate", str(clips / "left.npz"), "-o", hand, "-q"]) == 0
    out = str(tmp_path / "a.mcap")
    assert run(["track", str(clips / "a.npz"), "--hand-model", hand, "-o", out]) == 2
    assert "is a left hand, the sequence is of the right one" in capsys.readouterr().err


def test_joints_of_a_hand_that_was_fitted_are_told(tmp_path, capsys):
    model = ht.HandModel.default("right")
    angles = np.linspace(0.2, 0.8, 40)[:, None] * model.limits.upper
    joints = np.stack([model.joints(a, np.eye(3), [0.0, 0.0, 0.5]) for a in angles])
    np.savez(tmp_path / "a.npz", joints_m=joints, fps=30.0, hand="right")
    assert run(["calibrate", str(tmp_path / "a.npz"), "-o", str(tmp_path / "hand.json")]) == 0
    assert "the joints are those of a rigid hand without noise" in capsys.readouterr().err
