"""Rotations against SciPy's, from the tiniest turn to half a turn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handtrack.hand.rotations import (
    about_axis,
    matrix_to_quaternion,
    matrix_to_vector,
    quaternion_to_matrix,
    vector_to_matrix,
)

ANGLES = (0.0, 1e-12, 1e-8, 1e-4, 0.3, 1.0, np.pi / 2, 3.0, np.pi - 1e-7, np.pi)
coordinates = st.floats(-1, 1, allow_subnormal=False)


def unit_axes(n: int = 40) -> np.ndarray:
    """Random axes, and those that every formula for half a turn trips over."""
    axes = np.random.default_rng(0).normal(size=(n, 3))
    special = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (1, 1, 0), (0, -1, 1)]
    axes = np.concatenate([axes, special])
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def vectors() -> np.ndarray:
    """(n, 3) rotation vectors of every angle about every axis."""
    return (unit_axes()[:, None] * np.array(ANGLES)[:, None]).reshape(-1, 3)


def test_about_axis_is_the_rotation_vector_of_axis_and_angle():
    axes = unit_axes()
    for angle in (*ANGLES, -1.2, 5.0, -40.0):
        expected = Rotation.from_rotvec(axes * angle).as_matrix()
        assert np.allclose(about_axis(axes, angle), expected, rtol=0, atol=1e-14)


def test_vector_to_matrix():
    expected = Rotation.from_rotvec(vectors()).as_matrix()
    assert np.allclose(vector_to_matrix(vectors()), expected, rtol=0, atol=2e-15)


def test_matrix_to_vector_finds_vectors_shorter_than_half_a_turn():
    given_vectors = vectors()
    short = np.linalg.norm(given_vectors, axis=1) < np.pi - 1e-6
    given_vectors = given_vectors[short]
    found = matrix_to_vector(Rotation.from_rotvec(given_vectors).as_matrix())
    assert np.allclose(found, given_vectors, rtol=0, atol=1e-14)
    # tiny turns to their own precision, not only to that of one
    length = np.linalg.norm(given_vectors, axis=1)
    tiny = (length > 0) & (length < 1e-3)
    error = np.linalg.norm(found - given_vectors, axis=1)
    assert (error[tiny] <= 1e-9 * length[tiny] + 1e-23).all()


def test_half_turns_survive_up_to_the_sign_of_the_axis():
    half = unit_axes() * np.pi
    matrix = Rotation.from_rotvec(half).as_matrix()
    found = matrix_to_vector(matrix)
    assert np.allclose(np.linalg.norm(found, axis=1), np.pi, rtol=0, atol=1e-12)
    sign = np.sign((found * half).sum(1))[:, None]
    assert np.allclose(sign * found, half, rtol=0, atol=1e-12)
    assert np.allclose(vector_to_matrix(found), matrix, rtol=0, atol=1e-14)


def test_quaternions_are_wxyz_with_positive_w():
    rotation = Rotation.from_rotvec(vectors())
    xyzw = rotation.as_quat(canonical=False)
    found = matrix_to_quaternion(rotation.as_matrix())
    assert (found[:, 0] >= 0).all()
    assert np.allclose(np.linalg.norm(found, axis=1), 1, rtol=0, atol=1e-15)
    same = np.abs((found * xyzw[:, [3, 0, 1, 2]]).sum(1))
    assert np.allclose(same, 1, rtol=0, atol=1e-14)
    known = matrix_to_quaternion(Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix())
    assert known == pytest.approx([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


def test_quaternion_to_matrix_normalises():
    xyzw = Rotation.from_rotvec(vectors()).as_quat()
    wxyz = xyzw[:, [3, 0, 1, 2]]
    expected = Rotation.from_quat(xyzw).as_matrix()
    for factor in (1.0, -1.0, 1e-6, 7.0):
        found = quaternion_to_matrix(factor * wxyz)
        assert np.allclose(found, expected, rtol=0, atol=2e-15)


@given(st.tuples(coordinates, coordinates, coordinates), st.floats(0, np.pi))
def test_round_trips(direction, angle):
    n = np.linalg.norm(direction)
    vector = np.zeros(3) if n < 1e-6 else np.array(direction) * (angle / n)
    matrix = vector_to_matrix(vector)
    assert np.allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-14)
    for back in (
        vector_to_matrix(matrix_to_vector(matrix)),
        quaternion_to_matrix(matrix_to_quaternion(matrix)),
    ):
        assert np.allclose(back, matrix, rtol=0, atol=1e-14)


def test_leading_axes_are_kept():
    v = np.random.default_rng(1).normal(size=(4, 5, 3))
    m = vector_to_matrix(v)
    assert m.shape == (4, 5, 3, 3)
    assert matrix_to_quaternion(m).shape == (4, 5, 4)
    assert matrix_to_vector(m).shape == (4, 5, 3)
    assert quaternion_to_matrix(matrix_to_quaternion(m)).shape == (4, 5, 3, 3)
    for i in range(4):
        for j in range(5):
            assert np.allclose(m[i, j], vector_to_matrix(v[i, j]), rtol=0, atol=1e-15)
            assert np.allclose(
                matrix_to_vector(m)[i, j], matrix_to_vector(m[i, j]), rtol=0, atol=1e-15
            )
    # one axis per angle, angles of a whole batch
    angles = np.random.default_rng(2).normal(size=(7, 5))
    assert about_axis(unit_axes()[:5], angles).shape == (7, 5, 3, 3)
