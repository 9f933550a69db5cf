"""The paper's own block updates: Procrustes, Euler angles, projection (Li et al. 2021, eq. 8, 9).

Compiled apart, as only those who ask for them need them.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.descent import descent, finger_pass
from handtrack.kernels.limits import clip, inside_ellipse, nearest_on_ellipse
from handtrack.kernels.procrustes import procrustes
from handtrack.kernels.vectors import ZERO3, apply, cross, dot, outer_sum, scale, sub


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
    m = ZERO3
    for i in range(3):
        m = outer_sum(m, w[i], t[i], a[i])
    z, y = euler_zy(procrustes(m), nz, ny)
    if not inside_ellipse(limits, z, y):
        z, y = nearest_on_ellipse(limits, z, y)
    return z, y


@inline
def hinge_li2021(n, w, t, a, lower, upper, current):
    """Angle of a hinge: Procrustes, the bone's direction seen along the axis, clamped."""
    r = procrustes(outer_sum(outer_sum(ZERO3, w[0], t[0], a[0]), w[1], t[1], a[1]))
    x = sub(a[0], scale(dot(a[0], n), n))
    v = apply(r, a[0])
    phi = math.atan2(dot(v, cross(n, x)), dot(v, x))
    return clip(phi, lower, upper)


_descend = descent(finger_pass(saddle_li2021, hinge_li2021))


@Solver
def bcd_li2021(w):
    """Algorithm 1 with the paper's updates; the workspace as for `descent.bcd_exact`."""
    _descend(w)
