"""The paper's own block updates: Procrustes, Euler angles, projection (Li et al. 2021, eq. 8, 9).

Compiled apart, as only those who ask for them need them.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import Solver, inline
from handtrack.fitting.descent import descent, finger_pass, inside_ellipse, semi_axis
from handtrack.fitting.procrustes import ZERO3, outer_sum, procrustes
from handtrack.fitting.vectors import apply, cross, dot, scale, sub


@inline
def project_to_ellipse(z, y, lz, uz, ly, uy):
    """Nearest point of the ellipse to angles outside it, by Newton-Raphson.

    The root t of (a z / (a^2 + t))^2 + (b y / (b^2 + t))^2 = 1 gives the point
    (a^2 z / (a^2 + t), b^2 y / (b^2 + t)); the iteration climbs to it from below.
    """
    a = semi_axis(lz, uz, z >= 0.0)
    b = semi_axis(ly, uy, y >= 0.0)
    az, by = a * z, b * y
    t = max(math.sqrt(az * az + by * by) - max(a, b) ** 2, 0.0)
    for _ in range(60):
        da, db = a * a + t, b * b + t
        p, q = az / da, by / db
        g = p * p + q * q - 1.0
        step = g / (2.0 * (p * p / da + q * q / db))
        if step <= 1e-15 * (1.0 + t):
            break
        t += step
    z, y = a * a * z / (a * a + t), b * b * y / (b * b + t)
    p, q = z / a, y / b
    n = math.sqrt(p * p + q * q)
    return (z / n, y / n) if n > 1.0 else (z, y)


@inline
def euler_zy(r, nz, ny):
    """Angles (z, y) of a rotation taken as exp(n_z z) exp(n_y y) (eq. 8, 9).

    The axis perpendicular to both, x = n_y x n_z, is turned to
    x cos(z) cos(y) + n_y sin(z) cos(y) - n_z sin(y).
    """
    x = cross(ny, nz)
    v = apply(r, x)
    return math.atan2(dot(v, ny), dot(v, x)), math.asin(min(1.0, max(-1.0, -dot(v, nz))))


@inline
def saddle_li2021(nz, ny, w, t, a, z, y, limits):
    """Angles of a saddle: Procrustes, Euler angles, nearest point of the ellipse."""
    m = outer_sum(outer_sum(ZERO3, w[0], t[0], a[0]), w[1], t[1], a[1])
    z, y = euler_zy(procrustes(outer_sum(m, w[2], t[2], a[2])), nz, ny)
    lz, uz, ly, uy = limits
    if not inside_ellipse(z, y, lz, uz, ly, uy):
        z, y = project_to_ellipse(z, y, lz, uz, ly, uy)
    return z, y


@inline
def hinge_li2021(n, w, t, a, lower, upper, current):
    """Angle of a hinge: Procrustes, the bone's direction seen along the axis, clamped."""
    r = procrustes(outer_sum(outer_sum(ZERO3, w[0], t[0], a[0]), w[1], t[1], a[1]))
    x = sub(a[0], scale(dot(a[0], n), n))
    v = apply(r, a[0])
    phi = math.atan2(dot(v, cross(n, x)), dot(v, x))
    return min(max(phi, lower), upper)


_descend = descent(finger_pass(saddle_li2021, hinge_li2021))


@Solver
def bcd_li2021(s):
    """Algorithm 1 with the paper's updates; the buffer as for `descent.bcd_exact`."""
    _descend(s)
