"""Small dense symmetric systems: loops over rows that the compiler turns into vectors.

Matrices are square with as many rows as a pose has unknowns unless said otherwise; only what a
docstring names is written.

Elimination stands three times, because one for every size is slower where it counts: `ldl4`, of
which the compiler keeps a finger's in registers for all fingers at once, takes half the time of
loops over any size (36 and 70 ns for eight); `arrowhead.factor_root` eliminates the gradient with
its 6 x 6 (25 and 34 ns), and `factor` scales its rows on the way (1.3 and 1.6 us for 26 x 26).
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.workspace import N_POSE as N


@inline
def ldl4(a, least):
    """L D L^T of a symmetric 4 x 4 matrix, its pivots no smaller than `least` (4).

    Args:
        a: its upper triangle, row by row.

    Returns:
        pivots D (4), what they were before they were lifted, and L below its diagonal, column
        by column.
    """
    (a00, a01, a02, a03), (a11, a12, a13), (a22, a23), a33 = a
    d0 = max(a00, least[0])
    l1, l2, l3 = a01 / d0, a02 / d0, a03 / d0
    b11, b12, b13 = a11 - l1 * a01, a12 - l1 * a02, a13 - l1 * a03
    b22, b23, b33 = a22 - l2 * a02, a23 - l2 * a03, a33 - l3 * a03
    d1 = max(b11, least[1])
    m2, m3 = b12 / d1, b13 / d1
    c22, c23, c33 = b22 - m2 * b12, b23 - m2 * b13, b33 - m3 * b13
    d2 = max(c22, least[2])
    n3 = c23 / d2
    e33 = c33 - n3 * c23
    pivots = d0, d1, d2, max(e33, least[3])
    return pivots, (a00, b11, c22, e33), ((l1, l2, l3), (m2, m3), n3)


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
        u[k, k] = d * inverse
        for j in range(k + 1, N):
            u[k, j] *= inverse
        for i in range(k + 1, N):
            v = u[k, i]
            for j in range(i, N):
                u[i, j] -= v * u[k, j]
    return log


@inline
def is_lifted(a, u):
    """Whether a pivot of `factor` was lifted, so that u is not the factor of a."""
    lifted = False
    for k in range(N):
        lifted = lifted or not u[k, k] * u[k, k] > 1.01e-14 * abs(a[k, k]) + 1e-300
    return lifted


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
    """out = a b, for b of any width.

    By blocks of two rows and two columns, which saves most loads and stores.
    """
    columns = b.shape[1]
    for i in range(0, N, 2):
        for j in range(columns):
            out[i, j] = out[i + 1, j] = 0.0
        for k in range(0, N, 2):
            a00, a01, a10, a11 = a[i, k], a[i, k + 1], a[i + 1, k], a[i + 1, k + 1]
            for j in range(columns):
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
