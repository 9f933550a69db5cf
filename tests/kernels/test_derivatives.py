"""Gradient and Hessians of the structured solver against finite differences of eq. 6."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kernel_cases import by_finger, derivatives, loaded, place  # first: it finds fit_cases

from fit_cases import N_POSE, SADDLES, forward, jacobian, moved_joints  # isort: skip
from scipy.spatial.transform import Rotation

from handtrack.hand.limits import PRESETS
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS
from handtrack.kernels import losses

TWISTS = (0.0, 0.3)
WHERE = ("inside", "at the limits", "at zero", "beyond")


def tilted(model: HandModel) -> HandModel:
    """The hand with axes that are neither perpendicular to each other nor to the bones."""
    rng = np.random.default_rng(8)
    axes = model.axes + rng.normal(0, 0.2, (20, 3))
    return replace(model, axes=axes / np.linalg.norm(axes, axis=1, keepdims=True))


def case(hand: str, where: str, seed: int) -> tuple:
    """A model, a pose and noisy joints with weights, some of them zero."""
    rng = np.random.default_rng(seed)
    model = tilted(HandModel.default(hand)) if seed % 2 else HandModel.default(hand)
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper))
    if where == "at the limits":
        angles = np.where(rng.random(20) < 0.5, limits.lower, limits.upper)
        angles[SADDLES[:, 1]] = 0.0
        angles[SADDLES[2]] = limits.clamp(angles + 0.4)[SADDLES[2]]
    elif where == "at zero":
        angles = np.zeros(20)
    elif where == "beyond":
        angles = rng.uniform(-3.0, 3.0, 20)
    rotation = Rotation.random(rng=rng).as_matrix()
    translation = rng.normal(size=3)
    joints = model.joints(angles, rotation, translation) + rng.normal(0, 0.01, (21, 3))
    weights = rng.uniform(0.2, 2.0, 21)
    weights[rng.choice(21, 5, replace=False)] = 0.0
    return model, angles, rotation, translation, joints, weights


def half_objective(twist: float, case: tuple, steps: np.ndarray) -> np.ndarray:
    model, angles, rotation, translation, joints, weights = case
    placed = moved_joints(model, angles, rotation, translation, steps, twist)
    return 0.5 * (weights * np.square(placed - joints).sum(-1)).sum(-1)


def gradient_by_differences(value, h: float = 1e-5) -> np.ndarray:
    steps = h * np.eye(N_POSE)
    # fourth order, so that what is left is rounding
    return (8 * (value(steps) - value(-steps)) - value(2 * steps) + value(-2 * steps)) / (12 * h)


def hessian_by_differences(value, h: float = 3e-4) -> np.ndarray:
    i, j = (x.ravel() for x in np.meshgrid(range(N_POSE), range(N_POSE), indexing="ij"))
    a, b = h * np.eye(N_POSE)[i], h * np.eye(N_POSE)[j]
    out = (value(a + b) - value(a - b) - value(b - a) + value(-a - b)) / (4 * h * h)
    return out.reshape(N_POSE, N_POSE)


@pytest.mark.parametrize("twist", TWISTS)
@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("where", WHERE)
def test_gradient_and_exact_hessian(hand, where, twist):
    for seed in range(4):
        c = case(hand, where, seed)
        model, angles, rotation, translation, joints, weights = c
        s = loaded(model, joints, weights, angles, rotation, translation, twist)
        value, g, h = derivatives(s, 1.0)
        zero = np.zeros((1, N_POSE))
        assert value == pytest.approx(half_objective(twist, c, zero)[0], rel=1e-11, abs=0)
        numeric = gradient_by_differences(lambda d, c=c: half_objective(twist, c, d))
        assert np.abs(g - numeric).max() < 1e-9
        assert np.abs(g).max() > 1e-4
        numeric = hessian_by_differences(lambda d, c=c: half_objective(twist, c, d))
        assert np.abs(h - numeric).max() < 1e-6 * np.abs(h).max()
        # what the second-order terms add is far more than that
        _, _, gauss = derivatives(s, 0.0)
        assert np.abs(h - gauss).max() > 1e-4 * np.abs(h).max()


@pytest.mark.parametrize("twist", TWISTS)
@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("where", WHERE)
def test_gauss_newton_is_the_jacobians_square(hand, where, twist):
    for seed in range(4):
        model, angles, rotation, translation, joints, weights = case(hand, where, seed)
        s = loaded(model, joints, weights, angles, rotation, translation, twist)
        _, g, h = derivatives(s, 0.0)
        j = jacobian(model, angles, rotation, translation, twist)
        w = np.repeat(weights, 3)
        assert np.abs(h - j.T @ (w[:, None] * j)).max() < 1e-9 * np.abs(h).max() + 1e-12
        residual = moved_joints(model, angles, rotation, translation, np.zeros((1, 26)), twist)
        assert np.abs(g - j.T @ (w * (residual[0] - joints).ravel())).max() < 1e-10
        # the diagonal that pivots are measured by
        diagonal = by_finger(s[0]["diagonal"])
        assert np.allclose(diagonal, np.diagonal(h)[:20], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("limits", PRESETS)
def test_kinematics_of_the_workspace_are_the_models(limits):
    # without a twist the objective is that of HandModel.joints
    model = HandModel.default("right", limits)
    rng = np.random.default_rng(3)
    for _ in range(50):
        angles = rng.uniform(-np.pi, np.pi, 20)
        joints, weights = rng.normal(size=(21, 3)), rng.uniform(0, 1, 21)
        rotation, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
        s = loaded(model, joints, weights, angles, rotation, shift)
        placed = model.joints(angles, rotation, shift)
        assert np.allclose(forward(model, angles[None])[0] @ rotation.T + shift, placed, atol=1e-13)
        expected = (weights * np.square(placed - joints).sum(-1)).sum()
        assert place(s) == pytest.approx(expected, rel=1e-12, abs=0)


@pytest.mark.parametrize("hand", HANDS)
def test_the_thumbs_twist_is_the_models(hand):
    model = replace(HandModel.default(hand), thumb_twist=0.4)
    angles = np.random.default_rng(4).uniform(-1, 1, (20, 20))
    assert np.allclose(model.joints(angles), forward(model, angles, 0.4), rtol=0, atol=1e-14)
    assert np.abs(model.joints(angles) - forward(model, angles)).max() > 1e-3


def test_targets_without_weight_are_not_read():
    model, angles, rotation, translation, joints, weights = case("right", "inside", 0)
    s = loaded(model, joints, weights, angles, rotation, translation)
    expected = derivatives(s, 1.0)
    joints[weights == 0] = 1e6
    s = loaded(model, joints, weights, angles, rotation, translation)
    found = derivatives(s, 1.0)
    for a, b in zip(expected, found, strict=True):
        assert np.array_equal(a, b)


def softened(q: np.ndarray, loss: str, spread: float) -> np.ndarray:
    if loss == "HUBER":
        return np.where(q > spread**2, 2 * spread * np.sqrt(q) - spread**2, q)
    return q * spread**2 / (q + spread**2)


@pytest.mark.parametrize("loss", ["HUBER", "GEMAN_MCCLURE"])
@pytest.mark.parametrize("seed", range(3))
def test_objective_and_gradient_of_robust_losses(loss, seed):
    spread = 0.012
    model, angles, rotation, translation, joints, weights = case("left", "inside", seed)
    joints[[2, 9, 20]] += 0.08
    weights[[2, 9, 20]] = 1.0
    s = loaded(model, joints, weights, angles, rotation, translation, 0.3)
    s["loss"], s["spread2"] = getattr(losses, loss), spread**2

    def half(steps: np.ndarray) -> np.ndarray:
        placed = moved_joints(model, angles, rotation, translation, steps, 0.3)
        q = np.square(placed - joints).sum(-1)
        assert (q[0] > spread**2).any()
        return 0.5 * (weights * softened(q, loss, spread)).sum(-1)

    value, g, _ = derivatives(s, 0.0)
    assert value == pytest.approx(half(np.zeros((1, N_POSE)))[0], rel=1e-11, abs=0)
    assert np.abs(g - gradient_by_differences(half)).max() < 1e-9
