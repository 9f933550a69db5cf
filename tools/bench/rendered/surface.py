"""What the rasteriser needs of a hand: normals, and where each vertex lies on its finger.

Patterns (creases, nails, knuckles) are looked up on the mean right hand's rest pose, so that they
go with the skin whatever the shape, the side and the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

import handtrack as ht
from handtrack.hand.skeleton import Hand
from tools.bench.rendered.raster import Mesh

Array = NDArray[np.float64]

BONES_MM_AWAY = 60.0
"""What counts as far from a metacarpal [mm]."""


def vertex_normals(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """(V, 3) unit normals, of the faces around a vertex by their areas."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    across = np.cross(b - a, c - a)
    n = len(faces)
    ones, columns = np.ones(3 * n), np.repeat(np.arange(n), 3)
    touches = sparse.csr_matrix((ones, (faces.ravel(), columns)), shape=(len(vertices), n))
    sums = np.asarray(touches @ across)
    return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12))


@dataclass(frozen=True, eq=False)
class SkinPattern:
    """Where the vertices of the default hand lie.

    Attributes:
        rest: (V, 3) on the mean right hand [mm].
        local: (V, 3) along the finger from its base, across it, and towards its back [mm].
        finger: (V,) 0..4, or -1 for the palm.
        joints: (5, 4) where base, hinges and tip lie along each finger [mm].
        half: (5,) half the width of each last bone [mm].
    """

    rest: Array
    local: Array
    finger: Array
    joints: Array
    half: Array


def skin_pattern(hand: Hand) -> SkinPattern:
    """The pattern of the default hand, "left" or "right"."""
    mean = ht.HandModel.default(hand)
    rest, joints = 1e3 * mean.rest_vertices, 1e3 * mean.rest_joints
    part = mean.weights.argmax(1)
    finger = np.where(part == 0, -1, (part - 1) // 3)
    local = np.empty_like(rest)
    along, half = np.empty((5, 4)), np.empty(5)
    for f in range(5):
        chain = joints[4 * f + 1 : 4 * f + 5]
        along[f] = np.concatenate(
            [[0.0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))]
        )
        for i in range(3):
            mine = part == 1 + 3 * f + i
            axis = mean.axes[4 * f + (0 if i == 0 else 1 + i)]
            local[mine] = _in_bone(rest[mine], chain[i], chain[i + 1], axis)
            local[mine, 0] += along[f, i]
        last = part == 3 + 3 * f
        half[f] = np.percentile(np.abs(local[last, 1]), 90)
    local[part == 0] = _on_palm(rest[part == 0], joints)
    rest = rest * [1.0, -1.0 if hand == "left" else 1.0, 1.0]
    return SkinPattern(rest, local, finger.astype(np.float64), along, half)


def _in_bone(points: Array, start: Array, end: Array, axis: Array) -> Array:
    x = (end - start) / np.linalg.norm(end - start)
    back = -np.cross(axis, x)  # positive flexion turns the bone away from here
    back /= np.linalg.norm(back)
    return np.asarray((points - start) @ np.stack([x, np.cross(back, x), back], 1))


def _on_palm(points: Array, joints: Array) -> Array:
    """Along the hand, distance from the nearest of four metacarpals, and height over the palm."""
    best = np.full(len(points), BONES_MM_AWAY)
    for base in (5, 9, 13, 17):
        x = joints[base] - [15.0, 0.4 * joints[base, 1], 0.0]
        across = (points[:, 1] - 0.4 * joints[base, 1]) * x[0] - (points[:, 0] - 15.0) * (
            joints[base, 1] - 0.4 * joints[base, 1]
        )
        off = np.abs(across) / np.hypot(x[0], 0.6 * joints[base, 1])
        best = np.minimum(best, off)
    height = points[:, 2] - np.interp(points[:, 0], [0.0, 95.0], [0.0, 2.0])
    return np.stack([points[:, 0], best, height], 1)


def hand_mesh(model: ht.HandModel, pattern: SkinPattern, vertices: Array) -> Mesh:
    """The posed skin of a default hand with its pattern."""
    normals = vertex_normals(vertices, model.faces)
    return Mesh(vertices, normals, model.faces, pattern.rest, pattern.local, pattern.finger)


# ---- forearm and sleeve: tubes about a curve from inside the hand to the elbow ----

AROUND = 40
_BACK_MM = np.array([-8.0, -2, 6, 14, 24, 36, 50, 70, 95, 125, 160, 200, 240, 300, 400, 900])
_WIDE_MM = np.array([23.0, 27, 28.4, 28.4, 28, 28, 28.5, 30, 32.5, 36, 40, 43, 44, 45, 45, 44])
_THICK_MM = np.array([13.0, 16.5, 18, 18.2, 18.2, 18.5, 19, 21, 25, 30, 34, 37, 38, 39, 40, 40])
_HIGH_MM = np.array([1.0, 1.0, 1.0, 0.6, 0.2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0])


def forearm(
    rotation: Array,
    wrist: Array,
    arm: Array,
    scale: float,
    sleeve_mm: float | None = None,
    loose_mm: float = 5.0,
) -> Mesh:
    """A forearm, or the sleeve around it.

    Args:
        rotation: (3, 3) of the hand's root frame.
        wrist: (3,) [m].
        arm: (3,) unit vector from the wrist to the elbow, in the world.
        scale: of the hand, against the mean one.
        sleeve_mm: how far behind the wrist a sleeve begins; None is the arm itself.
        loose_mm: how far the sleeve stands off the arm.
    """
    back, wide, thick, high = _BACK_MM, _WIDE_MM, _THICK_MM, _HIGH_MM
    if sleeve_mm is not None:
        own = np.concatenate([sleeve_mm + np.array([0.5, 0.0, 1.0, 12.0, 13.0]), back])
        own = np.unique(own[own >= sleeve_mm])
        stand = loose_mm * np.minimum(1.0, 0.75 + (own - sleeve_mm) / 60.0)
        stand[0] = -1.0
        wide, thick = np.interp(own, back, wide) + stand, np.interp(own, back, thick) + stand
        high, back = np.interp(own, back, high), own
    middle, ways = _spine(rotation, arm, back)
    side = rotation[:, 1] - (ways @ rotation[:, 1])[:, None] * ways
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, ways)
    up *= np.sign(up @ rotation[:, 2])[:, None]
    turn = np.linspace(0.0, 2 * np.pi, AROUND + 1)
    c, s = np.cos(turn), np.sin(turn)
    c, s = np.sign(c) * np.abs(c) ** 0.85, np.sign(s) * np.abs(s) ** 0.85
    y = wide[:, None] * c
    z = thick[:, None] * s + high[:, None]
    points = middle[:, None] + y[..., None] * side[:, None] + z[..., None] * up[:, None]
    rest = np.stack(np.broadcast_arrays(-back[:, None], y, z), -1).reshape(-1, 3)
    vertices = wrist + 1e-3 * scale * points.reshape(-1, 3)
    faces = _grid(len(back), AROUND + 1)
    normals = vertex_normals(vertices, faces).reshape(len(back), -1, 3)
    seam = normals[:, 0] + normals[:, -1]
    normals[:, 0] = normals[:, -1] = seam / np.linalg.norm(seam, axis=1, keepdims=True)
    zeros = np.zeros_like(rest)
    return Mesh(vertices, normals.reshape(-1, 3), faces, rest, zeros, np.full(len(rest), -1.0))


def _spine(rotation: Array, arm: Array, back: Array) -> tuple[Array, Array]:
    """Where the arm's middle is behind the wrist [mm], and which way it goes on, both (n, 3).

    The direction turns from the hand's own to the arm's over 5 cm.
    """
    dense = np.union1d(_BACK_MM, np.arange(_BACK_MM[0], 60.0, 4.0))
    share = np.clip((dense + 6.0) / 48.0, 0.0, 1.0)
    share = share * share * (3 - 2 * share)
    ways = (1 - share[:, None]) * -rotation[:, 0] + share[:, None] * arm
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    steps = np.diff(dense)[:, None] * 0.5 * (ways[1:] + ways[:-1])
    middle = dense[0] * -rotation[:, 0] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, 0)])
    at = [np.stack([np.interp(back, dense, c) for c in x.T], 1) for x in (middle, ways)]
    return at[0], at[1] / np.linalg.norm(at[1], axis=1, keepdims=True)


def _grid(rows: int, columns: int) -> NDArray[np.int32]:
    i = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]
    return (
        np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3).astype(np.int32)
    )
