"""A subject's proportions found again in synthetic motion whose hand is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from handtrack.calibration.calibrate import calibrate as calibrate_by
from handtrack.calibration.noise import noise_level
from handtrack.errors import InputError
from handtrack.fitting.fit import fit
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import BASES, HANDS, JOINT_NAMES, PALM
from handtrack.sequences.sequence import Sequence
from tools.make import sample as make_sample


def calibrate(model: HandModel, given: Sequence):
    return calibrate_by(model, given, "proportions")


def scale_to(model: HandModel, given: Sequence):
    return calibrate_by(model, given, "scale")


FINGER_BONES = np.setdiff1d(np.arange(20), BASES - 1)


def moving(hand: str = "right", noise: float = 0.0, seed: int = 0, seconds: float = 10.0):
    """A subject's hand and a sequence of it, without and with noise."""
    rng = np.random.default_rng(seed)
    subject = make_sample.subject_hand(rng, hand)
    joints = subject.joints(*make_sample.motion(seconds, 30.0, rng))
    return subject, sequence(joints + noise * rng.normal(size=joints.shape), hand)


def sequence(joints: np.ndarray, hand: str = "right") -> Sequence:
    time = np.arange(len(joints)) * 33_333_333
    return Sequence(time_ns=time, joints=joints, hand=hand)


def with_joints(given: Sequence, joints: np.ndarray) -> Sequence:
    return sequence(joints, given.hand)


def palm_error(found: HandModel, subject: HandModel) -> float:
    """Greatest error of a distance between two palm joints [m]."""
    return np.abs(pdist(found.rest_joints[PALM]) - pdist(subject.rest_joints[PALM])).max()


def length_error(found: HandModel, subject: HandModel) -> np.ndarray:
    return np.abs(found.bone_lengths - subject.bone_lengths)[FINGER_BONES]


# ---- noise ----


@pytest.mark.parametrize("sigma", [0.002, 0.005, 0.010])
def test_noise_is_measured(sigma):
    for seed in range(3):
        _, seq = moving(noise=sigma, seed=seed)
        assert noise_level(seq.joints) == pytest.approx(sigma, rel=0.05, abs=0)


def test_noise_does_not_mind_gaps_outliers_or_units():
    _, seq = moving(noise=0.004, seed=3)
    joints = seq.joints.copy()
    rng = np.random.default_rng(4)
    joints[rng.random(joints.shape[:2]) < 0.05] = np.nan
    joints[rng.random(joints.shape[:2]) < 0.01] += 0.1
    assert noise_level(joints) == pytest.approx(0.004, rel=0.1, abs=0)
    assert noise_level(1000 * joints) == pytest.approx(1000 * noise_level(joints), rel=1e-12)


def test_clean_or_short_sequences_have_no_noise():
    _, seq = moving()
    assert noise_level(seq.joints) < 0.0006  # what the motion's own jerk leaves
    assert noise_level(seq.joints[:3]) == 0
    assert noise_level(np.full((30, 21, 3), np.nan)) == 0
    assert noise_level(np.repeat(seq.joints[:1], 10, 0)) == pytest.approx(0, abs=1e-15)


# ---- lengths and palm ----


@pytest.mark.parametrize("hand", HANDS)
def test_a_clean_motion_gives_the_hand(hand):
    for seed in range(3):
        subject, seq = moving(hand, seed=seed)
        prior = HandModel.default(hand)
        found = calibrate(prior, seq)
        assert length_error(found.model, subject).max() < 2e-5
        assert palm_error(found.model, subject) < 2e-5
        assert found.kept == ()
        assert found.frames == len(seq) == 300
        # far nearer than the prior was
        assert length_error(prior.scaled(found.scale), subject).max() > 1e-3
        assert palm_error(prior.scaled(found.scale), subject) > 1e-3


@pytest.mark.parametrize("noise", [0.002, 0.005])
def test_a_noisy_motion_gives_the_hand_without_the_noises_length(noise):
    """Bounds are shares of the noise: of 300 frames a bone's error is a tenth of it."""
    errors = []
    for seed in range(3):
        subject, seq = moving(noise=noise, seed=seed)
        found = calibrate(HandModel.default(), seq)
        assert found.noise == pytest.approx(noise, rel=0.05, abs=0)
        errors.append((found.model.bone_lengths - subject.bone_lengths)[FINGER_BONES])
        assert palm_error(found.model, subject) < 0.25 * noise
    spread = np.sqrt(np.mean(np.square(errors)))
    assert spread < 0.13 * noise
    assert np.abs(errors).max() < 4 * spread  # no bone apart from the others
    assert (np.abs(np.mean(errors, axis=1)) < 0.05 * noise).all()  # no longer on average


def test_what_is_not_measured_stays_the_priors():
    subject, seq = moving("left", noise=0.002)
    prior = HandModel.default("left", "li2021")
    found = calibrate(prior, seq).model
    assert np.array_equal(found.axes, prior.axes)
    assert found.limits is prior.limits
    assert found.hand == "left"
    assert np.allclose(found.rest_joints[0], prior.rest_joints[0], rtol=0, atol=1e-12)
    for k in range(2, 21):
        if k in BASES:
            continue
        old = prior.rest_joints[k] - prior.rest_joints[k - 1]
        new = found.rest_joints[k] - found.rest_joints[k - 1]
        old, new = old / np.linalg.norm(old), new / np.linalg.norm(new)
        assert np.allclose(old, new, rtol=0, atol=1e-12)
    # the palm lies as the prior's does, so that axes still fit it
    a = found.rest_joints[PALM] / found.size
    b = prior.rest_joints[PALM] / prior.size
    turn, _ = Rotation.align_vectors(a[1:], b[1:])
    assert np.rad2deg(turn.magnitude()) < 3
    assert subject.size == pytest.approx(found.size, rel=0.01)
    # the skin comes along
    assert len(found.rest_vertices) == len(prior.rest_vertices)
    tip = np.argmax(prior.weights[:, 6])
    shift = found.rest_vertices[tip] - prior.rest_vertices[tip]
    assert np.linalg.norm(shift - (found.rest_joints[8] - prior.rest_joints[8])) < 0.005


def test_the_calibrated_hand_fits_better():
    _, seq = moving(noise=0.001, seed=5)
    prior = HandModel.default()
    exact, scaled = calibrate(prior, seq).model, scale_to(prior, seq).model
    frames = seq.joints[::20]
    errors = [
        np.mean(
            [
                np.linalg.norm(fit(model, joints).joints - joints, axis=-1).mean()
                for joints in frames
            ]
        )
        for model in (exact, scaled)
    ]
    assert errors[0] < 0.6 * errors[1]


# ---- what is missing ----


def test_a_wrist_that_is_never_seen_keeps_its_place():
    subject, seq = moving(noise=0.001)
    joints = seq.joints.copy()
    joints[:, 0] = np.nan
    found = calibrate(HandModel.default(), with_joints(seq, joints))
    assert found.kept == ("wrist",)
    assert length_error(found.model, subject).max() < 0.0005
    bases = [pdist(m.rest_joints[BASES]) for m in (found.model, subject)]
    assert np.abs(bases[0] - bases[1]).max() < 0.0005
    prior = HandModel.default().scaled(found.scale)
    assert np.array_equal(found.model.rest_joints[0], prior.rest_joints[0])
    # and not far from where it really is
    assert np.abs(np.linalg.norm(found.model.rest_joints[BASES], axis=1)).min() > 0.02
    assert found.model.size == pytest.approx(subject.size, rel=0.1)


def test_bones_that_are_never_seen_are_the_scaled_priors():
    subject, seq = moving(noise=0.001)
    joints = seq.joints.copy()
    joints[:, [8, 15, 17]] = np.nan
    found = calibrate(HandModel.default(), with_joints(seq, joints))
    names = set(found.kept)
    assert names == {"index_tip", "ring_dip", "ring_tip", "little_mcp", "little_pip"}
    assert list(found.kept) == [n for n in JOINT_NAMES if n in names]
    prior = HandModel.default().scaled(found.scale)
    for joint in (8, 15, 16, 18):
        assert found.model.bone_lengths[joint - 1] == pytest.approx(prior.bone_lengths[joint - 1])
    seen = np.setdiff1d(FINGER_BONES, [7, 14, 15, 17])
    error = np.abs(found.model.bone_lengths - subject.bone_lengths)[seen]
    assert error.max() < 0.0005


def test_scattered_gaps_do_not_matter():
    subject, seq = moving(noise=0.001, seed=6)
    joints = seq.joints.copy()
    joints[np.random.default_rng(7).random(joints.shape[:2]) < 0.3] = np.nan
    found = calibrate(HandModel.default(), with_joints(seq, joints))
    assert found.kept == ()
    assert length_error(found.model, subject).max() < 0.0005
    assert palm_error(found.model, subject) < 0.0005


def test_stray_frames_do_not_matter():
    subject, seq = moving(noise=0.001, seed=8)
    rng = np.random.default_rng(9)
    joints = seq.joints.copy()
    bad = rng.choice(len(joints), 30, replace=False)
    joints[bad[:15]] = rng.normal(0, 0.1, (15, 21, 3))
    joints[bad[15:], 9] += 0.1
    found = calibrate(HandModel.default(), with_joints(seq, joints))
    assert length_error(found.model, subject).max() < 0.001
    assert palm_error(found.model, subject) < 0.001


# ---- too little ----


@pytest.mark.parametrize("make", [calibrate, scale_to])
def test_too_few_frames_are_an_error(make):
    _, seq = moving()
    joints = np.full((40, 21, 3), np.nan)
    joints[:, [4, 8, 12]] = seq.joints[:40, [4, 8, 12]]  # tips alone have no bone
    source = replace(with_joints(seq, joints), source="hands.npz")
    with pytest.raises(InputError, match=r"hands.npz: no bone") as raised:
        make(HandModel.default(), source)
    assert raised.value.path == Path("hands.npz")


def test_one_frame_gives_the_size_alone():
    subject, seq = moving(noise=0.0)
    found = calibrate(HandModel.default(), with_joints(seq, seq.joints[:1]))
    ratios = subject.bone_lengths / HandModel.default().bone_lengths
    assert found.scale == pytest.approx(np.median(ratios))
    assert np.allclose(found.model.bone_lengths / HandModel.default().bone_lengths, found.scale)


def test_three_frames_are_enough():
    subject, seq = moving(noise=0.0005)
    found = calibrate(HandModel.default(), with_joints(seq, seq.joints[::120]))
    assert found.frames == 3
    assert length_error(found.model, subject).max() < 0.004


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.23])
def test_scale_to_changes_the_size_alone(factor):
    prior = HandModel.default()
    truth = prior.scaled(factor)
    joints = truth.joints(*make_sample.motion(2.0, 30.0, np.random.default_rng(10)))
    found = scale_to(prior, sequence(joints))
    assert found.scale == pytest.approx(factor, rel=1e-3)
    assert np.allclose(found.model.rest_joints, prior.rest_joints * found.scale, rtol=1e-12)
    assert np.allclose(found.model.rest_vertices, prior.rest_vertices * found.scale, rtol=1e-12)
    assert found.kept == ()
    assert found.frames == 60


def test_scale_to_names_bones_it_did_not_see():
    _, seq = moving()
    joints = seq.joints.copy()
    joints[:, 12] = np.nan
    assert scale_to(HandModel.default(), with_joints(seq, joints)).kept == ("middle_tip",)


def test_the_sequence_and_the_prior_are_not_changed():
    _, seq = moving(noise=0.002)
    prior = HandModel.default()
    before = seq.joints.copy(), prior.rest_joints.copy(), prior.rest_vertices.copy()
    calibrate(prior, seq)
    after = seq.joints, prior.rest_joints, prior.rest_vertices
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))


def test_bases_given_at_the_wrist_are_not_seen():
    """As files without metacarpals have them: one joint given several times."""
    model = HandModel.default()
    joints = model.joints(*make_sample.motion(1.0, 30.0, np.random.default_rng(0)))
    joints[:, BASES[1:]] = joints[:, :1]
    found = calibrate(model, Sequence(np.arange(len(joints)) * 33_333_333, joints))
    assert np.isfinite(found.model.rest_vertices).all()
    assert {"index_mcp", "little_mcp"} <= set(found.kept)
