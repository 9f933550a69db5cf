"""Rotation matrices about axes against SciPy's, over any leading axes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handtrack.kernels.kinematics import turns_about


@pytest.mark.parametrize(
    ("axes", "angles"),
    [((3,), ()), ((3,), (5,)), ((4, 3), ()), ((4, 3), (2, 4)), ((2, 1, 3), (5,)), ((0, 3), (0,))],
)
def test_turns_are_scipys_for_any_shapes(axes, angles):
    rng = np.random.default_rng(0)
    axis, angle = rng.normal(size=axes), rng.uniform(-9, 9, angles)
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    found = turns_about(axis, angle)
    vectors = axis * angle[..., None]
    expected = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix() if vectors.size else vectors
    assert found.shape == (*vectors.shape[:-1], 3, 3)
    assert np.allclose(found.ravel(), expected.ravel(), rtol=0, atol=1e-14)
