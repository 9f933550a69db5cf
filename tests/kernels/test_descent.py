"""Every block of Algorithm 1 finds its best value, and so no sweep raises the objective."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_cases import (
    by_finger,
    hinge_exact,
    loaded,
    place,
    rows,
    saddle_exact,
    update_finger,
    update_finger_li2021,
    update_root,
    vector,
)
from scipy.spatial.transform import Rotation

from fit_cases import SADDLES, some_poses  # isort: skip

from handtrack.hand.limits import PRESETS
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS


def unit(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def gain(turns: Rotation, w, t, a) -> np.ndarray:
    """sum_i w_i t_i . R a_i: what a block maximises, for many rotations."""
    return sum(wi * turns.apply(ai) @ ti for wi, ti, ai in zip(w, t, a, strict=True))


# ---- hinge ----


@pytest.mark.parametrize("noise", [0.0, 0.02, 1.0])
def test_hinge_is_the_best_angle_inside_its_limits(noise):
    rng = np.random.default_rng(0)
    outside = 0
    for _ in range(200):
        n, w = unit(rng), rng.uniform(0, 2, 2)
        w[1] *= rng.random() < 0.7
        a = rng.normal(0, 0.04, (2, 3))
        angle = rng.uniform(-np.pi, np.pi)
        t = Rotation.from_rotvec(n * angle).apply(a) + noise * rng.normal(0, 0.04, (2, 3))
        lower, upper = np.sort(rng.uniform(-2.5, 2.5, 2))
        found = hinge_exact(vector(n), tuple(w), rows(t), rows(a), lower, upper, 0.1)
        assert lower <= found <= upper
        outside += found in (lower, upper)
        grid = np.linspace(lower, upper, 2001)
        best = gain(Rotation.from_rotvec(n * grid[:, None]), w, t, a)
        size = (w * np.linalg.norm(a, axis=1) * np.linalg.norm(t, axis=1)).sum()
        at = gain(Rotation.from_rotvec(n * found), w, t, a)
        assert at >= best.max() - 1e-14 * size
        if noise == 0 and lower < angle < upper:
            assert found == pytest.approx(angle, abs=1e-9)
    assert 30 < outside < 170


def test_a_hinge_outside_goes_to_the_bound_nearer_on_the_circle():
    z, x = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
    # 170 degrees lies nearer to -150 than to 90 on the circle, though not on the line
    t = vector((np.cos(np.deg2rad(170)), np.sin(np.deg2rad(170)), 0))
    lower, upper = np.deg2rad([-150.0, 90.0])
    assert hinge_exact(z, (1.0, 0.0), (t, t), (x, x), lower, upper, 0.0) == lower


def test_a_hinge_that_nothing_turns_stays():
    z, zero = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    assert hinge_exact(z, (1.0, 1.0), (z, z), (z, zero), -1.0, 1.0, 0.3) == 0.3


# ---- saddle ----


def ellipse_grid(limits, radii: int = 24, around: int = 120) -> np.ndarray:
    """(n, 2) points that fill a saddle's ellipse, its boundary included."""
    lz, uz, ly, uy = limits
    r, s = np.meshgrid(np.linspace(0, 1, radii), np.linspace(0, 2 * np.pi, around))
    c, n = (r * np.cos(s)).ravel(), (r * np.sin(s)).ravel()
    return np.stack([np.where(c < 0, -lz, uz) * c, np.where(n < 0, -ly, uy) * n], -1)


def saddle_turns(nz, ny, angles) -> Rotation:
    z, y = np.atleast_2d(angles).T
    return Rotation.from_rotvec(nz * z[:, None]) * Rotation.from_rotvec(ny * y[:, None])


@pytest.mark.parametrize("perpendicular", [True, False])
@pytest.mark.parametrize("noise", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("preset", PRESETS)
def test_saddle_is_the_best_pair_inside_its_ellipse(preset, noise, perpendicular):
    rng = np.random.default_rng(1)
    limits = PRESETS[preset]
    outside = 0
    for i in range(40):
        f = i % 5
        z, y = SADDLES[f]
        bounds = (limits.lower[z], limits.upper[z], limits.lower[y], limits.upper[y])
        grid = ellipse_grid(bounds)
        nz = unit(rng)
        ny = np.cross(nz, unit(rng))
        ny = ny / np.linalg.norm(ny) + (0.0 if perpendicular else 0.2 * rng.normal(size=3))
        ny /= np.linalg.norm(ny)
        # three joints of a bent finger
        first = np.cross(ny, nz)
        a = np.cumsum(0.03 * (first + 0.5 * rng.normal(size=(3, 3))), axis=0)
        w = rng.uniform(0, 1, 3)
        truth = rng.uniform(-1.2, 1.2, 2)
        t = saddle_turns(nz, ny, truth).apply(a)
        t += noise * rng.normal(0, 0.06, (3, 3))
        start = 0.5 * grid[rng.integers(len(grid))]
        found = saddle_exact(
            vector(nz), vector(ny), tuple(w), rows(t), rows(a), *start, tuple(bounds)
        )
        lz, uz, ly, uy = bounds
        star = (uz if found[0] >= 0 else lz, uy if found[1] >= 0 else ly)
        inside = (found[0] / star[0]) ** 2 + (found[1] / star[1]) ** 2
        assert inside <= 1 + 1e-12
        outside += inside > 1 - 1e-9
        best = gain(saddle_turns(nz, ny, grid), w, t, a).max()
        at = gain(saddle_turns(nz, ny, found), w, t, a)[0]
        size = (w * np.linalg.norm(a, axis=1) * np.linalg.norm(t, axis=1)).sum()
        assert at >= best - 1e-13 * size
        if noise == 0 and inside < 1 - 1e-9 and perpendicular:
            assert found == pytest.approx(truth, abs=1e-5)
    assert outside > 5


# ---- sweeps ----


@st.composite
def frames(draw):
    """A model, its targets and weights, and a pose to start from."""
    hand = draw(st.sampled_from(HANDS))
    model = HandModel.default(hand, draw(st.sampled_from(list(PRESETS))))
    seed = draw(st.integers(0, 2**32 - 1))
    sigma = draw(st.sampled_from([0.0, 0.002, 0.01, 0.05]))
    missing = draw(st.sets(st.integers(0, 20), max_size=17))
    rng = np.random.default_rng(seed)
    joints = some_poses(model, 1, sigma, seed).joints[0]
    weights = rng.uniform(0.01, 1, 21) if draw(st.booleans()) else np.ones(21)
    weights[list(missing)] = 0
    start = model.limits.clamp(rng.uniform(model.limits.lower, model.limits.upper))
    return model, joints, weights, start


@settings(max_examples=80, deadline=None)
@given(frames())
def test_every_exact_block_lowers_the_objective(frame):
    model, joints, weights, start = frame
    s = loaded(model, joints, weights, start, np.eye(3), np.zeros(3))
    cost = place(s)
    floor = 1e-15 * cost
    for _ in range(6):
        for block in range(6):
            if block == 5:
                update_root(s)
            else:
                update_finger(s, block)
            new = place(s)
            assert new <= cost * (1 + 1e-12) + floor
            cost = new
        assert model.limits.contains(by_finger(s[0]["angle"]), tolerance=1e-12)


def test_the_papers_blocks_can_raise_it():
    # so the test above would see it
    model = HandModel.default("right", "li2021")
    poses = some_poses(model, 40, 0.01, 5)
    raised = 0
    for joints in poses.joints:
        s = loaded(model, joints, np.ones(21), model.mean_angles, np.eye(3), np.zeros(3))
        for _ in range(6):
            update_root(s)
            cost = place(s)
            for f in range(5):
                update_finger_li2021(s, f)
            raised += place(s) > cost * (1 + 1e-6)
    assert raised > 3
