"""The most that any hand of rigid bones can explain: every joint a free ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIZE = 6


@dataclass(frozen=True, eq=False)
class Balls:
    """Five fingers whose bones keep their lengths and point anywhere.

    A finger's constants: its base (3) and the lengths of its three bones [m]. Its unknowns:
    (T, 5, 3, 3) unit directions of the bones in the root frame, moved in their tangent planes.
    """

    def points(self, shared: Array, local: Array) -> Array:
        """(T, 5, 4, 3) joints of the fingers, base to tip."""
        steps = np.empty((*local.shape[:2], 4, 3))
        steps[..., 0, :] = shared[:, :3]
        steps[..., 1:, :] = shared[:, 3:, None] * local
        return steps.cumsum(2)

    def linearised(self, shared: Array, local: Array) -> tuple[Array, Array, Array]:
        """Points and their derivatives by directions (two each) and by constants."""
        n = len(local)
        by_local = np.zeros((n, 5, 4, 3, 6))
        by_shared = np.zeros((n, 5, 4, 3, SIZE))
        by_shared[..., :3] = np.eye(3)
        planes = _planes(local)
        for i in range(3):
            moved = shared[:, 3 + i, None, None] * planes[:, :, i]
            by_local[:, :, i + 1 :, :, 2 * i : 2 * i + 2] = moved[:, :, None]
            by_shared[:, :, i + 1 :, :, 3 + i] = local[:, :, None, i]
        return self.points(shared, local), by_local, by_shared

    def moved(self, local: Array, step: Array) -> Array:
        """Directions after a step in their tangent planes."""
        planes = _planes(local)
        new = local + np.einsum("tfixc,tfic->tfix", planes, step.reshape(*local.shape[:3], 2))
        return np.asarray(new / np.linalg.norm(new, axis=-1, keepdims=True))

    def pull(self, local: Array) -> tuple[float, Array, Array]:
        """Nothing is expected of directions."""
        nothing = np.zeros((*local.shape[:2], 6))
        return 0.0, nothing, nothing


def _planes(u: Array) -> Array:
    """(..., 3, 2) two unit vectors at right angles to each unit vector and to each other."""
    least = np.eye(3)[np.abs(u).argmin(-1)]
    a = np.cross(u, least)
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    return np.stack([a, np.cross(u, a)], -1)
