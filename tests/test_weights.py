"""Weights between 0 and 1 and above, in a world turned far: fits against weighted least squares."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import handtrack as ht
from handtrack.cameras.camera import Camera
from handtrack.cameras.triangulate import triangulate
from handtrack.fitting.images import fit_2d
from handtrack.hand.limits import Limits
from handtrack.hand.rotations import vector_to_matrix

sys.path.append(str(Path(__file__).resolve().parent / "cameras"))
from rigs import rig

TURN = vector_to_matrix(np.array([1.9, -1.1, 0.8]))
SHIFT = np.array([0.7, -1.3, 2.1])
OPEN = Limits("wide open", np.full(20, -2.0), np.full(20, 2.0))


def moved(camera: Camera) -> Camera:
    """The camera in a world that is turned and shifted: it sees x' = TURN x + SHIFT as it saw x."""
    rotation = camera.rotation @ TURN.T
    return Camera(
        camera.name,
        camera.matrix,
        camera.distortion,
        rotation,
        camera.translation - rotation @ SHIFT,
        camera.size,
    )


def test_triangulation_is_weighted_least_squares():
    rng = np.random.default_rng(5)
    cameras = [moved(c) for c in rig(4)]
    points = rng.uniform(-0.1, 0.1, (20, 3)) @ TURN.T + SHIFT
    pixels = np.stack([c.project(points) for c in cameras]) + rng.normal(0, 2.0, (4, 20, 2))
    weights = rng.uniform(0.05, 3.0, (4, 20))
    found, agree = triangulate(cameras, pixels, weights, cauchy_px=np.inf)
    assert agree.all()
    rays = np.stack([c.undistorted(p) for c, p in zip(cameras, pixels, strict=True)])
    for i in range(20):

        def rows(x: np.ndarray, i: int = i) -> np.ndarray:
            local = [c.rotation @ x + c.translation for c in cameras]
            return np.concatenate(
                [
                    np.sqrt(weights[c, i]) * (rays[c, i] * local[c][2] - local[c][:2])
                    for c in range(4)
                ]
            )

        best = least_squares(rows, points[i], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        np.testing.assert_allclose(found[i], best, rtol=0, atol=1e-8)
    assert np.abs(found - triangulate(cameras, pixels, cauchy_px=np.inf)[0]).max() > 1e-5


def test_an_image_fit_is_weighted_least_squares_with_its_covariance():
    rng = np.random.default_rng(8)
    model = ht.HandModel.default("left").with_limits(OPEN)
    angles = model.mean_angles + rng.normal(0, 0.1, 20)
    joints = model.joints(angles, TURN)
    translation = SHIFT - joints.mean(0)
    cameras = [moved(c) for c in rig(3)]
    true = model.joints(angles, TURN, translation)
    pixels = np.stack([c.project(true) for c in cameras]) + rng.normal(0, 0.5, (3, 21, 2))
    weights = rng.uniform(0.1, 2.5, (3, 21))
    found = fit_2d(model, pixels, cameras, weights, spread_px=0.0)
    root = np.sqrt(weights)[..., None]

    def rows(x: np.ndarray) -> np.ndarray:
        turned = vector_to_matrix(x[20:23]) @ found.rotation  # a small turn in the world
        placed = model.joints(found.angles + x[:20], turned, found.translation + x[23:])
        return (root * (np.stack([c.project(placed) for c in cameras]) - pixels)).ravel()

    best = least_squares(rows, np.zeros(26), x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert found.objective == pytest.approx(np.square(rows(np.zeros(26))).sum(), rel=1e-8)
    assert found.objective == pytest.approx(2 * best.cost, rel=1e-4)
    steps = 1e-6 * np.eye(26)
    j = np.stack([(rows(d) - rows(-d)) / 2e-6 for d in steps], axis=1)
    expected = np.linalg.inv(j.T @ j) * found.objective / (2 * 63 - 26)
    s = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(
        found.covariance / np.outer(s, s), expected / np.outer(s, s), rtol=0, atol=0.02
    )


def test_a_weight_of_two_is_a_point_seen_twice():
    rng = np.random.default_rng(2)
    model = ht.HandModel.default("right")
    true = model.joints(0.9 * model.mean_angles, TURN, SHIFT)
    cameras = [moved(c) for c in rig(2)]
    pixels = np.stack([c.project(true) for c in cameras]) + rng.normal(0, 1.0, (2, 21, 2))
    twice = fit_2d(model, pixels[[0, 1, 1]], [cameras[i] for i in (0, 1, 1)])
    weighted = fit_2d(model, pixels, cameras, np.array([1.0, 2.0])[:, None] * np.ones((2, 21)))
    np.testing.assert_allclose(weighted.joints, twice.joints, rtol=0, atol=1e-6)
