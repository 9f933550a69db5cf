"""The nails of the default hand: a plate set into the back of each fingertip's mesh.

The quads under a nail are drawn in from their border, and what is drawn in is lifted onto a
slightly arched plate; the strip of quads between is the nail's edge. Lengths are in millimetres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tools.make.hand_fields import Tube
from tools.make.hand_mesh import Ints, Mesh
from tools.make.hand_shape import HandShape

Array = NDArray[np.float64]

WIDTH = 0.68
"""Of a nail, in parts of the finger's."""
# its outline, row by row from the root: width, and how far it goes round (in widths)
ROWS = np.array([(0.82, 0.30), (1.0, 0.12), (0.90, -0.08), (0.62, -0.30)])
ROOT, FRONT = 1.1, 0.79
"""From the first row [mm], and where on the rounded end the nail stops."""
LIFT = (0.3, 0.55)
"""Above the skin, at the root and at the front [mm]."""
ARCH = 0.8
"""Of the skin's own arch across the finger."""


def add_nails(mesh: Mesh, shape: HandShape) -> None:
    """Set a nail into every fingertip of a mesh that is finished otherwise, in place.

    A grid of `mesh.nails` goes from root to front and from the radial side over the back.
    """
    for finger, grid in sorted(mesh.nails.items()):
        _add_nail(mesh, shape.fingers[finger], finger, grid)


def _add_nail(mesh: Mesh, tube: Tube, finger: int, grid: Ints) -> None:
    covered = {frozenset(q) for q in _quads(grid)}
    mesh.quads = [q for q in mesh.quads if frozenset(q) not in covered]
    edge = np.ones(grid.shape, dtype=bool)
    edge[1:-1, 1:-1] = False
    points = tube.origin + _plate(mesh, tube, grid) @ tube.frame
    plate = grid.copy()
    plate[edge] = mesh.add(points[edge], finger)
    mesh.vertices[plate[~edge]] = points[~edge]
    mesh.patch(plate)
    outer, inner = _border(grid), _border(plate)
    mesh.patch(np.stack([np.append(outer, outer[0]), np.append(inner, inner[0])]))


def _plate(mesh: Mesh, tube: Tube, grid: Ints) -> Array:
    """(4, C, 3) points of the nail as axial, side and dorsal coordinates."""
    t = tube.local(mesh.vertices[grid[:, grid.shape[1] // 2]])[:, 0]
    half = WIDTH * float(tube.radii(t[:1])[0, 0])
    rows = np.interp(t, t[[0, -1]], [t[0] + ROOT, tube.end + FRONT * tube.caps[1]])
    u = np.linspace(1, -1, grid.shape[1])
    side = ROWS[:, :1] * half * np.sin(u * np.pi / 2)[None, :]
    along = rows[:, None] + ROWS[:, 1:] * half * u**2
    top = [_skin(tube, t[0], 0.0) + LIFT[0], _skin(tube, t[-1], 0.0) + LIFT[1]]
    arch = ARCH * (_skin(tube, t[0], 0.0) - _skin(tube, t[0], half))
    up = np.interp(along, rows[[0, -1]], top) - arch * (side / half) ** 2
    return np.stack([along, side, up], -1)


def _skin(tube: Tube, t: float, side: float) -> float:
    """Height of the skin's back above the axis."""
    width, dorsal, _ = tube.radii(np.array([min(t, tube.end)]))[0]
    s = max(t - tube.end, 0.0) / tube.caps[1]
    left = max(1 - s**tube.power - (side / width) ** tube.power, 0.0)
    return float(dorsal * left ** (1 / tube.power))


def _border(grid: Ints) -> Ints:
    """The vertices around a grid, once around."""
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


def _quads(grid: Ints) -> list[tuple[int, ...]]:
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return [tuple(q) for q in np.stack([a, b, c, d], -1).reshape(-1, 4).tolist()]
