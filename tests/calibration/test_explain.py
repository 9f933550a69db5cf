"""The bound: what no hand of rigid bones can explain."""

from __future__ import annotations

import json

import numpy as np
import pytest
from subjects import poses, residual_mm, sequence, subject

from handtrack.calibration.calibrate import calibrate
from handtrack.calibration.explain import explain
from handtrack.errors import InputError
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import BASES


def test_a_rigid_hand_is_explained_whole_by_the_bound():
    rng = np.random.default_rng(0)
    true = subject(rng)
    seen = sequence(true.joints(*poses(rng, 100)))
    # by the bound even if the model is another hand
    found = explain(HandModel.default().scaled(0.9), seen)
    assert found.bound.rms < 2e-5
    assert found.unlimited.mean > 1e-3
    assert found.fitted.mean * 1e3 == pytest.approx(
        residual_mm(HandModel.default().scaled(0.9), seen.joints), rel=0.05
    )
    exact = explain(true, seen)
    assert exact.fitted.rms < 1e-6


def test_joints_that_bend_every_way_are_no_fault_of_the_data():
    """Bones of constant length that no hinges could move: the bound is 0, the hand's is not."""
    rng = np.random.default_rng(1)
    rest = HandModel.default().rest_joints
    joints = np.repeat(rest[None], 60, 0)
    for base in BASES:
        for k in range(base + 1, base + 4):
            bend = vector_to_matrix(rng.normal(0, 0.5, (60, 3)))
            joints[:, k] = joints[:, k - 1] + bend @ (rest[k] - rest[k - 1])
    seen = sequence(joints)
    found = explain(calibrate(HandModel.default(), seen).model, seen)
    assert found.bound.rms < 2e-5
    assert found.unlimited.rms > 2e-3
    assert found.fitted.rms >= found.unlimited.rms


def test_bones_that_change_their_lengths_are_the_datas_fault():
    """A bone that is long in every other frame leaves half of it at least."""
    rng = np.random.default_rng(2)
    true = subject(rng)
    joints = true.joints(*poses(rng, 100))
    stretch = 0.2 * (joints[::2, 8] - joints[::2, 7])
    joints[::2, 8] += stretch
    off = 0.5 * np.linalg.norm(stretch, axis=-1).mean()
    found = explain(calibrate(HandModel.default(), sequence(joints)).model, sequence(joints))
    # one of 21 joints is off, or its neighbours share it
    at_least = off / 21 / 2
    assert found.bound.mean > at_least
    assert found.bound.rms <= found.unlimited.rms * 1.001
    assert found.unlimited.rms <= found.fitted.rms * 1.001


def test_noise_is_explained_as_far_as_there_are_unknowns():
    """Of 63 coordinates a free hand takes 36 and the model 26; the noise in the rest stays."""
    rng = np.random.default_rng(3)
    true = subject(rng)
    joints = true.joints(*poses(rng, 200))
    seen = sequence(joints + 0.002 * rng.normal(size=joints.shape))
    found = explain(true, seen)
    assert found.unlimited.rms == pytest.approx(0.002 * np.sqrt(3 * 37 / 63), rel=0.03)
    assert found.bound.rms == pytest.approx(0.002 * np.sqrt(3 * 27 / 63), rel=0.03)
    assert found.frames == 200


def test_missing_joints_do_not_count():
    rng = np.random.default_rng(4)
    true = subject(rng)
    joints = true.joints(*poses(rng, 60))
    joints[rng.random(joints.shape[:2]) < 0.2] = np.nan
    joints[:, 0] = np.nan
    found = explain(true, [sequence(joints), sequence(joints)])
    assert found.frames > 100
    assert found.bound.rms < 2e-5
    numbers = found.summary()
    assert numbers["bound_mean_mm"] == pytest.approx(1e3 * found.bound.mean)
    json.dumps(numbers, allow_nan=False)


def test_nothing_to_explain_is_an_error():
    joints = np.full((5, 21, 3), np.nan)
    joints[:, :4] = HandModel.default().rest_joints[:4]
    with pytest.raises(InputError, match=r"few.npz: no frame has 12 joints"):
        explain(HandModel.default(), sequence(joints, source="few.npz"))
