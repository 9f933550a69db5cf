"""Calibrated cameras on an arc before the hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import handtrack as ht

Array = NDArray[np.float64]

SIZE = (640, 480)


def looking(name: str, eye: Array, at: Array, focal: float, size: tuple[int, int]) -> ht.Camera:
    """A camera at `eye` that looks at a point; z is up, x of the picture to its right [m, px]."""
    z = (at - eye) / np.linalg.norm(at - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    matrix = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1.0]])
    return ht.Camera(name, matrix, np.zeros(0), rotation, -rotation @ eye, size)


def arc(rng: np.random.Generator, count: int, size: tuple[int, int] = SIZE) -> list[ht.Camera]:
    """One to four cameras 30 to 42 degrees apart at about half a metre; the first looks straight.

    A hand of 18 cm takes 30 to 60 % of the picture's height.
    """
    apart = rng.uniform(30, 42)
    azimuths = np.array([0.0, -apart, apart, 1.8 * apart])[:count] + rng.uniform(-6, 6, count)
    cameras = []
    for i, azimuth in enumerate(np.deg2rad(azimuths)):
        elevation = np.deg2rad(rng.uniform(-8, 22))
        distance = rng.uniform(0.43, 0.56)
        level = distance * np.cos(elevation)
        eye = np.array([level * np.sin(azimuth), -level * np.cos(azimuth), 0.0])
        eye[2] = distance * np.sin(elevation)
        focal = rng.uniform(0.88, 1.02) * size[0]
        cameras.append(looking(f"cam{i}", eye, rng.normal(0.0, 0.01, 3), focal, size))
    return cameras
