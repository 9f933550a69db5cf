"""MANO's shape coefficients from sequences: those that made the joints are found again."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.errors import InputError
from handtrack.fitting.mano_shape import mano_shape
from handtrack.hand.mano import MANO
from tools.make import mano_like as make_mano_like

BETAS = np.array([1.5, -1, 0.5, 2, -0.5, 0.3, -2, 1, 0.2, -0.7])


@pytest.fixture(scope="module")
def mano(tmp_path_factory) -> MANO:
    path = tmp_path_factory.mktemp("mano") / "MANO_RIGHT.pkl"
    with path.open("wb") as file:
        make_mano_like.write_pickle(make_mano_like.make_mano_like("right"), file)
    return MANO.load(path)


def moving(mano: MANO, frames: int = 120, noise: float = 0.0, seed: int = 0) -> ht.Sequence:
    """Random poses of the hand with BETAS."""
    model, rng = mano.model(BETAS), np.random.default_rng(seed)
    angles = model.limits.clamp(model.mean_angles + rng.normal(0, 0.4, (frames, 20)))
    rotation = Rotation.random(frames, random_state=seed).as_matrix()
    joints = model.joints(angles, rotation, rng.normal(0, 0.3, (frames, 3)))
    joints = joints + rng.normal(0, noise, joints.shape)
    return ht.Sequence(np.arange(frames) * 33_333_333, joints, hand="right")


def off(mano: MANO, found) -> tuple[float, float]:
    """Worst error of a bone and of a palm distance [m]."""
    true = mano.model(BETAS)
    bones = np.abs(found.model.bone_lengths - true.bone_lengths).max()
    palms = [m.rest_joints[[0, 1, 5, 9, 13, 17]] for m in (found.model, true)]
    spans = [np.linalg.norm(p[:, None] - p, axis=-1) for p in palms]
    return bones, np.abs(spans[0] - spans[1]).max()


def test_the_shape_is_found_again(mano):
    found = mano_shape(mano, moving(mano))
    assert found.error < 1e-4
    assert max(off(mano, found)) < 2e-4
    assert np.abs(found.betas - BETAS).max() < 0.3
    assert np.array_equal(found.model.shape, found.betas)
    assert found.frames == 120


def test_noise_of_2_mm(mano):
    found = mano_shape(mano, moving(mano, noise=0.002, seed=1))
    bones, palm = off(mano, found)
    assert bones < 1e-3
    assert palm < 1e-3
    assert 0.002 < found.error < 0.0035
    # the scaled mean hand is far off
    plain = ht.HandModel.default("right")
    assert np.abs(plain.bone_lengths - mano.model(BETAS).bone_lengths).max() > 4e-3


def test_missing_joints_are_no_evidence(mano):
    sequence = moving(mano, seed=2)
    joints = sequence.joints.copy()
    joints[np.random.default_rng(3).random(joints.shape[:2]) < 0.15] = np.nan
    joints[:20] = np.nan
    found = mano_shape(mano, ht.Sequence(sequence.time_ns, joints, hand="right"))
    assert found.frames <= 100
    assert max(off(mano, found)) < 5e-4


def test_what_is_not_seen_stays_near_the_mean_hand(mano):
    """Only palms: the shape is then MANO's most likely one, and the deviations say so."""
    sequence = moving(mano, seed=4)
    joints = sequence.joints.copy()
    joints[:, [3, 4, 7, 8, 11, 12, 15, 16, 19, 20]] = np.nan
    some = mano_shape(mano, ht.Sequence(sequence.time_ns, joints, hand="right"))
    whole = mano_shape(mano, sequence)
    assert (some.deviation > whole.deviation).all()
    assert some.deviation.max() <= 1
    assert np.linalg.norm(some.betas) < np.linalg.norm(BETAS)


def test_what_cannot_be_used_is_said(mano):
    sequence = moving(mano, 10)
    left = ht.Sequence(sequence.time_ns, sequence.joints, hand="left")
    with pytest.raises(InputError, match="a left hand, the MANO file a right one"):
        mano_shape(mano, left)
    joints = sequence.joints.copy()
    joints[2:] = np.nan
    with pytest.raises(InputError, match="2 frames have 10 joints, 3 are needed"):
        mano_shape(mano, ht.Sequence(sequence.time_ns, joints, hand="right"))
