"""One camera's joints and its picture together; the size and the distance that they leave open."""

from __future__ import annotations

import numpy as np
import pytest
from seen_hands import SIZE, made

import handtrack as ht
from handtrack.detectors.profile import Noise
from handtrack.errors import InputError
from handtrack.evaluation.metrics import pa_mpjpe
from handtrack.tracking.settings import TrackSettings
from handtrack.video.detections import saved_detections
from handtrack.video.following import follow
from handtrack.video.one_camera import SeenHand, believed_size, hand_seen, steady_depths
from handtrack.video.views import views_of

MM = np.full(21, 1e-3)


def test_together_they_are_nearer_than_either():
    model, truth, camera, found = made()
    (views,) = views_of([found], [camera])
    hand = hand_seen(views, model, "none", "none", is_own=True)
    both = follow(views, hand.model, hand.shown, TrackSettings(detector="none"))
    alone = follow(views, hand.model)  # as if points only began the fits
    joints = ht.track(views.sequence(), model, calibrate="none", detector="none").filtered_joints

    def error(x):
        return 1e3 * float(np.nanmean(pa_mpjpe(x, truth)))

    assert error(both.sequence.joints) < 0.8 * error(joints)
    assert error(both.sequence.joints) < 0.8 * error(alone.sequence.joints)
    assert np.nanmedian(both.reprojection) < 2.5
    # in the camera's world, as far away as the hand's true size says
    off = both.sequence.joints.mean(1) - truth.mean(1)
    assert np.abs(off[:, :2]).max() < 0.01
    assert np.abs(np.median(off[:, 2])) < 0.02


def test_frames_without_joints_are_fitted_to_the_picture_alone():
    model, _truth, camera, found = made(12)
    found.world["right"][4] = np.nan
    (views,) = views_of([found], [camera])
    followed = follow(views, model, model)
    assert np.isfinite(followed.sequence.joints).all()
    assert np.nanmedian(followed.reprojection[4]) < 4.0


def test_the_hand_is_as_large_as_the_detectors_and_peoples_sizes_say():
    noise = Noise(MM, MM, MM, 0.3, size=0.063)
    half = believed_size(1.21, noise)
    assert half.factor == pytest.approx(1.21**-0.5)
    assert half.deviation == pytest.approx(0.063 / np.sqrt(2))
    assert believed_size(1.2, Noise(MM, MM, MM, 0.3)) == (1.0, 0.063)
    assert believed_size(1.2, None) == (1.0, 0.063)
    model, _, camera, found = made(12)
    (views,) = views_of([found], [camera])
    known = hand_seen(views, model, "none", "none", is_own=True)
    assert known.size_deviation == 0.0
    assert known.fitted.size == model.size
    assert hand_seen(views, model, "none", "none").size_deviation == 0.063


def test_a_profile_says_how_much_one_cameras_errors_move():
    model, _, camera, found = made(12)
    (views,) = views_of([found], [camera])
    from handtrack.detectors.profile import load_profile

    noise = load_profile("mediapipe").noise
    hand = hand_seen(views, model, "none", "mediapipe")
    assert hand.noise_mm == pytest.approx(
        1e3 * np.sqrt((np.square(noise.fading) + np.square(noise.white)).mean())
    )
    # the picture's landmarks are those of several cameras
    assert isinstance(hand, SeenHand)
    assert hand.shown is not None
    picture = hand_seen(views, model, "none", "mediapipe", pictured="mediapipe-3d").shown
    assert picture is not None
    assert not np.allclose(picture.landmark_offsets, hand.model.landmark_offsets)


def test_distances_are_steadied_and_causal_ones_do_not_look_ahead():
    rng, n = np.random.default_rng(2), 120
    times = (np.arange(n) * 33_333_333).astype(np.int64)
    true = 0.5 + 0.1 * np.sin(2 * np.pi * 0.3 * times * 1e-9)
    depths = true * np.exp(rng.normal(0, 0.03, n))
    depths[40:44] = np.nan
    raw = np.nanstd(depths - true)
    for name, share in (("rts", 0.45), ("fixed-lag", 0.75), ("kalman", 0.85)):
        found = steady_depths(depths, times, name, 2)
        assert np.array_equal(np.isnan(found), np.isnan(depths))
        assert np.nanstd(found - true) < share * raw, name
    assert steady_depths(depths, times, "none", 2) is depths
    changed = depths.copy()
    changed[100:] = depths[100:][::-1]  # the same errors in another order
    for name, ahead in (("kalman", 0), ("fixed-lag", 2)):
        before, after = (steady_depths(d, times, name, 2) for d in (depths, changed))
        # what shakes is found in all frames, and differs by little
        np.testing.assert_allclose(before[: 99 - ahead], after[: 99 - ahead], rtol=5e-3)
    assert np.isnan(steady_depths(np.full(n, np.nan), times, "rts", 2)).all()


def test_what_detect_writes_is_read_with_its_picture(tmp_path):
    _, _, _, found = made(10)
    path = tmp_path / "seen.npz"
    found.save(path)
    read = saved_detections(path)
    assert read is not None
    assert read.size == SIZE
    assert read.hands == ("right",)
    np.testing.assert_allclose(read.image["right"], found.image["right"], atol=1e-3)
    np.testing.assert_allclose(read.world["right"], found.world["right"], atol=1e-6)
    part = saved_detections(path, (2, 5))
    assert part is not None
    assert part.frame_index.tolist() == [2, 3, 4]
    np.savez(tmp_path / "other.npz", joints=np.zeros((3, 21, 3)))
    assert saved_detections(tmp_path / "other.npz") is None
    assert saved_detections(tmp_path / "no.csv") is None


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("right_image_px", np.zeros((3, 21, 2)), "right_image_px has shape"),
        ("size_px", np.array([0, 720]), "size_px is"),
        ("size_px", np.array([1, 2, 3]), "size_px is"),
    ],
)
def test_what_is_wrong_in_it_is_said(tmp_path, name, value, said):
    made(10)[3].save(tmp_path / "seen.npz")
    with np.load(tmp_path / "seen.npz") as data:
        arrays = {**{k: data[k] for k in data.files}, name: value}
    np.savez(tmp_path / "seen.npz", **arrays)
    with pytest.raises(InputError, match=said):
        saved_detections(tmp_path / "seen.npz")


def test_the_command_fits_the_picture_with_a_field_of_view(tmp_path, capsys):
    from handtrack.cli import run

    made(30)[3].save(tmp_path / "seen.npz")
    out = tmp_path / "seen.mcap"
    arguments = ["track", str(tmp_path / "seen.npz"), "--fov", "53.13", "-o", str(out)]
    assert run([*arguments, "--mesh", "none"]) == 0
    said = capsys.readouterr().err
    assert "reprojection error" in said
    assert "a lens 10 % longer" in said
    assert "its size is the detector's and people's to 6% (standard deviation" in said
    (track,) = ht.read_mcap(out)
    about = track.settings["cameras"]
    assert about["lens"] == "53.13 degrees"
    assert about["depth_deviation"] == pytest.approx(0.055, abs=0.005)
    assert 0.4 < np.nanmedian(track.fitted_joints[:, 0, 2]) < 0.65
