"""GDC and MLP: gradients, poses found again, left hands, what they refuse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handtrack.errors import InputError, SettingsError
from handtrack.evaluation.metrics import pa_mpjpe
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from tools.paper import baselines, free_pose, mlp
from tools.paper.mlp import WEIGHTS, predict


@pytest.fixture(scope="module")
def model():
    return HandModel.default()


def poses(model, n, seed=0):
    """(n, 21, 3) joints of random valid poses, and their angles."""
    rng = np.random.default_rng(seed)
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper, (n, 20)))
    turns = Rotation.random(n, random_state=seed).as_matrix()
    return model.joints(angles, turns, rng.normal(0, 0.3, (n, 3))), angles, turns


def test_free_kinematics_are_the_models(model):
    joints, angles, turns = poses(model, 5)
    rng = np.random.default_rng(0)
    rng.uniform(model.limits.lower, model.limits.upper, (5, 20))
    place = rng.normal(0, 0.3, (5, 3))
    local = model.local_rotations(model.rotations(angles))
    fit = free_pose.free_fit(model, joints, local, turns, place)
    np.testing.assert_allclose(fit.joints, joints, atol=1e-12)
    np.testing.assert_allclose(fit.angles, angles, atol=1e-7)
    assert fit.objective.max() < 1e-20
    np.testing.assert_allclose(
        fit.vertices(model), model.vertices(angles, turns, place), atol=1e-12
    )


def test_gradient_against_differences(model):
    rng = np.random.default_rng(1)
    vectors = rng.normal(0, 0.5, (3, 15, 3))
    vectors[0, 0] = 0  # where the Jacobian is a limit
    turns = Rotation.random(3, random_state=2).as_matrix()
    place, target = rng.normal(0, 0.1, (3, 3)), rng.normal(0, 0.1, (3, 21, 3))

    def joints(v, r, t):
        return free_pose.joints_of(model, *free_pose.accumulated(model, vector_to_matrix(v), r, t))

    def cost(v, r, t):
        return ((joints(v, r, t) - target) ** 2).sum((1, 2))

    parts = free_pose.accumulated(model, vector_to_matrix(vectors), turns, place)
    x = free_pose.joints_of(model, *parts)
    by_vector, by_turn, by_place = free_pose.gradient(vectors, *parts, x, 2 * (x - target), place)
    h = 1e-6
    for part in range(15):
        for axis in range(3):
            d = np.zeros((15, 3))
            d[part, axis] = h
            slope = (cost(vectors + d, turns, place) - cost(vectors - d, turns, place)) / (2 * h)
            np.testing.assert_allclose(by_vector[:, part, axis], slope, atol=1e-8)
    for axis in range(3):
        d = np.eye(3)[axis] * h
        there, back = (vector_to_matrix(s * d) @ turns for s in (1, -1))
        slope = (cost(vectors, there, place) - cost(vectors, back, place)) / (2 * h)
        np.testing.assert_allclose(by_turn[:, axis], slope, atol=1e-8)
        slope = (cost(vectors, turns, place + d) - cost(vectors, turns, place - d)) / (2 * h)
        np.testing.assert_allclose(by_place[:, axis], slope, atol=1e-8)


@pytest.mark.parametrize(("method", "within_mm"), [("gdc", 0.6), ("gdc-pca", 1.6), ("mlp", 9.0)])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_clean_poses_are_found_again(method, within_mm, hand):
    model = HandModel.default(hand)
    joints, _, _ = poses(model, 40, seed=3)
    found = baselines.fit_batch(model, joints, method)
    assert 1e3 * pa_mpjpe(found.joints, joints).mean() < within_mm
    # a hand left at rest is far worse, and so is one fitted as the other hand
    rest = np.broadcast_to(model.joints(model.mean_angles), joints.shape)
    assert 1e3 * pa_mpjpe(rest, joints).mean() > 2 * within_mm
    assert set(found.status) == {"iteration limit"}
    assert np.isinf(found.variance).all()
    one = baselines.fit(model, joints[7], method)
    np.testing.assert_allclose(one.joints, found.joints[7], atol=1e-9)
    np.testing.assert_allclose(one.angles, found.angles[7], atol=1e-7)
    np.testing.assert_allclose(np.linalg.det(found.local.reshape(-1, 3, 3)), 1.0, atol=1e-9)


def test_the_network_sees_no_place_no_size_and_no_side(model):
    joints, _, _ = poses(model, 6, seed=4)
    found = predict(model, joints)
    moved = predict(model, 1.7 * joints + 0.4)
    np.testing.assert_allclose(moved.local, found.local, atol=1e-9)
    mirrored = predict(HandModel.default("left"), joints * [1, 1, -1])
    np.testing.assert_allclose(mirrored.angles, found.angles, atol=1e-6)
    turn = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
    turned = predict(model, joints @ turn.T)
    assert 1e3 * pa_mpjpe(turned.joints, found.joints).mean() < 8  # learned, not built in


def test_the_weights_are_small():
    assert Path(mlp.__file__).with_name(WEIGHTS).stat().st_size < 500_000


def test_missing_joints(model):
    joints, _, _ = poses(model, 4)
    holes = joints.copy()
    holes[1, [0, 8, 15]] = np.nan  # the wrist, a tip and a middle joint
    holes[2, [0, 1, 5, 9]] = np.nan  # too little of the palm
    found = baselines.fit_batch(model, holes, "gdc")
    assert found.status.tolist() == [*["iteration limit"] * 2, "missing", "iteration limit"]
    assert np.isnan(found.joints[2]).all()
    error = 1e3 * np.linalg.norm(found.joints - joints, axis=-1)
    assert error[[0, 3]].max() < 2
    assert np.delete(error[1], [0, 8, 15]).max() < 2
    assert found.objective[1] < 21 * 0.002**2
    found = baselines.fit_batch(model, holes, "mlp")
    assert found.status.tolist() == ["iteration limit", "missing", "missing", "iteration limit"]
    for method, needed in (("gdc", "three of the palm's"), ("mlp", "all 21")):
        with pytest.raises(InputError, match=f"{method} needs {needed}"):
            baselines.fit(model, holes[2], method)


def test_bad_arguments(model):
    with pytest.raises(SettingsError, match="'adam' is unknown, expected gdc, gdc-pca, mlp"):
        baselines.fit_batch(model, np.zeros((1, 21, 3)), "adam")
    with pytest.raises(InputError, match=r"shape \(21, 2\), expected \(21, 3\)"):
        baselines.fit(model, np.zeros((21, 2)))
