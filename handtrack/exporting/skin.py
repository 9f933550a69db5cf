"""What covers a hand in glTF: its skin with four weights a vertex, or tubes around the bones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.normals import VertexNormals
from handtrack.hand.skeleton import BONES, PART_JOINT

Array = NDArray[np.float64]

MOST = 4
"""Weights of a vertex: more are not drawn by many programs."""
_SIDES = 8
_RADIUS = 0.005  # of a bone [m]


class Skin(NamedTuple):
    """Triangles that move with joints.

    Attributes:
        vertices: (V, 3) at rest [m].
        normals: (V, 3) of unit length.
        faces: (F, 3).
        joints: (V, 4) numbers of the joints that move a vertex; 0 where the weight is 0.
        weights: (V, 4) that sum to one.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int32]
    joints: NDArray[np.int64]
    weights: Array


def skin(model: HandModel) -> tuple[Skin, str]:
    """The model's skin, and what had to be left of it, in words.

    A model without a skin (as the recording of a licensed one is) is drawn as bones.
    """
    if not len(model.rest_vertices):
        return _bones(model), f"the {model.name} model has no skin here: bones are drawn instead"
    order = np.argsort(-model.weights, axis=1, kind="stable")[:, :MOST]
    kept = np.take_along_axis(model.weights, order, 1)
    total = kept.sum(1, keepdims=True)
    weights = (kept / total).astype(np.float32).astype(np.float64)
    # float32 must sum to one as well as it can
    weights[:, 0] += 1 - weights.sum(1)
    joints = np.where(weights > 0, PART_JOINT[order], 0)
    note = ""
    if (least := float(total.min())) < 0.999:
        note = f"four weights are kept for each vertex, at least {100 * least:.0f} % of the whole"
    vertices = np.asarray(model.rest_vertices)
    return Skin(vertices, _normals(vertices, model.faces), model.faces, joints, weights), note


def _bones(model: HandModel) -> Skin:
    """A closed double cone around every bone, moved by the bone's first joint."""
    turn = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)[:, None]
    vertices, faces, joints = [], [], []
    for i, (parent, child) in enumerate(BONES):
        start, end = model.rest_joints[parent], model.rest_joints[child]
        along = (end - start) / np.linalg.norm(end - start)
        across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        across /= np.linalg.norm(across)
        ring = np.cos(turn) * across + np.sin(turn) * np.cross(along, across)
        vertices += [start + 0.2 * (end - start) + _RADIUS * ring, start[None], end[None]]
        first = i * (_SIDES + 2)
        for s in range(_SIDES):
            a, b = first + s, first + (s + 1) % _SIDES
            faces += [[b, a, first + _SIDES], [a, b, first + _SIDES + 1]]
        joints += [parent] * (_SIDES + 2)
    points, triangles = np.concatenate(vertices), np.array(faces, np.int32)
    moved = np.zeros((len(points), MOST), np.int64)
    moved[:, 0] = joints
    weights = np.tile([1.0, 0, 0, 0], (len(points), 1))
    return Skin(points, _normals(points, triangles), triangles, moved, weights)


def _normals(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """Unit normals; a vertex without a face has one too, as glTF wants."""
    normals = VertexNormals(faces, len(vertices))(vertices[None])[0].astype(np.float64)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(np.where(length > 0.5, normals / np.where(length > 0, length, 1), [0, 0, 1]))
