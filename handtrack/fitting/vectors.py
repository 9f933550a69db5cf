"""3-vectors as tuples for compiled code: no allocation, everything inlines.

Vectors are (x, y, z); matrices are tuples of three row vectors.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from handtrack.fitting.compiled import inline

Vec: TypeAlias = tuple[float, float, float]
Mat: TypeAlias = tuple[Vec, Vec, Vec]


@inline
def row(a, k):
    """Row k of an (n, 3) array as a vector."""
    return (a[k, 0], a[k, 1], a[k, 2])


@inline
def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inline
def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inline
def scale(s, a):
    return (s * a[0], s * a[1], s * a[2])


@inline
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inline
def rotate(n, c, s, v):
    """v turned about the unit axis n by the angle with cosine c and sine s (Rodrigues)."""
    k = (1.0 - c) * dot(n, v)
    m = cross(n, v)
    return (
        c * v[0] + s * m[0] + k * n[0],
        c * v[1] + s * m[1] + k * n[1],
        c * v[2] + s * m[2] + k * n[2],
    )


@inline
def apply(m, v):
    return (dot(m[0], v), dot(m[1], v), dot(m[2], v))


@inline
def apply_transposed(m, v):
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@inline
def distance2(a, b):
    d = sub(a, b)
    return dot(d, d)


@inline
def unit_cos_sin(c, s):
    """(c, s) scaled to the unit circle; no turn where both vanish."""
    r = math.sqrt(c * c + s * s)
    if r < 1e-300:
        return 1.0, 0.0
    return c / r, s / r
