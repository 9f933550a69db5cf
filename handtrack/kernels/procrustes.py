"""Orthogonal Procrustes in compiled code: the rotation that best turns points onto points."""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.compiled import inline


@inline
def largest_eigenvector4(m):
    """Eigenvector of the largest eigenvalue of a symmetric 4x4 matrix (overwritten), Jacobi.

    Cyclic Jacobi is accurate for close and equal eigenvalues, where a polynomial is not.
    """
    v = np.eye(4)
    for _ in range(30):
        off = 0.0
        size = 0.0
        for i in range(4):
            size += m[i, i] * m[i, i]
            for j in range(i):
                off += m[i, j] * m[i, j]
        if off <= 1e-32 * size or off == 0.0:
            break
        for p in range(3):
            for q in range(p + 1, 4):
                if m[p, q] == 0.0:
                    continue
                h = 0.5 * (m[q, q] - m[p, p]) / m[p, q]
                t = 1.0 / (abs(h) + math.sqrt(1.0 + h * h))
                if h < 0.0:
                    t = -t
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = t * c
                for k in range(4):
                    a, b = m[p, k], m[q, k]
                    m[p, k], m[q, k] = c * a - s * b, s * a + c * b
                for k in range(4):
                    a, b = m[k, p], m[k, q]
                    m[k, p], m[k, q] = c * a - s * b, s * a + c * b
                    a, b = v[k, p], v[k, q]
                    v[k, p], v[k, q] = c * a - s * b, s * a + c * b
    best = 0
    for i in range(1, 4):
        if m[i, i] > m[best, best]:
            best = i
    return v[0, best], v[1, best], v[2, best], v[3, best]


@inline
def procrustes(m):
    """Rotation R (rows) that maximises sum_i w_i b_i . R a_i, for m = sum_i w_i b_i a_i^T (rows).

    The quaternion is the largest eigenvector of a symmetric 4x4 matrix (Horn 1987): always a
    proper rotation, also for planar and collinear points.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    k = np.empty((4, 4))
    k[0, 0] = xx + yy + zz
    k[1, 1] = xx - yy - zz
    k[2, 2] = -xx + yy - zz
    k[3, 3] = -xx - yy + zz
    k[0, 1] = k[1, 0] = zy - yz
    k[0, 2] = k[2, 0] = xz - zx
    k[0, 3] = k[3, 0] = yx - xy
    k[1, 2] = k[2, 1] = xy + yx
    k[1, 3] = k[3, 1] = xz + zx
    k[2, 3] = k[3, 2] = yz + zy
    w, x, y, z = largest_eigenvector4(k)
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
