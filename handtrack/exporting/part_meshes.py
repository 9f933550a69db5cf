"""A hand's skin cut into rigid, closed pieces, one for each moving part; STL."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_PARTS, PART_JOINT

Array = NDArray[np.float64]

_ENOUGH = 0.1
"""Of a triangle's weights: a part that has so much of it takes it too."""
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("about", "<u2")])
"""A triangle of a binary STL file."""


class Mesh(NamedTuple):
    """A closed surface.

    Attributes:
        vertices: (V, 3) [m].
        faces: (F, 3) counter-clockwise from outside.
    """

    vertices: Array
    faces: NDArray[np.int64]


def part_meshes(model: HandModel) -> list[Mesh | None]:
    """The skin of each of the 16 moving parts, about the part's own joint at rest.

    A triangle goes with every part that moves enough of it, so that neighbours overlap where
    they bend; where the skin was cut the hole is closed by a fan about its middle. None for a
    part without skin.
    """
    if not len(model.faces):
        return [None] * N_PARTS
    moved = model.weights[model.faces].mean(1)
    belongs = moved >= np.minimum(_ENOUGH, moved.max(1))[:, None]
    made: list[Mesh | None] = []
    for part in range(N_PARTS):
        faces = model.faces[belongs[:, part]].astype(np.int64)
        if not len(faces):
            made.append(None)
            continue
        used, inside = np.unique(faces, return_inverse=True)
        vertices = model.rest_vertices[used] - model.rest_joints[PART_JOINT[part]]
        made.append(_closed(vertices, inside.reshape(-1, 3)))
    return made


def _closed(vertices: Array, faces: NDArray[np.int64]) -> Mesh:
    """The surface with a fan in each of its holes."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = {(int(a), int(b)) for a, b in edges}
    rim = [(a, b) for a, b in there if (b, a) not in there]
    hole = _holes(rim)
    points, more = [vertices], []
    for number in sorted(set(hole.values())):
        around = sorted(v for v, h in hole.items() if h == number)
        middle = len(vertices) + number
        points.append(vertices[around].mean(0)[None])
        more += [(b, a, middle) for a, b in sorted(rim) if hole[a] == number]
    return Mesh(np.concatenate(points), np.concatenate([faces, np.array(more, int).reshape(-1, 3)]))


def _holes(rim: list[tuple[int, int]]) -> dict[int, int]:
    """The number of its hole for each vertex of a rim: 0, 1, ..."""
    beside: dict[int, list[int]] = {}
    for a, b in rim:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    found: dict[int, int] = {}
    number = 0
    for start in sorted(beside):
        if start in found:
            continue
        waiting = [start]
        while waiting:
            vertex = waiting.pop()
            if vertex not in found:
                found[vertex] = number
                waiting += beside[vertex]
        number += 1
    return found


def write_stl(mesh: Mesh, path: Path) -> None:
    """Write a surface as binary STL."""
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    facets = np.zeros(len(corners), _FACET)
    facets["normal"] = normal / np.where(length > 0, length, 1)
    facets["corners"] = corners
    head = b"handtrack".ljust(80, b" ") + len(facets).to_bytes(4, "little")
    path.write_bytes(head + facets.tobytes())
