"""A room to stand in: walls, floor and plain furniture, drawn once for each camera and blurred."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tools.bench.rendered.raster import Mesh

Array = NDArray[np.float64]

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
_SIDES = (
    ((0, 1, 3, 2), (-1, 0, 0)),
    ((4, 6, 7, 5), (1, 0, 0)),
    ((0, 4, 5, 1), (0, -1, 0)),
    ((2, 3, 7, 6), (0, 1, 0)),
    ((0, 2, 6, 4), (0, 0, -1)),
    ((1, 5, 7, 3), (0, 0, 1)),
)
PLAIN, WOOD, BOOKS, WOVEN, SHINING = range(5)


def _box(low: Array, size: Array, colour: Array, kind: int, inside: bool = False) -> Mesh:
    points, normals = [], []
    for corners, normal in _SIDES:
        points.append(low + _CORNERS[list(corners)] * size)
        normals.append(np.tile(np.array(normal) * (-1.0 if inside else 1.0), (4, 1)))
    vertices = np.concatenate(points)
    quads = np.arange(24).reshape(6, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    n = len(vertices)
    local = np.tile(colour, (n, 1))
    return Mesh(vertices, np.concatenate(normals), faces, vertices, local, np.full(n, float(kind)))


def _joined(meshes: list[Mesh]) -> Mesh:
    first = np.concatenate([[0], np.cumsum([len(m.vertices) for m in meshes])])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.faces + n for m, n in zip(meshes, first, strict=False)]).astype(np.int32),
        np.concatenate([m.rest for m in meshes]),
        np.concatenate([m.local for m in meshes]),
        np.concatenate([m.finger for m in meshes]),
    )


def room(rng: np.random.Generator) -> Mesh:
    """A furnished room around the origin; z is up, the cameras look along y [m]."""
    wall = rng.uniform(0.35, 0.8) * np.array([1.0, 0.97, 0.93]) * rng.uniform(0.85, 1.1, 3)
    size = np.array([rng.uniform(4, 6), rng.uniform(4, 6), 2.6])
    low = np.array([-size[0] / 2, -size[1] + rng.uniform(1.8, 3.2), -1.2])
    back = low[1] + size[1]
    things = [_box(low, size, wall, PLAIN, inside=True)]
    floor = rng.uniform(0.1, 0.4) * np.array([1.0, 0.75, 0.5])
    things.append(_box(low, np.array([size[0], size[1], 0.02]), floor, WOOD))
    for _ in range(rng.integers(8, 14)):
        x = rng.uniform(-2.2, 2.2)
        kind = int(rng.integers(6))
        colour = rng.uniform(0.05, 0.7) * rng.uniform(0.4, 1.0, 3)
        if kind == 0:  # shelf of books against the wall
            w, h = rng.uniform(0.6, 1.3), rng.uniform(0.8, 2.0)
            things.append(
                _box(np.array([x, back - 0.3, -1.2]), np.array([w, 0.3, h]), colour, BOOKS)
            )
        elif kind == 1:  # window or lamp
            w, h = rng.uniform(0.3, 1.1), rng.uniform(0.4, 1.1)
            glow = rng.uniform(0.5, 1.2) * np.array([0.95, 0.98, 1.0])
            place = np.array([x, back - 0.03, rng.uniform(-0.2, 0.6)])
            things.append(_box(place, np.array([w, 0.02, h]), glow, SHINING))
        elif kind == 2:  # picture on the wall
            place = np.array([x, back - 0.04, rng.uniform(-0.1, 0.7)])
            big = np.array([rng.uniform(0.2, 0.8), 0.03, rng.uniform(0.2, 0.6)])
            things.append(_box(place, big, colour, int(rng.choice([PLAIN, WOVEN]))))
        else:  # cupboard, table, sofa
            y = rng.uniform(0.7, back - 0.5)
            big = np.array([rng.uniform(0.3, 1.4), rng.uniform(0.3, 0.6), rng.uniform(0.4, 1.3)])
            surface = int(rng.choice([PLAIN, WOOD, WOVEN]))
            things.append(_box(np.array([x, y, -1.2]), big, colour, surface))
    return _joined(things)
