"""The dense gradient and Hessian of a frame against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import loaded
from numba import njit

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from handtrack.kernels.compiled import call
from handtrack.kernels.pose_information import information

MODEL = HandModel.default("left")


@njit
def evaluate(works, solver):
    """Gradient and Hessian of a frame at a pose, in the workspace."""
    works[0].full = 1
    call(solver, works[0])


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
    works = loaded(MODEL, targets, weights, angles, rotation, pose[29:])
    evaluate(works, information.address)
    w = works[0]

    def residual(d: np.ndarray) -> np.ndarray:
        off = placed(moved(pose, d)) - targets
        return (np.sqrt(weights)[:, None] * off).ravel()

    r = residual(np.zeros(26))
    h = 1e-6
    steps = h * np.eye(26)
    jacobian = np.stack([(residual(d) - residual(-d)) / (2 * h) for d in steps], 1)
    assert w["objective"] == pytest.approx(r @ r, rel=1e-12)
    np.testing.assert_allclose(w["gradient"], jacobian.T @ r, atol=1e-9)
    np.testing.assert_allclose(w["information"], jacobian.T @ jacobian, atol=1e-8)
