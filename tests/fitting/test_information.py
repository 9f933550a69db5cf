"""The dense gradient and Hessian of a frame against finite differences."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.fitting.compiled import call, kernel
from handtrack.fitting.information import HESSIAN, information
from handtrack.fitting.lanes import (
    FULL,
    GRADIENT,
    OBJECTIVE,
    SIZE,
    load_frame,
    load_model,
    load_pose,
)
from handtrack.hand.rotations import vector_to_matrix

MODEL = ht.HandModel.default("left")


@kernel
def evaluate(s, model, solver, targets, weights, angles, root):
    """Gradient and Hessian of a frame at a pose, in the buffer."""
    load_model(s, model[0], model[1], model[2], model[3], model[4])
    load_frame(s, targets, weights, 1.0)
    load_pose(s, angles, root)
    s[FULL] = 1.0
    call(solver, s)


def moved(pose: np.ndarray, d: np.ndarray) -> np.ndarray:
    """A pose (32,) moved by d (26,): angles, a turn of the world on the left, shift."""
    turn = vector_to_matrix(d[20:23]) @ pose[20:29].reshape(3, 3)
    return np.concatenate([pose[:20] + d[:20], turn.ravel(), pose[29:] + d[23:]])


def placed(pose: np.ndarray) -> np.ndarray:
    return MODEL.joints(pose[:20], pose[20:29].reshape(3, 3), pose[29:])


@pytest.mark.parametrize("seed", range(3))
def test_gradient_and_hessian_are_the_differences(seed):
    rng = np.random.default_rng(seed)
    angles = MODEL.limits.clamp(rng.uniform(MODEL.limits.lower, MODEL.limits.upper))
    rotation = vector_to_matrix(rng.normal(0, 1.5, 3))
    pose = np.concatenate([angles, rotation.ravel(), rng.normal(0, 0.3, 3)])
    targets = placed(pose) + rng.normal(0, 0.01, (21, 3))
    weights = rng.uniform(0, 1, 21)
    weights[rng.choice(21, 3, replace=False)] = 0.0
    s = np.zeros(SIZE)
    limits = MODEL.limits
    model = (MODEL.rest_joints, MODEL.axes, limits.lower, limits.upper, MODEL.thumb_twist)
    evaluate(s, model, information.address, targets, weights, pose[:20], pose[20:])

    def residual(d: np.ndarray) -> np.ndarray:
        off = placed(moved(pose, d)) - targets
        return (np.sqrt(weights)[:, None] * off).ravel()

    r = residual(np.zeros(26))
    h = 1e-6
    steps = h * np.eye(26)
    jacobian = np.stack([(residual(d) - residual(-d)) / (2 * h) for d in steps], 1)
    assert s[OBJECTIVE] == pytest.approx(r @ r, rel=1e-12)
    np.testing.assert_allclose(s[GRADIENT : GRADIENT + 26], jacobian.T @ r, atol=1e-9)
    hessian = s[HESSIAN : HESSIAN + 676].reshape(26, 26)
    np.testing.assert_allclose(hessian, jacobian.T @ jacobian, atol=1e-8)
