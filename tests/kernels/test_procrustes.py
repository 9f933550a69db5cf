"""Procrustes: the best proper rotation, degenerate point sets included."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import procrustes, rows
from scipy.spatial.transform import Rotation


def point_sets(rng: np.random.Generator) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Pairs (b, a) of point sets for Procrustes, easy and degenerate."""
    a = rng.normal(0, 0.05, (21, 3))
    turn = Rotation.random(rng=rng)
    flat = a * [1, 1, 0]
    thin = a * [1, 1e-6, 1e-7]
    line = a * [1, 0, 0]
    axis = rng.normal(size=3)
    half = Rotation.from_rotvec(np.pi * axis / np.linalg.norm(axis))
    return {
        "clean": (turn.apply(a), a),
        "same": (a, a),
        "half a turn": (half.apply(a), a),
        "noisy": (turn.apply(a) + rng.normal(0, 0.01, a.shape), a),
        "unrelated": (rng.normal(0, 0.05, a.shape), a),
        "planar": (turn.apply(flat), flat),
        "noisy planar": (turn.apply(flat) + rng.normal(0, 0.01, a.shape), flat),
        "nearly a line": (turn.apply(thin), thin),
        "a line": (turn.apply(line), line),
        "mirrored": (turn.apply(a * [1, 1, -1]), a),
        "planar and mirrored": (turn.apply(flat * [1, -1, 1]), flat),
        "symmetric": (-np.eye(3), np.eye(3)),
        "tiny": (1e-9 * turn.apply(a), 1e-9 * a),
        "huge": (1e6 * turn.apply(a), 1e6 * a),
        "one point": (np.zeros((3, 3)), np.zeros((3, 3))),
    }


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize("kind", point_sets(np.random.default_rng(0)))
def test_procrustes_is_the_best_proper_rotation(kind):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        b, a = point_sets(rng)[kind]
        w = rng.uniform(0, 1, len(a))
        m = np.einsum("i,ij,ik->jk", w, b, a)
        r = np.array(procrustes(rows(m)))
        assert np.allclose(r @ r.T, np.eye(3), rtol=0, atol=1e-12)
        assert np.linalg.det(r) == pytest.approx(1, abs=1e-12)
        size = (w * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)).sum()
        if size == 0:
            continue
        best, _ = Rotation.align_vectors(b / np.sqrt(size), a / np.sqrt(size), w)
        assert (r * m).sum() >= (best.as_matrix() * m).sum() - 1e-14 * size
        if kind in ("clean", "same", "half a turn", "noisy", "planar", "noisy planar", "huge"):
            assert np.allclose(r, best.as_matrix(), rtol=0, atol=1e-7)
