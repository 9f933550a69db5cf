"""Rotations, limits and small systems of the compiled code against SciPy and NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import nearest_on_ellipse as oracle
from kernel_cases import rows, vector
from numba import njit
from scipy.spatial.transform import Rotation

from handtrack.hand.limits import PRESETS
from handtrack.kernels import filter_state, limits, linear_algebra, vectors
from handtrack.kernels.filter_state import FILTER
from handtrack.kernels.linear_algebra import N


@njit
def turned(w, v):
    return vectors.turned(vectors.turn_of(w), v)


@njit
def log_turn(a, b):
    return vectors.log_turn(a, b)


@njit
def quaternion(m):
    return vectors.quaternion(m)


@njit
def cos_sin(x):
    return vectors.cos_sin(x)


@njit
def nearest_on_ellipse(bounds, z, y):
    return limits.nearest_on_ellipse(bounds, z, y)


@njit
def inside_ellipse(bounds, z, y):
    return limits.inside_ellipse(bounds, z, y)


@njit
def ldl4(a, least):
    return linear_algebra.ldl4(a, least)


@njit
def factor(a, u):
    return linear_algebra.factor(a, u), linear_algebra.is_lifted(a, u)


@njit
def solve_one(u, x):
    linear_algebra.solve_one(u, x)


@njit
def invert(u, work, out):
    linear_algebra.invert(u, work, out)


@njit
def move_pose(states, d):
    filter_state.move_pose(states[0], d)


ANGLES = (0.0, 1e-12, 1e-7, 1e-3, 0.5, 2.0, 3.1, np.pi - 1e-4, np.pi - 1e-9)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_turn_and_its_logarithm(angle):
    rng = np.random.default_rng(0)
    for _ in range(20):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turn, other = Rotation.from_rotvec(angle * axis), Rotation.random(rng=rng)
        v = rng.normal(size=3)
        assert np.allclose(turned(vector(angle * axis), vector(v)), turn.apply(v), atol=1e-13)
        found = log_turn((turn * other).as_matrix(), other.as_matrix())
        # near half a turn both ways round are one rotation
        again = Rotation.from_rotvec(found) * turn.inv()
        assert again.magnitude() < 1e-7
        if angle < 3.13:
            assert np.allclose(found, angle * axis, atol=1e-9)


def test_quaternions_are_scipys_with_a_positive_real_part():
    rng = np.random.default_rng(1)
    halves = [Rotation.from_rotvec(np.pi * np.eye(3)[i]) for i in range(3)]
    for turn in [*Rotation.random(200, rng=rng), *halves]:
        x, y, z, w = turn.as_quat(canonical=True)
        found = quaternion(rows(turn.as_matrix()))
        assert found[0] >= 0
        sign = 1.0 if w > 1e-9 else np.sign(found @ np.array([w, x, y, z]))
        assert np.allclose(found, sign * np.array([w, x, y, z]), atol=1e-12)


def test_cosine_and_sine():
    for x in np.linspace(-np.pi, np.pi, 2001):
        assert np.allclose(cos_sin(x), (np.cos(x), np.sin(x)), rtol=0, atol=1e-15)


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


def upper(a: np.ndarray) -> tuple:
    return (*(tuple(a[i, i:]) for i in range(3)), a[3, 3])


def test_ldl_of_a_finger():
    rng = np.random.default_rng(3)
    for _ in range(50):
        root = rng.normal(size=(4, 4))
        a = root @ root.T + 1e-3 * np.eye(4)
        d, found, (l0, l1, l2) = ldl4(upper(a), (0.0,) * 4)
        assert d == found
        low = np.eye(4)
        low[1:, 0], low[2:, 1], low[3, 2] = l0, l1, l2
        assert np.allclose(low @ np.diag(d) @ low.T, a, atol=1e-10)
        # pivots that are lifted: as if the diagonal had been higher, and no more than that
        least = tuple(rng.uniform(0, 4, 4))
        d, found, (l0, l1, l2) = ldl4(upper(a), least)
        assert (np.array(d) == np.maximum(found, least)).all()
        low[1:, 0], low[2:, 1], low[3, 2] = l0, l1, l2
        raised = a + np.diag(np.array(d) - found)
        assert np.allclose(low @ np.diag(d) @ low.T, raised, atol=1e-9)


def test_dense_systems():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(N, N))
    a = root @ root.T + 0.1 * np.eye(N)
    u, work, out = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N))
    log, lifted = factor(a, u)
    assert not lifted
    assert log == pytest.approx(np.linalg.slogdet(a)[1])
    assert np.allclose(np.triu(u).T @ np.triu(u), a)
    x = rng.normal(size=N)
    solved = x.copy()
    solve_one(u, solved)
    assert np.allclose(a @ solved, x)
    invert(u, work, out)
    assert np.allclose(out @ a, np.eye(N), atol=1e-8)
    a[7] = a[:, 7] = 0.0  # nothing observes it
    a[7, 7] = -1.0
    assert factor(a, u)[1]


def test_a_pose_is_moved_by_a_turn_of_the_world():
    rng = np.random.default_rng(5)
    states, d = np.zeros(1, FILTER), rng.normal(size=26)
    before = Rotation.random(rng=rng)
    states["rotation"], states["angles"], states["translation"] = before.as_matrix(), 0.3, 0.2
    move_pose(states, d)
    expected = (Rotation.from_rotvec(d[20:23]) * before).as_matrix()
    assert np.allclose(states[0]["rotation"], expected, atol=1e-13)
    assert np.allclose(states[0]["angles"], 0.3 + d[:20])
    assert np.allclose(states[0]["translation"], 0.2 + d[23:])
