"""Limits of the angles: a box for the hinges, an ellipse per quadrant for a saddle (eq. 3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    FINGERS,
    FLEXION,
    HINGE_1,
    LANES,
)

Array = NDArray[np.float64]


@inline
def saddle_limits(w, f):
    """Lower and upper flexion, lower and upper abduction of finger f."""
    return w.lower[FLEXION, f], w.upper[FLEXION, f], w.lower[ABDUCTION, f], w.upper[ABDUCTION, f]


@inline
def semi_axes(limits, z, y):
    """Semi-axes of the ellipse in the quadrant of (z, y)."""
    return limits[1] if z >= 0.0 else -limits[0], limits[3] if y >= 0.0 else -limits[2]


@inline
def inside_ellipse(limits, z, y):
    """Whether a saddle's angles keep their limits."""
    a, b = semi_axes(limits, z, y)
    p, q = z / a, y / b
    return p * p + q * q <= 1.0


@inline
def inverse_squares(w, f, z, y):
    """1/a^2 and 1/b^2 of finger f's ellipse in the quadrant of (z, y)."""
    a, b = semi_axes(saddle_limits(w, f), z, y)
    return 1.0 / (a * a), 1.0 / (b * b)


@inline
def clip(x, lower, upper):
    return min(max(x, lower), upper)


@inline
def move_inside(w):
    """Bring the pose's angles inside their limits, to the last digit."""
    for a in range(HINGE_1, ANGLES):
        for f in range(LANES):
            w.angle[a, f] = clip(w.angle[a, f], w.lower[a, f], w.upper[a, f])
    for f in range(FINGERS):
        z, y = w.angle[FLEXION, f], w.angle[ABDUCTION, f]
        pz, py = inverse_squares(w, f, z, y)
        n = math.sqrt(z * z * pz + y * y * py)
        if n > 1.0:
            w.angle[FLEXION, f], w.angle[ABDUCTION, f] = z / n, y / n


@inline
def nearest_on_ellipse(limits, z, y):
    """Nearest point of the ellipse to angles outside it, by Newton-Raphson.

    The root t of (a z / (a^2 + t))^2 + (b y / (b^2 + t))^2 = 1 gives the point
    (a^2 z / (a^2 + t), b^2 y / (b^2 + t)); the iteration climbs to it from below.
    """
    a, b = semi_axes(limits, z, y)
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


@kernel
def clamp_all(lower, upper, angles):
    """`clamp_poses` of poses in one row, in place."""
    for n in range(len(angles)):
        for k in range(0, ANGLES * FINGERS, ANGLES):
            z, y = angles[n, k + FLEXION], angles[n, k + ABDUCTION]
            bounds = lower[k], upper[k], lower[k + ABDUCTION], upper[k + ABDUCTION]
            for a in range(k, k + ANGLES):
                # a NaN is neither below nor above
                if angles[n, a] < lower[a]:
                    angles[n, a] = lower[a]
                elif angles[n, a] > upper[a]:
                    angles[n, a] = upper[a]
            if not (math.isnan(z) or math.isnan(y) or inside_ellipse(bounds, z, y)):
                angles[n, k + FLEXION], angles[n, k + ABDUCTION] = nearest_on_ellipse(bounds, z, y)


def clamp_poses(lower: Array, upper: Array, angles: Array) -> Array:
    """Nearest valid angles of any number of poses, called from Python.

    Args:
        lower, upper: (20,) [rad]; angles: (..., 20) [rad]. A hinge is clipped, a saddle moved to
            the nearest point of its ellipse; a NaN stays, the other angles of its finger are
            clipped.
    """
    out = np.array(angles, dtype=np.float64, order="C")
    # copies: one type of arrays, so that one machine code does
    clamp_all(np.array(lower), np.array(upper), out.reshape(-1, ANGLES * FINGERS))
    return out
