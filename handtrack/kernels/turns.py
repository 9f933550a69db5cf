"""Rotation matrices about axes, for Python: Rodrigues' formula as the kernels have it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from handtrack.kernels.compiled import kernel
from handtrack.kernels.vectors import put_column, rotate, row

Array = NDArray[np.float64]

_UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def turn_all(axes, angles, out):
    """`turns_about` of rotations in one row."""
    for n in range(len(angles)):
        axis, c, s = row(axes, n), math.cos(angles[n]), math.sin(angles[n])
        for k in range(3):
            put_column(out[n], k, rotate(axis, c, s, _UNITS[k]))


def turns_about(axis: Array, angle: Array) -> Array:
    """Rotation matrices (..., 3, 3) about unit axes (..., 3) by angles (...) [rad]."""
    lead = np.broadcast_shapes(axis.shape[:-1], angle.shape)
    out = np.empty((math.prod(lead), 3, 3))
    # copies: one type of arrays, so that one machine code does
    axes = np.array(np.broadcast_to(axis, (*lead, 3)), order="C").reshape(-1, 3)
    turn_all(axes, np.array(np.broadcast_to(angle, lead), order="C").reshape(-1), out)
    return out.reshape(*lead, 3, 3)
