"""Small dense symmetric systems: loops over rows that the compiler turns into vectors.

Matrices are square with N rows unless said otherwise; only what a docstring names is written.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import inline
from handtrack.fitting.lanes import (
    CURVE,
    FREE_2,
    FREE_3,
    FREE_N,
    FREE_T,
    LANES,
    NORMAL_Y,
    NORMAL_Z,
    STEP_Z,
)

N = 26


@inline
def factor(a, u):
    """u, upper triangular, with u^T u = a (Cholesky); of a the upper triangle is read.

    Returns the logarithm of a's determinant. A pivot that rounding made negative is lifted.
    """
    for i in range(N):
        for j in range(i, N):
            u[i, j] = a[i, j]
    log = 0.0
    for k in range(N):
        d = max(u[k, k], 1e-14 * abs(a[k, k]) + 1e-300)
        log += math.log(d)
        inverse = 1.0 / math.sqrt(d)
        for j in range(k, N):
            u[k, j] *= inverse
        for i in range(k + 1, N):
            v = u[k, i]
            for j in range(i, N):
                u[i, j] -= v * u[k, j]
    return log


@inline
def divide(u, w):
    """w becomes u^-T w, for w of any width."""
    columns = w.shape[1]
    for k in range(N):
        inverse = 1.0 / u[k, k]
        for j in range(columns):
            w[k, j] *= inverse
        for i in range(k + 1, N):
            v = u[k, i]
            for j in range(columns):
                w[i, j] -= v * w[k, j]


@inline
def invert(u, work, out):
    """out = (u^T u)^-1, both triangles; work is overwritten."""
    for i in range(N):
        for j in range(N):
            work[i, j] = 0.0
        work[i, i] = 1.0
    # rows of u^-T: lower triangular
    for k in range(N):
        inverse = 1.0 / u[k, k]
        for j in range(k + 1):
            work[k, j] *= inverse
        for i in range(k + 1, N):
            v = u[k, i]
            for j in range(k + 1):
                work[i, j] -= v * work[k, j]
    for i in range(N):
        for j in range(N):
            out[i, j] = 0.0
    for k in range(N):
        for i in range(k + 1):
            v = work[k, i]
            for j in range(i + 1):
                out[i, j] += v * work[k, j]
    for i in range(N):
        for j in range(i):
            out[j, i] = out[i, j]


@inline
def solve_one(u, x):
    """x (N,) becomes (u^T u)^-1 x."""
    for k in range(N):
        x[k] /= u[k, k]
        v = x[k]
        for i in range(k + 1, N):
            x[i] -= u[k, i] * v
    for k in range(N - 1, -1, -1):
        v = x[k]
        for i in range(k + 1, N):
            v -= u[k, i] * x[i]
        x[k] = v / u[k, k]


@inline
def subtract_square(w, a):
    """a -= w^T w, both triangles, for w (N, N)."""
    for k in range(0, N, 2):
        for i in range(N):
            u, v = w[k, i], w[k + 1, i]
            for j in range(i, N):
                a[i, j] -= u * w[k, j] + v * w[k + 1, j]
    for i in range(N):
        for j in range(i):
            a[i, j] = a[j, i]


@inline
def multiply(a, b, out):
    """out = a b, by blocks of two rows and two columns, which saves most loads and stores."""
    for i in range(0, N, 2):
        for j in range(N):
            out[i, j] = out[i + 1, j] = 0.0
        for k in range(0, N, 2):
            a00, a01, a10, a11 = a[i, k], a[i, k + 1], a[i + 1, k], a[i + 1, k + 1]
            for j in range(N):
                x, y = b[k, j], b[k + 1, j]
                out[i, j] += a00 * x + a01 * y
                out[i + 1, j] += a10 * x + a11 * y


@inline
def apply_matrix(a, x, out):
    """out = a x."""
    for i in range(N):
        v = 0.0
        for j in range(N):
            v += a[i, j] * x[j]
        out[i] = v


@inline
def hold_faces(s, h, x):
    """Hold a pose's system h step = x to the limits' active faces, which are in the buffer.

    A saddle on its ellipse moves along the tangent; a hinge at its bound not at all. Returns
    whether there is any.
    """
    faces = False
    for f in range(5):
        k = 4 * f
        if s[FREE_N + f] == 0.0 or s[FREE_T + f] == 0.0:
            faces = True
            c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
            for j in range(N):
                z, y = h[k, j], h[k + 1, j]
                h[k, j], h[k + 1, j] = c * z + n * y, c * y - n * z
            for j in range(N):
                z, y = h[j, k], h[j, k + 1]
                h[j, k], h[j, k + 1] = c * z + n * y, c * y - n * z
            z, y = x[k], x[k + 1]
            x[k], x[k + 1] = c * z + n * y, c * y - n * z
            h[k + 1, k + 1] += s[CURVE + f]
            if s[FREE_T + f] == 0.0:
                hold(h, x, k + 1)
            hold(h, x, k)
        if s[FREE_2 + f] == 0.0:
            faces = True
            hold(h, x, k + 2)
        if s[FREE_3 + f] == 0.0:
            faces = True
            hold(h, x, k + 3)
    return faces


@inline
def hold(h, x, k):
    for j in range(N):
        h[k, j] = h[j, k] = 0.0
    h[k, k] = 1.0
    x[k] = 0.0


@inline
def leave_faces(s, x):
    """The step of the angles from the faces' directions to angles, in x and in STEP."""
    for f in range(5):
        k = 4 * f
        if s[FREE_N + f] == 0.0 or s[FREE_T + f] == 0.0:
            c, n = s[NORMAL_Z + f], s[NORMAL_Y + f]
            z, y = x[k], x[k + 1]
            x[k], x[k + 1] = c * z - n * y, n * z + c * y
        for i in range(4):
            s[STEP_Z + i * LANES + f] = x[k + i]
