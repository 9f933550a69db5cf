"""The paper's own updates: Euler angles of a Procrustes rotation, moved onto the ellipse."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import euler_zy, hinge_li2021, nearest_on_ellipse, rows, saddle_li2021, vector
from scipy.spatial.transform import Rotation

from fit_cases import SADDLES, distances, ellipse_value, some_poses  # isort: skip

from handtrack.fitting.fit import fit
from handtrack.hand.limits import PRESETS
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS


def perpendicular_axes(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    x = Rotation.random(rng=rng).as_matrix()
    return x[2], x[1]


def turned(nz, ny, z, y, points) -> np.ndarray:
    return (Rotation.from_rotvec(nz * z) * Rotation.from_rotvec(ny * y)).apply(points)


def test_euler_angles_of_a_saddle_rotation():
    rng = np.random.default_rng(0)
    for _ in range(300):
        nz, ny = perpendicular_axes(rng)
        z, y = rng.uniform(-3.1, 3.1), rng.uniform(-1.57, 1.57)
        r = (Rotation.from_rotvec(nz * z) * Rotation.from_rotvec(ny * y)).as_matrix()
        assert euler_zy(rows(r), vector(nz), vector(ny)) == pytest.approx((z, y), abs=1e-6)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("f", range(5))
def test_a_clean_saddle_gets_its_angles_or_the_nearest_of_the_ellipse(preset, f):
    limits = PRESETS[preset]
    rng = np.random.default_rng(f)
    low, high = limits.lower[SADDLES[f]], limits.upper[SADDLES[f]]
    inside = outside = 0
    for _ in range(100):
        nz, ny = perpendicular_axes(rng)
        a = rng.normal(0, 0.03, (3, 3))
        w = rng.uniform(0.1, 1, 3)
        truth = rng.uniform(1.3 * low, 1.3 * high)
        t = turned(nz, ny, *truth, a)
        bounds = (low[0], high[0], low[1], high[1])
        found = saddle_li2021(vector(nz), vector(ny), tuple(w), rows(t), rows(a), 0.0, 0.0, bounds)
        star = np.where(truth < 0, -low, high)
        if np.square(truth / star).sum() <= 1:
            inside += 1
            assert found == pytest.approx(truth, abs=1e-6)
        else:
            outside += 1
            assert found == pytest.approx(nearest_on_ellipse(truth, star), abs=1e-6)
            assert np.square(np.array(found) / star).sum() <= 1 + 1e-15
    assert min(inside, outside) > 10


def test_a_clean_hinge_gets_its_angle_clamped():
    rng = np.random.default_rng(1)
    for _ in range(200):
        n = perpendicular_axes(rng)[0]
        a = rng.normal(0, 0.03, (2, 3))
        a -= np.outer(a @ n, n)  # bones lie across their hinge
        angle = rng.uniform(-1.5, 2.5)
        t = Rotation.from_rotvec(n * angle).apply(a)
        found = hinge_li2021(vector(n), (1.0, 0.5), rows(t), rows(a), -0.2, 1.6, 0.0)
        assert found == pytest.approx(min(max(angle, -0.2), 1.6), abs=1e-6)


@pytest.mark.parametrize("hand", HANDS)
def test_clean_poses_are_mostly_met(hand):
    model = HandModel.default(hand, "li2021")
    poses = some_poses(model, 60, seed=2, margin=0.1)
    off, wrong = [], []
    for i, joints in enumerate(poses.joints):
        found = fit(model, joints, update="li2021", tolerance=1e-9)
        assert found.steps == 0
        off.append(distances(found.joints, joints).max())
        wrong.append(np.abs(found.angles - poses.angles[i]).max())
    assert np.median(off) < 1e-6
    assert np.median(wrong) < 1e-4
    # projections can stop a fit early, which is why there are exact updates
    assert np.mean(np.array(off) < 1e-3) > 0.9


@pytest.mark.parametrize("preset", PRESETS)
def test_the_papers_fit_keeps_the_limits_and_is_never_better_than_the_exact(preset):
    model = HandModel.default("right", preset)
    for joints in some_poses(model, 60, 0.005, seed=3).joints:
        paper = fit(model, joints, update="li2021")
        assert ellipse_value(model.limits, paper.angles).max() <= 1 + 1e-15
        assert model.limits.contains(paper.angles, tolerance=1e-15)
        exact = fit(model, joints, start=paper, tolerance=1e-9)
        assert exact.objective <= paper.objective


def test_the_best_pose_seen_is_kept():
    # its sweeps can raise the objective; more of them never give a worse result
    model = HandModel.default("right", "li2021")
    worse = 0
    for joints in some_poses(model, 30, 0.01, seed=4).joints:
        last = np.inf
        for sweeps in (1, 2, 3, 5, 8, 13, 200):
            found = fit(model, joints, update="li2021", max_sweeps=sweeps)
            assert found.objective <= last
            worse += found.sweeps < sweeps
            last = found.objective
    assert worse > 0
