"""The objective of pictures, its gradient and Hessian against finite differences."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kernel_cases import loaded
from numba import njit

import handtrack as ht
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import HANDS
from handtrack.kernels import pixel_objective

from fit_cases import moved_joints  # isort: skip

sys.path.append(str(Path(__file__).resolve().parents[1] / "cameras"))
from rigs import rig


@njit
def weigh(works, seen):
    return pixel_objective.weigh_pixels(works[0], seen)


@njit
def differentiate(works, seen, g, h):
    pixel_objective.differentiate_pixels(works[0], seen, g, h)


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("spread", [0.0, 2.0])
def test_objective_gradient_and_hessian(hand, spread):
    model = replace(ht.HandModel.default(hand), thumb_twist=0.4)
    rng = np.random.default_rng(3)
    angles = model.limits.clamp(0.7 * rng.uniform(model.limits.lower, model.limits.upper))
    rotation = vector_to_matrix(rng.normal(0, 1.0, 3))
    translation = rng.uniform(-0.03, 0.03, 3) - model.joints(angles, rotation).mean(0)
    cameras = rig(2)
    numbers = np.stack([c.lens for c in cameras]).view(np.recarray)
    joints = model.joints(angles, rotation, translation)
    shown = np.stack([c.project(joints) for c in cameras]) + rng.normal(0, 3, (2, 21, 2))
    w = rng.uniform(0.2, 1, (2, 21))
    w[0, 5] = 0.0
    prior, stiffness = np.zeros(20), np.full(20, 3.0)

    def residuals(step: np.ndarray) -> np.ndarray:
        """(2, 21, 2) of the pictures, by other code."""
        x = moved_joints(model, angles, rotation, translation, step[None], 0.4)[0]
        return np.stack([c.project(x) for c in cameras]) - shown

    def half(step: np.ndarray) -> float:
        q = np.square(residuals(step)).sum(-1)
        if spread:
            q = np.where(q > spread**2, 2 * spread * np.sqrt(q) - spread**2, q)
        away = angles + step[:20] - prior
        return 0.5 * float((w * q).sum() + (stiffness * away**2).sum())

    works = loaded(model, joints, np.ones(21), angles, rotation, translation, 0.4)
    seen = (numbers, shown, w, spread**2, prior, stiffness)
    zero = np.zeros(26)
    assert weigh(works, seen) == pytest.approx(2 * half(zero), rel=1e-11)
    g, h = np.empty(26), np.empty((26, 26))
    differentiate(works, seen, g, h)
    e = 1e-6
    numeric = [(half(e * row) - half(-e * row)) / (2 * e) for row in np.eye(26)]
    assert np.allclose(g, numeric, rtol=1e-5, atol=1e-4 * np.abs(g).max())
    # Gauss-Newton: the Jacobian's square, with the weights that the loss leaves
    q = np.square(residuals(zero)).sum(-1)
    left = w * (np.minimum(1.0, spread / np.sqrt(q)) if spread else 1.0)
    columns = [(residuals(e * row) - residuals(-e * row)) / (2 * e) for row in np.eye(26)]
    expected = np.einsum("ackx,ck,bckx->ab", columns, left, columns)
    expected[range(20), range(20)] += stiffness
    assert np.allclose(h, expected, rtol=1e-5, atol=1e-6 * np.abs(h).max())
    assert np.allclose(h, h.T)


def test_a_joint_behind_a_camera_costs_a_lot():
    model = ht.HandModel.default("right")
    cameras = rig(1)
    angles, rotation = model.mean_angles, np.eye(3)
    behind = cameras[0].centre - 0.3 * (np.zeros(3) - cameras[0].centre)
    works = loaded(model, model.joints(angles), np.ones(21), angles, rotation, behind)
    numbers = np.stack([c.lens for c in cameras]).view(np.recarray)
    seen = (numbers, np.zeros((1, 21, 2)), np.ones((1, 21)), 0.0, np.zeros(20), np.zeros(20))
    assert weigh(works, seen) == pytest.approx(21 * pixel_objective.BEHIND)
    g, h = np.empty(26), np.empty((26, 26))
    differentiate(works, seen, g, h)
    assert not g.any()
    assert not h.any()
