"""Bones that sink into each other: the penalty and its slopes, and fits that keep them apart."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import loaded
from numba import njit

from fit_cases import forward, some_poses  # isort: skip

import handtrack as ht
from handtrack.hand.capsules import contact_depths, contacts
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS
from handtrack.kernels import collisions, joint_objective

FIST = np.deg2rad([20.0, 10, 40, 40] + [75.0, 0, 85, 55] * 4)


@njit
def weigh(works, g, h):
    joint_objective.place(works[0])
    return collisions.weigh_contacts(works[0], g, h, True)


def penalty(model: HandModel, angles: np.ndarray, twist: float = 0.0) -> np.ndarray:
    """(n,) from its definition, by other code: kinematics and distances in NumPy."""
    depth = contact_depths(forward(model, angles, twist), contacts(model))
    return collisions.HARD * np.square(np.maximum(depth, 0)).sum(1)


def with_contacts(model: HandModel, works: np.ndarray) -> np.ndarray:
    pairs = contacts(model)
    works["contacts"], works["contact"][0, : len(pairs)] = len(pairs), pairs
    return works


@pytest.mark.parametrize("twist", [0.0, 0.6])
@pytest.mark.parametrize("hand", HANDS)
def test_the_penalty_and_its_slopes(hand, twist):
    model = HandModel.default(hand)
    poses = some_poses(model, 40, seed=6)
    touching = 0
    for i, angles in enumerate(poses.angles):
        pose = (angles, poses.rotation[i], poses.translation[i])
        s = with_contacts(model, loaded(model, poses.joints[i], np.ones(21), *pose, twist))
        g, h = np.zeros(26), np.zeros((26, 26))
        total = weigh(s, g, h)
        np.testing.assert_allclose(total, penalty(model, angles[None], twist)[0], rtol=1e-9)
        step = 1e-6 * np.eye(20)
        ends = [penalty(model, angles + d, twist) for d in (step, -step)]
        numeric = (ends[0] - ends[1]) / 2e-6 / 2
        np.testing.assert_allclose(g[:20], numeric, rtol=2e-4, atol=1e-7)
        # positive semidefinite, and the gradient's directions: sums of outer products
        assert np.linalg.eigvalsh(h).min() > -1e-12
        touching += total > 0
    assert touching > 15


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("method", ["newton", "bcd"])
def test_fists_do_not_sink_into_themselves(hand, method):
    model = HandModel.default(hand)
    pairs, rng = contacts(model), np.random.default_rng(2)
    before, after, errors = [], [], []
    fists = model.limits.clamp(FIST + rng.normal(0, [0.15, 0.06, 0.15, 0.15] * 5, (3000, 20)))
    fists = fists[contact_depths(model.joints(fists), pairs).max(1) < 3e-4]
    for angles in fists[:30]:
        truth = model.joints(angles)
        joints = truth + rng.normal(0, 0.005, (21, 3))
        free = ht.fit(model, joints, method=method)
        apart = ht.fit(model, joints, method=method, collisions=True)
        assert model.limits.contains(apart.angles, 1e-9)
        assert apart.status == free.status
        depths = [contact_depths(f.joints[None], pairs)[0] for f in (free, apart)]
        sums = [
            f.objective + collisions.HARD * np.square(np.maximum(d, 0)).sum()
            for f, d in zip((free, apart), depths, strict=True)
        ]
        assert sums[1] <= sums[0]
        assert apart.objective >= free.objective * (1 - 1e-4)
        np.testing.assert_allclose(
            apart.objective, np.square(apart.joints - joints).sum(), rtol=1e-9
        )
        before.append(max(depths[0].max(), 0))
        after.append(max(depths[1].max(), 0))
        errors.append([np.linalg.norm(f.joints - truth, axis=1).mean() for f in (free, apart)])
    assert np.mean(before) > 0.002
    assert np.mean(after) < 0.1 * np.mean(before)
    # what keeps apart what is apart is nearer to the truth
    assert len(errors) == 30
    assert np.mean(errors, 0)[1] < np.mean(errors, 0)[0]


def test_hands_that_touch_nothing_are_fitted_as_ever(sample):
    model = ht.calibrate(HandModel.default("right"), sample).model
    free, apart = (ht.track(sample, model, calibrate=False, collisions=c) for c in (False, True))
    depths = contact_depths(free.fitted_joints, contacts(model)).max(1)
    clear = (depths < 0) | (free.status == "lost")
    assert clear.mean() > 0.3
    # a warm start from elsewhere ends in the same place, to the tolerance
    np.testing.assert_allclose(apart.fitted_joints[clear], free.fitted_joints[clear], atol=2e-4)
    kept = contact_depths(apart.fitted_joints[~clear], contacts(model)).max(1)
    assert kept.max() < 0.25 * depths[~clear].max()
    one = ht.fit(model, sample.truth[0]), ht.fit(model, sample.truth[0], collisions=True)
    if clear[0]:
        np.testing.assert_array_equal(one[0].angles, one[1].angles)


def test_bones_that_cross_come_apart():
    """Index and middle finger exactly in one place."""
    model = HandModel.default("right")
    joints = model.joints(np.zeros(20))
    joints[[10, 11, 12]] = joints[[6, 7, 8]]
    found = ht.fit(model, joints, collisions=True)
    assert np.isfinite(found.angles).all()
    assert contact_depths(found.joints[None], contacts(model)).max() < 0.002


def test_fingers_that_nothing_shows_may_be_pushed_but_not_away():
    model = HandModel.default("right")
    joints = model.joints(FIST)
    joints[[14, 15, 16]] = np.nan
    found = ht.fit(model, joints, start=FIST, collisions=True)
    assert np.isfinite(found.angles).all()
    assert model.limits.contains(found.angles, 1e-9)
    assert contact_depths(found.joints[None], contacts(model)).max() < 0.001
