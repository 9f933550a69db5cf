"""A camera's picture of a point against the camera's own, and its derivative by differences."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from handtrack.cameras.camera import Camera
from handtrack.kernels.pixel_objective import NEAR
from handtrack.kernels.pixel_objective import view as compiled

MATRIX = np.array([[900.0, 1.5, 640.0], [0, 870.0, 360.0], [0, 0, 1]])
BENT = [-0.12, 0.08, 0.01, -0.02, 0.01, 0.02, -0.01, 0.005]


@njit
def view(camera, p):
    return compiled(camera[0], p)


def some_camera(rng: np.random.Generator) -> Camera:
    turn = Rotation.random(rng=rng).as_matrix()
    return Camera("one", MATRIX, BENT, turn, rng.normal(size=3), (1280, 720))


def test_pictures_are_the_cameras_and_move_as_their_derivatives_say():
    rng, h = np.random.default_rng(0), 1e-6
    for _ in range(50):
        camera = some_camera(rng)
        seen = np.append(rng.uniform(-0.4, 0.4, 2), 1.0) * rng.uniform(0.3, 3)
        point = camera.rotation.T @ (seen - camera.translation)
        front, u, v, du, dv = view(camera.lens[None], tuple(point))
        assert front
        assert np.allclose((u, v), camera.project(point), rtol=0, atol=1e-9)
        steps = h * np.eye(3)
        slopes = (camera.project(point + steps) - camera.project(point - steps)) / (2 * h)
        assert np.allclose(np.transpose([du, dv]), slopes, rtol=1e-6, atol=1e-4)


def test_what_is_behind_or_too_near_has_no_picture():
    camera = some_camera(np.random.default_rng(1))
    for depth in (-1.0, 0.0, 0.5 * NEAR):
        point = camera.rotation.T @ (np.array([0.0, 0.0, depth]) - camera.translation)
        assert not view(camera.lens[None], tuple(point))[0]
