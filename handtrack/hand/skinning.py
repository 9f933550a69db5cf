"""Skins of many poses at once: linear blends with offsets of the pose, and their normals."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# poses whose vertices fit the cache together
_BLOCK = 32


class Skinning:
    """A skin at rest and how it follows its parts.

    Args:
        rest_vertices: (V, 3) [m].
        weights: (V, P) of the parts.
        pose_blend: (V, 3, 9 (P - 1)) offset of each vertex at rest for each entry of R_k - I,
            row by row, of the rotations of parts 1, 2, ... against their parents (pose blend
            shapes, Romero et al. 2017, eq. 5); None for a skin without.
    """

    def __init__(self, rest_vertices: Array, weights: Array, pose_blend: Array | None) -> None:
        self.rest, self.weights = rest_vertices, weights
        # a matrix (9 (P - 1), V) for each axis
        self._blend = (
            None if pose_blend is None else np.ascontiguousarray(pose_blend.transpose(1, 2, 0))
        )

    def __call__(self, rotations: Array, offsets: Array, local: Array | None = None) -> Array:
        """Vertices of poses.

        Args: of shapes that broadcast;
            rotations: (..., P, 3, 3) of each part, from rest to the world.
            offsets: (..., P, 3): a point x of part p goes to rotations x + offsets [m].
            local: (..., P - 1, 3, 3) rotations of parts 1, 2, ... against their parents;
                needed where there are pose blend shapes.

        Returns:
            (..., V, 3) [m].
        """
        lead = np.broadcast_shapes(rotations.shape[:-3], offsets.shape[:-2])
        rotations = np.broadcast_to(rotations, (*lead, *rotations.shape[-3:]))
        offsets = np.broadcast_to(offsets, (*lead, *offsets.shape[-2:]))
        if local is not None:
            local = np.broadcast_to(local, (*lead, *local.shape[-3:]))
        n, parts = math.prod(lead), rotations.shape[-3]
        if local is None or self._blend is None:
            # vertex v, pose n: sum_p w_vp T_np [x_v; 1], one product over (part, homogeneous axis)
            transforms = np.concatenate([rotations, offsets[..., None]], -1)  # (..., P, 3, 4)
            rows = np.moveaxis(transforms, -2, -3).reshape(n * 3, parts * 4)
            skin = rows @ self._basis
        else:
            features = (local - np.eye(3)).reshape(n, -1)
            turns, shifts = rotations.reshape(n, parts, 3, 3), offsets.reshape(n, parts, 3)
            skin = self._blended(turns, shifts, features, self._blend)
        return np.asarray(skin.reshape(*lead, 3, len(self.rest)).swapaxes(-1, -2))

    def _blended(self, rotations: Array, offsets: Array, features: Array, blend: Array) -> Array:
        """sum_p w_vp (R_np (x_v + (B f_n)_v) + t_np), (n, 3, V), block by block in the cache."""
        n, vertices = len(rotations), len(self.rest)
        out = np.empty((n, 3, vertices))
        all_turns, all_rest = np.empty((3, 3, _BLOCK, vertices)), np.empty((_BLOCK, vertices))
        weights = np.ascontiguousarray(self.weights.T)
        for start in range(0, n, _BLOCK):
            block = slice(start, start + _BLOCK)
            skin, rest = out[block], all_rest[: n - start]
            turns = all_turns[:, :, : n - start]
            np.matmul(rotations[block].transpose(2, 3, 0, 1), weights, out=turns)
            np.matmul(offsets[block].transpose(0, 2, 1), weights, out=skin)
            for c in range(3):
                np.matmul(features[block], blend[c], out=rest)
                rest += self.rest[:, c]
                for i in range(3):
                    turns[i, c] *= rest
                    skin[:, i] += turns[i, c]
        return out

    @cached_property
    def _basis(self) -> Array:
        """(4 P, V): weight of part p times homogeneous rest coordinate c, for row 4 p + c."""
        homogeneous = np.concatenate([self.rest, np.ones((len(self.rest), 1))], 1)
        basis = self.weights[:, :, None] * homogeneous[:, None, :]
        return np.ascontiguousarray(basis.reshape(len(self.rest), -1).T)


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
