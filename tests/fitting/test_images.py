"""Fitting to pictures: truth recovered, derivatives, limits, one camera, real stereo pictures."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from handtrack.fitting.images import ViewResults, fit_2d
from handtrack.hand.rotations import vector_to_matrix

sys.path.append(str(Path(__file__).resolve().parents[1] / "cameras"))
from rigs import rig

HANDS = ("left", "right")


def pose(hand: str, seed: int, reach: float = 0.7):
    """A model, and angles inside its limits with a root near the origin."""
    model = ht.HandModel.default(hand)
    rng = np.random.default_rng(seed)
    lower, upper = model.limits.lower, model.limits.upper
    angles = model.limits.clamp(reach * rng.uniform(lower, upper))
    rotation = vector_to_matrix(rng.normal(0, 1.0, 3))
    middle = model.joints(angles, rotation).mean(0)
    return model, angles, rotation, rng.uniform(-0.03, 0.03, 3) - middle


def pictures(cameras, joints):
    return np.stack([c.project(joints) for c in cameras])


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("seed", range(5))
def test_several_cameras_give_the_true_pose(hand, seed):
    model, angles, rotation, translation = pose(hand, seed)
    joints = model.joints(angles, rotation, translation)
    cameras = rig(3)
    fit = fit_2d(model, pictures(cameras, joints), cameras)
    assert fit.status == "converged"
    assert np.abs(fit.joints - joints).max() < 1e-6
    assert np.abs(fit.angles - angles).max() < 1e-3
    assert np.nanmax(fit.reprojection) < 1e-3
    assert np.allclose(model.joints(fit.angles, fit.rotation, fit.translation), fit.joints)


def test_a_joint_that_one_camera_sees_counts_and_one_bad_view_does_not():
    model, angles, rotation, translation = pose("right", 1)
    joints = model.joints(angles, rotation, translation)
    cameras = rig(3)
    seen = pictures(cameras, joints)
    seen[1:, [8, 12]] = np.nan
    fit = fit_2d(model, seen, cameras)
    assert np.abs(fit.joints - joints).max() < 1e-5
    seen[2, 16] += 150.0
    robust = fit_2d(model, seen, cameras)
    squares = fit_2d(model, seen, cameras, spread_px=0.0)
    error = np.linalg.norm(robust.joints - joints, axis=1)
    # a bad view still pulls like one that is 10 px off
    assert error.max() < 4e-3
    assert error.max() < 0.3 * np.linalg.norm(squares.joints - joints, axis=1).max()


@pytest.mark.parametrize("seed", range(4))
def test_one_camera_follows_from_a_good_start(seed):
    """What one camera sees fixes the pose near a start that is nearly right."""
    model, angles, rotation, translation = pose("right", seed, 0.5)
    joints = model.joints(angles, rotation, translation)
    cameras = rig(1, lens=[])
    before = model.limits.clamp(angles + np.random.default_rng(seed).normal(0, 0.05, 20))
    shifted = translation + np.array([0.004, -0.003, 0.006])
    start = ht.fit(model, model.joints(before, rotation, shifted))
    fit = fit_2d(model, pictures(cameras, joints), cameras, start=start)
    assert fit.status == "converged"
    assert np.nanmax(fit.reprojection) < 1.0
    assert np.linalg.norm(fit.joints - joints, axis=1).mean() < 6e-3


def test_one_camera_sees_the_distance_by_the_hands_size():
    model, angles, rotation, translation = pose("right", 2, 0.4)
    joints = model.joints(angles, rotation, translation)
    cameras = rig(1, lens=[])
    larger = model.scaled(1.1)
    fit = fit_2d(larger, pictures(cameras, joints), cameras, start=angles)
    far = np.linalg.norm(fit.joints.mean(0) - cameras[0].centre)
    assert far == pytest.approx(1.1 * np.linalg.norm(joints.mean(0) - cameras[0].centre), rel=0.01)


def test_limits_hold_and_a_start_outside_is_moved_in():
    model, _, rotation, translation = pose("right", 4)
    beyond = 1.4 * model.limits.upper
    cameras = rig(3)
    joints = model.joints(beyond, rotation, translation)
    fit = fit_2d(model, pictures(cameras, joints), cameras, start=3 * beyond)
    assert model.limits.contains(fit.angles)
    # a limit that holds an angle leaves it no variance
    assert fit.variance.min() >= 0
    assert (fit.variance == 0).any()
    # no valid step of any angle lowers the objective
    results = ViewResults(1)
    pixels = pictures(cameras, joints)
    root = np.concatenate([fit.rotation.ravel(), fit.translation])
    for i in range(20):
        for step in (-1e-3, 1e-3):
            angles = fit.angles.copy()
            angles[i] += step
            if not model.limits.contains(angles):
                continue
            results.run(model, cameras, pixels[None], np.ones((1, 3, 21)), angles[None], root[None])
            assert results.objective[0] >= fit.objective * (1 - 1e-4)


def test_the_stated_deviation_is_the_true_one():
    """Monte Carlo over 300 noisy pictures of one pose."""
    model, angles, rotation, translation = pose("right", 6, 0.3)
    cameras = rig(3)
    clean = pictures(cameras, model.joints(angles, rotation, translation))
    rng = np.random.default_rng(0)
    n = 300
    seen = clean + rng.normal(0, 1.0, (n, *clean.shape))
    results = ViewResults(n)
    root = np.concatenate([rotation.ravel(), translation])
    w = np.ones((n, 3, 21))
    results.run(model, cameras, seen, w, np.tile(angles, (n, 1)), np.tile(root, (n, 1)), 0.0)
    predicted = np.sqrt(np.mean([np.diagonal(c)[:20] for c in results.covariance], axis=0))
    at_limit = (np.abs(results.angles - model.limits.lower) < 1e-9).any(0)
    at_limit |= (np.abs(results.angles - model.limits.upper) < 1e-9).any(0)
    free = ~at_limit
    assert free.sum() > 8
    assert np.allclose(results.angles.std(0)[free], predicted[free], rtol=0.15)


def test_bad_input_is_refused():
    model, angles, rotation, translation = pose("right", 0)
    cameras = rig(2)
    seen = pictures(cameras, model.joints(angles, rotation, translation))
    few = np.full_like(seen, np.nan)
    few[0, :5] = seen[0, :5]
    for points, kw, error, says in (
        (seen[0], {}, InputError, "shape"),
        (seen[:1], {}, InputError, r"expected \(2, 21, 2\)"),
        (np.where(seen > 600, np.inf, seen), {}, InputError, "infinite"),
        (seen, {"weights": np.ones(21)}, InputError, "weights have shape"),
        (seen, {"weights": -np.ones((2, 21))}, InputError, "not negative"),
        (few, {}, InputError, "5 points are seen"),
        (seen, {"start": np.zeros(3)}, InputError, "start has shape"),
        (seen, {"spread_px": -1}, SettingsError, "spread_px"),
        (seen, {"prior_deg": np.nan}, SettingsError, "prior_deg"),
    ):
        with pytest.raises(error, match=says):
            fit_2d(model, points, cameras, **kw)
    with pytest.raises(SettingsError, match="no camera"):
        fit_2d(model, seen, [])
