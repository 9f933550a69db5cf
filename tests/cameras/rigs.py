"""Cameras around a hand, for tests."""

from __future__ import annotations

import numpy as np

from handtrack.cameras.camera import Camera
from handtrack.hand.rotations import vector_to_matrix

LENS = [-0.12, 0.08, 0.001, -0.002, 0.01, 0.02, -0.01, 0.005]


def rig(n: int = 3, lens=LENS) -> list[Camera]:
    """n cameras on a circle, 0.6 m from the origin, that look at it; 1280 x 720."""
    cameras = []
    for i in range(n):
        turn = vector_to_matrix(np.array([0.0, 2 * np.pi * i / max(n, 3), 0.0]))
        matrix = np.array([[900.0 + i, 0.5, 640.0], [0, 905.0, 360.0], [0, 0, 1]])
        cameras.append(
            Camera(f"cam{i}", matrix, lens, turn, np.array([0.02 * i, -0.01, 0.6]), (1280, 720))
        )
    return cameras
