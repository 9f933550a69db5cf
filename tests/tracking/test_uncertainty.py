"""What a track says of its own errors, held to the errors."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.calibration.lasting import noise_covariance, pose_jacobians
from handtrack.detectors.profile import Noise, Profile, save_profile
from handtrack.errors import SettingsError
from handtrack.hand.skeleton import N_JOINTS

FILTERS = ("none", "kalman", "fixed-lag", "rts")


def standardised(track, angles, joints):
    """Root mean square of errors over their deviations: of angles, and of joints."""
    known = np.isfinite(track.angle_variance) & (track.angle_variance > 0)
    off = (track.angles - angles)[known] ** 2 / track.angle_variance[known]
    near = np.square(track.filtered_joints - joints).mean(-1) / track.joint_deviation() ** 2
    return np.sqrt(off.mean()), np.sqrt(near[np.isfinite(near)].mean())


@pytest.fixture(scope="module")
def moved(sample):
    """A hand's angles and joints on a movement, 150 frames, to the micrometre."""
    model = ht.HandModel.default(sample.hand)
    part = slice(60, 210)
    clean = ht.Sequence(sample.time_ns[part], sample.truth[part], hand=sample.hand)
    track = ht.track(clean, model, calibrate="none")
    return model, clean.time_ns, track.angles, track.fitted_joints


@pytest.mark.parametrize("name", FILTERS)
def test_white_noise_is_known(name, moved):
    model, time_ns, angles, joints = moved
    noise = np.random.default_rng(3).normal(0, 2e-3, joints.shape)
    seen = ht.Sequence(time_ns, joints + noise, hand=model.hand)
    for_angles, for_joints = standardised(
        ht.track(seen, model, calibrate="none", filter=name), angles, joints
    )
    assert 0.8 < for_angles < 1.25
    assert 0.8 < for_joints < 1.25


def test_a_filter_says_that_it_is_nearer(moved):
    model, time_ns, _, joints = moved
    noise = np.random.default_rng(4).normal(0, 3e-3, joints.shape)
    seen = ht.Sequence(time_ns, joints + noise, hand=model.hand)
    tracks = [ht.track(seen, model, calibrate="none", filter=name) for name in FILTERS]
    spread = [np.median(t.angle_variance) for t in tracks]
    assert spread[0] > 1.5 * spread[1] > 2 * max(spread[2:])
    assert (
        np.median(tracks[3].joint_deviation(), 0) < np.median(tracks[0].joint_deviation(), 0)
    ).all()


def lasting_profile(constant, **more):
    zero = np.zeros(N_JOINTS)
    noise = Noise(np.full(N_JOINTS, constant), zero, zero, 0.3, **more)
    return Profile("made", "made", "in space", np.full((N_JOINTS, 3), 0.02), noise)


@pytest.fixture(scope="module")
def biased(moved, tmp_path_factory):
    """Clips of landmarks that stand aside, each clip's in its own way, and the tracks of them."""
    bare, time_ns, angles, _ = moved
    profile = lasting_profile(4e-3)
    path = save_profile(profile, tmp_path_factory.mktemp("profile") / "made.json")
    model, rng, pick = profile.on(bare), np.random.default_rng(5), slice(0, 150, 15)
    found = []
    for _ in range(12):
        landmarks = model.landmarks(angles[pick]) + rng.normal(0, 4e-3, (N_JOINTS, 3))
        seen = ht.Sequence(time_ns[pick], landmarks, hand=bare.hand)
        found.append(ht.track(seen, bare, calibrate="none", detector=str(path), gate=False))
    return found, angles[pick], bare.joints(angles[pick])


def test_what_lasts_in_landmarks_is_in_the_uncertainty(biased):
    tracks, angles, joints = biased
    each = np.array([standardised(track, angles, joints) for track in tracks])
    assert (abs(np.sqrt(np.square(each).mean(0)) - 1.0) < 0.25).all()


def test_retracking_knows_what_lasts(biased):
    track = biased[0][0]
    again = ht.retrack(track)
    np.testing.assert_array_equal(again.angle_variance, track.angle_variance)
    assert again.settings["lasting_deg"] == track.settings["lasting_deg"]
    other = ht.retrack(track, detector="none")
    assert "lasting_deg" not in other.settings


def test_errors_of_a_finger_go_together_and_strays_count():
    plain = noise_covariance(lasting_profile(2e-3).noise)
    np.testing.assert_allclose(plain, 4e-6 * np.eye(63))
    related = noise_covariance(lasting_profile(2e-3, finger=0.5, outliers=0.02).noise)
    np.testing.assert_allclose(np.diagonal(related), 4e-6 * (1 + 0.02 * 35))
    joint = related.reshape(21, 3, 21, 3)[:, 0, :, 0] / related[0, 0]
    np.testing.assert_allclose(joint[5, 4:9], [0, 1, 0.5, 0.25, 0.125])


def test_jacobians_are_those_of_small_moves(moved):
    model, _, angles, _ = moved
    landmarks, centres = pose_jacobians(lasting_profile(1e-3).on(model), angles[:2])
    step = np.zeros((2, 20))
    step[:, 9] = 1e-4
    moved_by = (model.joints(angles[:2] + step) - model.joints(angles[:2])) / 1e-4
    np.testing.assert_allclose(centres[:, :, 9], moved_by.reshape(2, 63), atol=1e-4)
    assert np.abs(landmarks[..., 9] - centres[..., 9]).max() > 1e-4
    turn = ht.HandModel.default(model.hand).joints(angles[:2])
    np.testing.assert_allclose(
        centres[:, :, 22].reshape(2, 21, 3), np.cross([0, 0, 1.0], turn), atol=1e-9
    )


@pytest.mark.parametrize("wrong", [[1.0] * 19, [-1.0] * 20, "much", [float("nan")] * 20])
def test_a_row_of_numbers_is_checked(wrong):
    with pytest.raises(SettingsError, match=r"lasting_deg is .*, expected 20 numbers"):
        ht.Tracker(ht.HandModel.default(), lasting_deg=wrong)
