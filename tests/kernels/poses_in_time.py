"""What tests of all filters ask: a step of time, and whether a pose moved as it should."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from handtrack.kernels import motion_noise

N = 26


def step(s, rng: np.random.Generator) -> None:
    """A transition that differs from number to number, with its noise."""
    decay = rng.uniform(0.5, 20.0, N)
    s.f01, s.f11, s.q00, s.q01, s.q11 = (
        np.array(row)
        for row in zip(*(motion_noise.unit_process.py_func(d, 0.05) for d in decay), strict=True)
    )


def moved(s, pose: tuple, d: np.ndarray) -> None:
    """A state's pose is another one moved by d: turned by the world, on the left."""
    angles, rotation, translation = pose
    np.testing.assert_allclose(s.angles, angles + d[:20], atol=1e-12)
    turn = Rotation.from_rotvec(d[20:23]).as_matrix()
    np.testing.assert_allclose(s.rotation, turn @ rotation, atol=1e-12)
    np.testing.assert_allclose(s.translation, translation + d[23:], atol=1e-12)


def pose_of(s) -> tuple:
    return s.angles.copy(), s.rotation.copy(), s.translation.copy()
