"""3-vectors and rotations as tuples for compiled code: no allocation, everything inlines.

Vectors are (x, y, z); matrices are tuples of three row vectors.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from handtrack.kernels.compiled import inline

Vec: TypeAlias = tuple[float, float, float]


ZERO = (0.0, 0.0, 0.0)
ZERO3 = (ZERO, ZERO, ZERO)


@inline
def row(a, k):
    """Row k of an (n, 3) array as a vector."""
    return (a[k, 0], a[k, 1], a[k, 2])


@inline
def put_row(a, k, v):
    a[k, 0], a[k, 1], a[k, 2] = v


@inline
def lane(a, k, f):
    """The vector of entry k in lane f of a field (n, 3, LANES)."""
    return (a[k, 0, f], a[k, 1, f], a[k, 2, f])


@inline
def put_lane(a, k, f, v):
    a[k, 0, f], a[k, 1, f], a[k, 2, f] = v


@inline
def part(a, i):
    """Three numbers of a flat array as a vector."""
    return (a[i], a[i + 1], a[i + 2])


@inline
def put_part(a, i, v):
    a[i], a[i + 1], a[i + 2] = v


@inline
def matrix(a):
    """A (3, 3) array as rows."""
    return (row(a, 0), row(a, 1), row(a, 2))


@inline
def column(a, k):
    return (a[0, k], a[1, k], a[2, k])


@inline
def put_column(a, k, v):
    a[0, k], a[1, k], a[2, k] = v


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
def turn_of(w):
    """The rotation exp([w]x) by its vector w, ready for `turned` (Rodrigues).

    exp([w]x) = 1 + k [w]x + h [w]x^2, k = sin|w| / |w|, h = (1 - cos|w|) / |w|^2.
    """
    angle = math.sqrt(dot(w, w))
    k = math.sin(angle) / angle if angle > 1e-9 else 1.0
    h = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    return w, k, 2.0 * h * h


@inline
def turned(turn, v):
    """v turned by a rotation of `turn_of`."""
    w, k, h = turn
    a = cross(w, v)
    b = cross(w, a)
    return (
        v[0] + k * a[0] + h * b[0],
        v[1] + k * a[1] + h * b[1],
        v[2] + k * a[2] + h * b[2],
    )


@inline
def log_turn(a, b):
    """The rotation vector that takes rotation b (3, 3) to a: log(a b^T)."""
    rows, others = matrix(a), matrix(b)
    m = (apply(others, rows[0]), apply(others, rows[1]), apply(others, rows[2]))
    w = (0.5 * (m[2][1] - m[1][2]), 0.5 * (m[0][2] - m[2][0]), 0.5 * (m[1][0] - m[0][1]))
    c = 0.5 * (m[0][0] + m[1][1] + m[2][2] - 1.0)
    s = math.sqrt(dot(w, w))
    if s < 1e-6 and c > 0.0:
        return w
    angle = math.atan2(s, c)
    if c > -0.99:
        return scale(angle / s, w)
    # near half a turn the axis n is in the symmetric part, c + (1 - c) n n^T
    k = 1.0 / (1.0 - c)
    xx, yy = max((m[0][0] - c) * k, 0.0), max((m[1][1] - c) * k, 0.0)
    zz, k = max((m[2][2] - c) * k, 0.0), 0.5 * k
    xy, xz, yz = k * (m[0][1] + m[1][0]), k * (m[0][2] + m[2][0]), k * (m[1][2] + m[2][1])
    if xx >= yy and xx >= zz:
        x = math.sqrt(xx)
        n = (x, xy / x, xz / x)
    elif yy >= zz:
        y = math.sqrt(yy)
        n = (xy / y, y, yz / y)
    else:
        z = math.sqrt(zz)
        n = (xz / z, yz / z, z)
    # the antisymmetric part says which way round
    return scale(-angle if dot(n, w) < 0.0 else angle, n)


@inline
def quaternion(m):
    """Unit quaternion wxyz, w >= 0, of a rotation (rows).

    From the largest of the four squared components, so it is accurate at any angle.
    """
    xx, yy, zz = m[0][0], m[1][1], m[2][2]
    x, y, z = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    xy, xz, yz = m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]
    trace = xx + yy + zz
    if trace >= max(xx, yy, zz):
        q = (1.0 + trace, x, y, z)
    elif xx >= yy and xx >= zz:
        q = (x, 1.0 + xx - yy - zz, xy, xz)
    elif yy >= zz:
        q = (y, xy, 1.0 - xx + yy - zz, yz)
    else:
        q = (z, xz, yz, 1.0 - xx - yy + zz)
    n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if q[0] < 0.0:
        n = -n
    return (n * q[0], n * q[1], n * q[2], n * q[3])


@inline
def reduced(x):
    """The angle in -pi..pi that turns alike; one that is there already, to the last bit."""
    return x - 2.0 * math.pi * np.rint(x * (0.5 / math.pi))


@inline
def cos_sin(x):
    """Cosine and sine of an angle in -pi..pi, to 1e-15, by straight-line code.

    Taylor series at a quarter of the angle, then the double-angle formulae twice; unlike the
    library's functions this turns into vector instructions.
    """
    t = 0.25 * x
    q = t * t
    sine = 1.0 - q / 210.0 * (1.0 - q / 272.0)
    sine = 1.0 - q / 110.0 * (1.0 - q / 156.0 * sine)
    sine = t * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * sine))))
    # one minus the cosine keeps its digits at small angles
    versed = 1.0 - q / 182.0 * (1.0 - q / 240.0 * (1.0 - q / 306.0))
    versed = 1.0 - q / 90.0 * (1.0 - q / 132.0 * versed)
    versed = 0.5 * q * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * versed)))
    cosine = 1.0 - versed
    sine, versed = 2.0 * sine * cosine, 2.0 * sine * sine
    cosine = 1.0 - versed
    return 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine


@inline
def outer_sum(m, w, b, a):
    """m + w b a^T."""
    return (
        add(m[0], scale(w * b[0], a)),
        add(m[1], scale(w * b[1], a)),
        add(m[2], scale(w * b[2], a)),
    )


@inline
def unit_cos_sin(c, s):
    """(c, s) scaled to the unit circle; no turn where both vanish."""
    r = math.sqrt(c * c + s * s)
    if r < 1e-300:
        return 1.0, 0.0
    return c / r, s / r
