"""Rotations of the compiled code against SciPy and NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import rows, vector
from plain import plain
from scipy.spatial.transform import Rotation

from handtrack.kernels import vectors

log_turn, quaternion, cos_sin, reduced = (
    plain(getattr(vectors, name)) for name in ("log_turn", "quaternion", "cos_sin", "reduced")
)


def turned(w, v):
    return plain(vectors.turned)(plain(vectors.turn_of)(w), v)


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


def test_angles_are_reduced_to_one_turn():
    for x in np.linspace(-np.pi, np.pi, 101)[1:-1]:
        assert reduced(x) == x
        for turns in (-40, -1, 1, 7):
            assert reduced(x + 2 * np.pi * turns) == pytest.approx(x, abs=1e-13)
    assert np.isnan(reduced(np.nan))
