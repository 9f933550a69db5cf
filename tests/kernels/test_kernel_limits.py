"""Limits of the compiled code against eq. 3 and a search along the ellipse."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import nearest_on_ellipse as oracle
from numba import njit

from handtrack.hand.limits import PRESETS
from handtrack.kernels import limits


@njit
def nearest_on_ellipse(bounds, z, y):
    return limits.nearest_on_ellipse(bounds, z, y)


@njit
def inside_ellipse(bounds, z, y):
    return limits.inside_ellipse(bounds, z, y)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_ellipse_is_the_limits(preset):
    rng, given = np.random.default_rng(2), PRESETS[preset]
    outside = 0
    for f in range(5):
        low, high = given.lower[4 * f : 4 * f + 2], given.upper[4 * f : 4 * f + 2]
        bounds = (low[0], high[0], low[1], high[1])
        for _ in range(60):
            x = rng.uniform(2 * low, 2 * high)
            axes = np.where(x < 0, -low, high)
            inside = np.square(x / axes).sum() <= 1
            assert inside_ellipse(bounds, *x) == inside
            if not inside:
                assert np.allclose(nearest_on_ellipse(bounds, *x), oracle(x, axes), atol=1e-9)
                outside += 1
    assert outside > 50


def test_poses_are_clamped_angle_by_angle_and_saddle_by_saddle():
    rng = np.random.default_rng(3)
    given = PRESETS["anatomical"]
    angles = rng.uniform(1.6 * given.lower - 0.2, 1.6 * given.upper + 0.2, (3, 40, 20))
    before = angles.copy()
    found = limits.clamp_poses(given.lower, given.upper, angles)
    assert np.array_equal(angles, before)
    for i in np.ndindex(3, 40):
        expected = np.clip(angles[i], given.lower, given.upper)
        for k in range(0, 20, 4):
            axes = np.where(
                angles[i][k : k + 2] < 0, -given.lower[k : k + 2], given.upper[k : k + 2]
            )
            if np.square(angles[i][k : k + 2] / axes).sum() > 1:
                expected[k : k + 2] = oracle(angles[i][k : k + 2], axes)
        assert np.allclose(found[i], expected, rtol=0, atol=1e-9)
