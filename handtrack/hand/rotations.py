"""Rotations as matrices, vectors and quaternions (wxyz), over any leading axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def about_axis(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) about unit axes (..., 3) by angles (...) [rad] (Rodrigues)."""
    from handtrack.kernels.kinematics import turns_about

    return turns_about(np.asarray(axis, dtype=np.float64), np.asarray(angle, dtype=np.float64))


def matrix_to_quaternion(matrix: ArrayLike) -> Array:
    """Unit quaternions (..., 4) wxyz with w >= 0 of rotation matrices (..., 3, 3).

    Built from the largest of the four squared components, so it is accurate at any angle.
    """
    m = np.asarray(matrix, dtype=np.float64)
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    a, b, c = m[..., 2, 1], m[..., 0, 2], m[..., 1, 0]
    d, e, f = m[..., 1, 2], m[..., 2, 0], m[..., 0, 1]
    # four times the outer product of the quaternion with itself, row by row
    rows = np.stack(
        [
            np.stack([1 + m00 + m11 + m22, a - d, b - e, c - f], -1),
            np.stack([a - d, 1 + m00 - m11 - m22, f + c, b + e], -1),
            np.stack([b - e, f + c, 1 - m00 + m11 - m22, d + a], -1),
            np.stack([c - f, b + e, d + a, 1 - m00 - m11 + m22], -1),
        ],
        -2,
    )
    best = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), -1)
    q = np.take_along_axis(rows, best[..., None, None], -2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0, -q, q))


def quaternion_to_matrix(quaternion: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) wxyz, normalised first."""
    q = np.asarray(quaternion, dtype=np.float64)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def vector_to_matrix(vector: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)
    # the axis of no turn is of no matter, as long as it is one
    axis = np.where(angle[..., None] > 0, v, np.array([1.0, 0.0, 0.0]))
    axis = axis / np.where(angle > 0, angle, 1.0)[..., None]
    return about_axis(axis, angle)


def matrix_to_vector(matrix: ArrayLike) -> Array:
    """Rotation vectors (..., 3) [rad], of length 0..pi, of rotation matrices (..., 3, 3)."""
    q = matrix_to_quaternion(matrix)
    s = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(s, q[..., :1])
    return np.asarray(q[..., 1:] * np.where(s > 0, angle / np.where(s > 0, s, 1.0), 2.0))


def moved(points: Array, rotation: ArrayLike | None, translation: ArrayLike) -> Array:
    """Points (..., n, 3) turned by (..., 3, 3), None: not, and shifted by (..., 3) or a number."""
    translation = np.asarray(translation, dtype=np.float64)
    if rotation is not None:
        rotation = np.asarray(rotation, dtype=np.float64)
        points = np.einsum("...ij,...kj->...ki", rotation, points)
    return np.asarray(
        points + translation[..., None, :] if translation.ndim else points + translation
    )
