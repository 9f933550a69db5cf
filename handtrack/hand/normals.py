"""Vertex normals of a skin in many poses at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_POSES = 32  # at a time: what is computed on stays in the cache


class VertexNormals:
    """Area-weighted vertex normals of meshes that share their triangles.

    Args:
        faces: (F, 3) triangles, counter-clockwise from outside.
        vertices: how many vertices there are.
    """

    def __init__(self, faces: NDArray[np.int32], vertices: int) -> None:
        from scipy.sparse import csr_array

        self._corners = np.ascontiguousarray(faces.T)
        rows, columns = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
        ones = np.ones(rows.size, np.float32)
        # sums the normals of the faces around each vertex
        self._around: Any = csr_array((ones, (rows, columns)), shape=(vertices, len(faces)))

    def __call__(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """Unit normals (n, V, 3) of the poses' vertices (n, V, 3); zero at a lone vertex."""
        out = np.empty(vertices.shape, np.float32)
        for start in range(0, len(vertices), _POSES):
            poses = slice(start, start + _POSES)
            out[poses] = self._normals(vertices[poses].transpose(1, 2, 0)).transpose(2, 0, 1)
        return out

    def _normals(self, vertices: NDArray[np.floating]) -> NDArray[np.float32]:
        """Of vertices (V, 3, n): a corner of every face is then one row for all poses."""
        points = np.ascontiguousarray(vertices, np.float32)
        corner, a, b = (points[index] for index in self._corners)
        a -= corner
        b -= corner
        cross = corner  # not needed any more
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            cross[:, i] = a[:, j] * b[:, k]
            cross[:, i] -= a[:, k] * b[:, j]
        total = (self._around @ cross.reshape(len(cross), -1)).reshape(points.shape)
        length = np.sqrt((total * total).sum(1, keepdims=True))
        length[length == 0] = 1
        normals: NDArray[np.float32] = total / length
        return normals
