"""Small dense systems of the compiled code against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from plain import plain

from handtrack.kernels import linear_algebra
from handtrack.kernels.linear_algebra import N

ldl4, solve_one, invert = (
    plain(getattr(linear_algebra, name)) for name in ("ldl4", "solve_one", "invert")
)


def factor(a, u):
    return plain(linear_algebra.factor)(a, u), plain(linear_algebra.is_lifted)(a, u)


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
