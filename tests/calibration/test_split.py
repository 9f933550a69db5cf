"""What a residual is made of, on sequences made of one part each."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.calibration.explain import explain
from handtrack.calibration.split import split_of, told
from handtrack.hand.skeleton import ARRIVING


@pytest.fixture(scope="module")
def hand_moves(sample):
    model = ht.HandModel.default(sample.hand)
    part = slice(0, 150)
    track = ht.track(
        ht.Sequence(sample.time_ns[part], sample.truth[part], hand=sample.hand),
        model,
        calibrate="none",
    )
    from handtrack.hand.rotations import quaternion_to_matrix

    turn = quaternion_to_matrix(track.quaternion)
    return model, track.time_ns, track.angles, turn, track.translation


def parts(model, time_ns, joints):
    return explain(model, ht.Sequence(time_ns, joints, hand=model.hand), 60).split


def largest(split):
    found = split.summary()
    return max(found, key=found.__getitem__)


def test_noise(hand_moves):
    model, time_ns, *pose = hand_moves
    joints = model.joints(*pose)
    noisy = joints + np.random.default_rng(1).normal(0, 1e-3, joints.shape)
    found = parts(model, time_ns, noisy)
    assert largest(found) == "noise"
    # of 63 coordinates a fit leaves 37
    assert found.noise == pytest.approx(1e-3 * np.sqrt(3 * 37 / 63), rel=0.15)
    assert max(found.bias, found.model) < 0.4 * found.noise


def test_joints_that_stand_aside(hand_moves):
    model, time_ns, angles, turn, shift = hand_moves
    joints = model.joints(angles, turn, shift)
    aside = np.random.default_rng(2).normal(0, 4e-3, (21, 3))
    bones = turn[:, None] @ model.rotations(angles)[:, ARRIVING]
    found = parts(model, time_ns, joints + (bones @ aside[:, :, None])[..., 0])
    assert largest(found) == "bias"
    assert found.bias > 2 * max(found.noise, found.breathing)


def test_bones_that_breathe(hand_moves):
    model, time_ns, *pose = hand_moves
    joints = model.joints(*pose)
    size = 1 + 0.08 * np.sin(np.arange(len(joints)) / 12)[:, None, None]
    found = parts(model, time_ns, joints[:, :1] + size * (joints - joints[:, :1]))
    assert largest(found) == "breathing"


def test_poses_outside_the_limits(hand_moves):
    model, time_ns, angles, turn, shift = hand_moves
    wild = angles.copy()
    # hinges of the fingers bent backwards, now and then
    back = 0.6 * (np.sin(np.arange(len(angles)) / 8) > 0.3)
    wild[:, [6, 10, 14, 18]] = (model.limits.lower[[6, 10, 14, 18]]) - back[:, None]
    found = parts(model, time_ns, model.joints(wild, turn, shift))
    assert largest(found) == "model"


def test_the_parts_are_the_whole(hand_moves):
    off = np.random.default_rng(4).normal(1e-3, 2e-3, (40, 21, 3))
    off[3, 5] = np.nan
    found = split_of([off, off[:10]], 1.5e-3)
    both = np.concatenate([off, off[:10]])
    whole = np.nanmean(np.square(both).sum(-1))
    assert sum(x**2 for x in vars(found).values()) == pytest.approx(whole)
    assert told({"split_mm": found.summary()}).startswith("residual by its parts, rms: bias ")
    assert told({}) is None
