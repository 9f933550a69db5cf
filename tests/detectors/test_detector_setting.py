"""From detections and truth to a profile, through tracking, a file and back."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from handtrack.detectors.chosen import chosen_profile, told
from handtrack.detectors.profile import (
    IN_SPACE,
    ONE_CAMERA,
    Noise,
    Profile,
    load_profile,
    save_profile,
    shipped,
)
from handtrack.errors import InputError
from handtrack.evaluation.landmarks import Seen, estimate_profile
from handtrack.evaluation.metrics import pa_mpjpe
from handtrack.recording.read import read_mcap
from handtrack.recording.retrack import retrack
from handtrack.recording.write import write_mcap

SMALL = np.full(21, 1e-3)
FRAMES = 90


def planted() -> Profile:
    """Landmarks at the tips' flesh and off the wrist, as far as MediaPipe's."""
    offsets = np.random.default_rng(5).normal(0.0, 0.06, (21, 3))
    return Profile("planted", "planted", IN_SPACE, offsets, Noise(3 * SMALL, SMALL, SMALL, 0.2))


def motion(hand: str = "right", seed: int = 0):
    """Angles, turns and places of a moving hand."""
    from handtrack.hand.rotations import vector_to_matrix

    rng = np.random.default_rng(seed)
    model = ht.HandModel.default(hand)
    t = np.arange(FRAMES)[:, None] / 30
    way, phase = rng.uniform(1, 4, 20), rng.uniform(0, 6, 20)
    share = 0.5 + 0.45 * np.sin(way * t + phase)
    low, high = model.limits.lower, model.limits.upper
    angles = model.limits.clamp(low + share * (high - low))
    turn = np.array([vector_to_matrix(v) for v in 0.5 * np.sin(t + np.arange(3))])
    return angles, turn, 0.2 * np.sin(t * [1.0, 1.3, 0.7])


def detected(hand: str = "right", seed: int = 0, noise_m: float = 1e-3):
    """What the planted detector sees, and the truth."""
    model = planted().on(ht.HandModel.default(hand))
    pose = motion(hand, seed)
    truth, marks = model.joints(*pose), model.landmarks(*pose)
    marks = marks + np.random.default_rng(seed + 9).normal(0, noise_m, marks.shape)
    time_ns = np.arange(FRAMES) * 33_333_333
    return ht.Sequence(time_ns, marks, hand=hand, name=f"clip{seed}", truth=truth), truth


@pytest.fixture(scope="module")
def found() -> Profile:
    """From both hands, whose models are found in the truth."""
    clips = [Seen.of(*detected("right", 0)), Seen.of(*detected("left", 1))]
    return estimate_profile(clips, "found")


def test_planted_offsets_are_found(found):
    np.testing.assert_allclose(found.offsets, planted().offsets, atol=0.015)
    assert found.evidence["with_mm"] < 0.4 * found.evidence["without_mm"]
    white = found.noise.white
    assert 0.7e-3 < np.sqrt(np.square(white).mean()) < 1.3e-3
    assert found.noise.constant.mean() < 0.6e-3
    assert found.noise.fading.mean() < 0.6e-3


def test_one_cameras_sizes_do_not_matter():
    sequence, truth = detected()
    sizes = np.exp(0.1 * np.sin(np.arange(FRAMES) / 9))[:, None, None]
    turned = (sequence.joints - sequence.joints.mean(1, keepdims=True)) * sizes
    one = ht.Sequence(sequence.time_ns, turned[..., [1, 2, 0]], name="one")
    profile = estimate_profile([Seen.of(one, truth)], "one", input=ONE_CAMERA)
    assert profile.evidence["with_mm"] < 0.5 * profile.evidence["without_mm"]
    assert 0.05 < profile.noise.scale < 0.09
    # what one camera shows is the hand's shape: what is common to all landmarks is not in it
    model = ht.HandModel.default()
    pose = motion()
    marks = [p.on(model).landmarks(*pose) for p in (profile, planted())]
    plain = pa_mpjpe(model.joints(*pose), marks[1]).mean()
    assert pa_mpjpe(marks[0], marks[1]).mean() < 0.35 * plain


def test_lasting_noise_is_told_from_white():
    sequence, truth = detected(noise_m=0.0)
    rng, rho = np.random.default_rng(3), np.exp(-1 / (30 * 0.3))
    lasting = np.zeros_like(truth)
    for t in range(1, FRAMES):
        new = rng.normal(0, 4e-3 * np.sqrt(1 - rho**2), (21, 3))
        lasting[t] = rho * lasting[t - 1] + new
    noisy = sequence.joints + lasting + rng.normal(0, 1e-3, truth.shape)
    seen = Seen.of(ht.Sequence(sequence.time_ns, noisy), truth)
    noise = estimate_profile([seen], "noisy").noise
    assert np.sqrt(np.square(noise.lasting).mean()) == pytest.approx(4e-3, rel=0.35)
    assert np.sqrt(np.square(noise.white).mean()) == pytest.approx(1e-3, rel=0.4)
    assert 0.1 < noise.fades_s < 0.6


def test_a_profile_brings_tracks_nearer_and_back_from_a_file(tmp_path, found):
    sequence, truth = detected(seed=4)
    path = save_profile(found, tmp_path / "p.json")
    tracks = {
        name: ht.track(sequence, detector=detector)
        for name, detector in (("plain", "none"), ("profile", str(path)))
    }
    off = {n: pa_mpjpe(t.filtered_joints, truth).mean() for n, t in tracks.items()}
    assert off["profile"] < 0.4 * off["plain"]
    track = tracks["profile"]
    # errors are those of landmarks to landmarks
    assert (
        np.median(track.error)
        < 2e-3
        < np.median(np.linalg.norm(track.fitted_joints - track.observed, axis=-1))
    )
    write_mcap([track], tmp_path / "a.mcap")
    back = read_mcap(tmp_path / "a.mcap")[0]
    np.testing.assert_array_equal(back.model.landmark_offsets, track.model.landmark_offsets)
    np.testing.assert_array_equal(back.error, track.error)
    assert back.settings["detector"] == str(path)
    again = retrack(back)
    np.testing.assert_array_equal(again.angles, track.angles)
    assert not retrack(back, detector="none").model.has_landmarks


def test_the_reader_says_whose_landmarks_they_are():
    assert chosen_profile("auto", "") is None
    assert chosen_profile("none", "mediapipe") is None
    for name in shipped():
        assert chosen_profile("auto", name).name == name
    sequence, _ = detected(seed=2)
    known = ht.Sequence(sequence.time_ns, sequence.joints, detector="mediapipe-3d")
    track = ht.track(known, calibrate=False)
    assert track.settings["detector"] == "mediapipe-3d"
    assert told(track.settings).startswith("mediapipe-3d, the input is that detector's")
    asked = ht.track(sequence, calibrate=False, detector="mediapipe-3d")
    assert told(asked.settings).startswith("mediapipe-3d, as asked for")
    assert retrack(asked).settings == asked.settings
    assert track.model.has_landmarks
    assert "detector" not in ht.track(sequence, calibrate=False).settings


def test_the_command_makes_a_profile_that_track_takes(tmp_path, capsys):
    for seed in (0, 1):
        sequence, truth = detected(seed=seed)
        np.savez(
            tmp_path / f"clip{seed}.npz",
            joints_m=sequence.joints,
            time_ns=sequence.time_ns,
            truth_m=truth,
            hand="right",
        )
    files = [str(tmp_path / f"clip{s}.npz") for s in (0, 1)]
    out = tmp_path / "p.json"
    assert run(["profile", *files, "-o", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["clips"] == 2
    assert load_profile(out).name == "p"
    track = ["track", files[0], "-o", str(tmp_path / "a.mcap"), "--no-mesh", "-q", "--overwrite"]
    assert run([*track, "--detector", str(out)]) == 0
    assert run(["track", files[0], "-o", str(tmp_path / "b.mcap"), "--detector", str(out)]) == 0
    assert "landmarks as of" in capsys.readouterr().out
    assert run(["info", str(tmp_path / "b.mcap")]) == 0
    assert "p.json, as asked for" in capsys.readouterr().out
    left = tmp_path / "left.npz"
    np.savez(left, joints_m=truth * [-1, 1, 1], time_ns=sequence.time_ns, hand="left")
    assert run(["profile", files[0], "--truth", str(left), "-o", str(tmp_path / "no.json")]) == 2
    assert "the truth is of a left hand" in capsys.readouterr().err
    assert run([*track, "--detector", "no-such"]) == 2
    assert "no-such' is unknown" in capsys.readouterr().err


def test_what_cannot_make_a_profile_is_said():
    sequence, truth = detected()
    few = ht.Sequence(sequence.time_ns[:20], sequence.joints[:20])
    with pytest.raises(InputError, match=r"20 frames have all 21 joints .* needs 50"):
        estimate_profile([Seen.of(few, truth[:20])], "few")
    with pytest.raises(InputError, match="the truth has shape"):
        Seen.of(few, truth)
    same = Seen.of(ht.Sequence(sequence.time_ns, truth), truth)
    with pytest.raises(InputError, match="do not err"):
        estimate_profile([same], "same")
    with pytest.raises(InputError, match=r"the truth is no .* hand's"):
        Seen.of(sequence, truth[:, np.random.default_rng(0).permutation(21)])
