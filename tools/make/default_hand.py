"""Make the free hand that ships with the project: `handtrack/hand/default_hand.npz`.

    python -m tools.make.default_hand [output.npz]

Bone lengths are the published means of adult hands; how the palm's bones lie, the joints' axes
and the shape of the skin are our own. The result is the right hand at rest, in metres: the
wrist is the origin, x points to the fingertips, y to the thumb's side, z out of the back.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.axes import local_axes
from handtrack.hand.skeleton import FINGERS, N_ANGLES, N_JOINTS, N_PARTS
from tools.make.hand_fields import smoothstep
from tools.make.hand_mesh import Mesh, build_mesh
from tools.make.hand_nails import add_nails
from tools.make.hand_shape import HandShape

Array = NDArray[np.float64]

OUTPUT = Path(__file__).parents[2] / "handtrack" / "hand" / "default_hand.npz"

# Mean lengths of the bones of adult hands [mm]: metacarpal, proximal, middle (none in the
# thumb), distal, and the pulp beyond the distal bone. Buryanov A., Kotiuk V. (2010),
# "Proportions of hand segments", International Journal of Morphology 28(3), 755-758.
BONES_MM: dict[str, tuple[float, ...]] = {
    "thumb": (46.22, 31.57, 21.67, 5.67),
    "index": (68.12, 39.78, 22.38, 15.82, 3.84),
    "middle": (64.60, 44.63, 26.33, 17.40, 3.95),
    "ring": (58.00, 41.37, 25.65, 17.30, 3.95),
    "little": (53.69, 32.74, 18.11, 15.96, 3.73),
}

# our own: base of each metacarpal [mm], its direction (degrees towards the thumb, and dorsal),
# the finger's direction, and how far its palmar side leans towards the thumb
PALM: dict[str, tuple[tuple[float, float, float], tuple[float, float], float, float]] = {
    "index": ((28, 11, 3), (10, 0), 4, -0.10),
    "middle": ((30, 0, 5), (1, 0), 0, 0.0),
    "ring": ((28, -10, 4), (-9, 0), -5, 0.12),
    "little": ((25, -19, 1), (-18, -3), -11, 0.25),
}
THUMB_BASE = (24.0, 22.0, -10.0)
THUMB_DIRECTION = (0.72, 0.58, -0.38)


def _unit(v: object) -> Array:
    v = np.asarray(v, dtype=np.float64)
    return np.asarray(v / np.linalg.norm(v))


def _direction(towards_thumb: float, dorsal: float = 0.0) -> Array:
    a, b = np.deg2rad(towards_thumb), np.deg2rad(dorsal)
    return np.array([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)])


def make_skeleton() -> tuple[Array, Array, Array]:
    """The right hand's rest skeleton.

    Returns:
        joints (21, 3) [mm], axes (20, 3) and the bases of the metacarpals of index..little
        (4, 3) [mm].
    """
    joints, axes = np.zeros((N_JOINTS, 3)), np.zeros((N_ANGLES, 3))
    bases = np.array([PALM[f][0] for f in FINGERS[1:]], dtype=np.float64)
    for i, finger in enumerate(FINGERS):
        bones = BONES_MM[finger]
        k = 1 + 4 * i
        if finger == "thumb":
            joints[k], x, palmar = THUMB_BASE, _unit(THUMB_DIRECTION), np.array([0, 0, -1.0])
            lengths: tuple[float, ...] = (*bones[:2], bones[2] + bones[3])
        else:
            base, metacarpal, direction, lean = PALM[finger]
            joints[k] = np.array(base) + bones[0] * _direction(*metacarpal)
            x, palmar = _direction(direction), np.array([0, lean, -1.0])
            lengths = (*bones[1:3], bones[3] + bones[4])
        for j, length in enumerate(lengths):
            joints[k + 1 + j] = joints[k + j] + length * x
        palmar = _unit(palmar - x * (palmar @ x))
        hinge = np.cross(x, palmar)
        axes[4 * i : 4 * i + 4] = [hinge, -palmar, hinge, hinge]
    # the thumb bends across the palm, as that of every other hand does that brings no axes
    axes[:4] = local_axes(joints, "right")[:4]
    return joints, axes, bases


def make_weights(mesh: Mesh, shape: HandShape) -> Array:
    """Skinning weights (V, 16).

    Along a finger they blend about each joint over about the finger's half thickness to either
    side. Fingers share no vertex, but in the webs the first bones of neighbours do, so that a
    web follows both.
    """
    v = mesh.vertices
    weights = np.zeros((len(v), N_PARTS))
    for f, tube in enumerate(shape.fingers):
        t, _, height = tube.local(v).T
        mine = mesh.owner == f
        chain = shape.joints[1 + 4 * f : 5 + 4 * f]
        first, second = np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=-1))[:2]
        if f == 0:
            follow = _thumb_follow(mesh, shape)
        else:
            # the thick flesh before the knuckle folds further out than the skin over it
            palmar = np.clip(-height / 10, 0, 1)
            follow = np.maximum(mine, mesh.share[:, f - 1])
            follow = follow * smoothstep((t + 6) / (13 + 5 * palmar))
        blend = 1.1 * float(tube.radii(np.array(first))[0])
        middle = np.where(mine, smoothstep((t - first) / blend + 0.5), 0)
        last = np.where(mine, smoothstep((t - second) / blend + 0.5), 0)
        part = 1 + 3 * f
        weights[:, part] = follow * (1 - middle)
        weights[:, part + 1] = follow * middle * (1 - last)
        weights[:, part + 2] = follow * middle * last
    _smooth_knuckles(mesh, weights)
    # thumb and index may both claim the skin between them
    weights /= np.maximum(weights.sum(1, keepdims=True), 1)
    weights[:, 0] = 1 - weights.sum(1)
    return weights


def _smooth_knuckles(mesh: Mesh, weights: Array) -> None:
    """Even out how the skin of the palm follows the first bones of index..little, in place."""
    start, end = mesh.neighbours()
    degree = np.bincount(start, minlength=len(weights))
    palm = mesh.owner == -1
    for _ in range(2):
        for column in weights.T[4::3]:
            mean = np.bincount(start, column[end], minlength=len(column)) / degree
            column[palm] = 0.5 * (column + mean)[palm]
            column[palm & (column < 0.01)] = 0


def _thumb_follow(mesh: Mesh, shape: HandShape) -> Array:
    """How far each vertex follows the thumb's first bone rather than the palm, (V,)."""
    v, joints = mesh.vertices, shape.joints
    own = _segment_distance(v, joints[1] + 0.25 * (joints[2] - joints[1]), joints[4])
    bones = [(np.array([-30.0, 8.0, 0.0]), np.array([18.0, 10.0, -4.0]))]  # forearm and carpus
    for f, base in enumerate(shape.metacarpal_bases, start=1):
        bones.append((base, joints[1 + 4 * f] + 14 * shape.fingers[f].frame[0]))
    palm = np.min([_segment_distance(v, a, b) for a, b in bones], axis=0)
    follow = smoothstep((palm - own + 6) / 22)
    others = mesh.owner > 0
    start, end = mesh.neighbours()
    degree = np.bincount(start, minlength=len(v))
    for _ in range(8):
        follow[others] = 0
        mean = np.bincount(start, follow[end], minlength=len(v)) / degree
        follow = 0.5 * (follow + mean)
    follow[others | (follow < 0.01)] = 0
    return np.asarray(np.where(follow > 0.99, 1, follow))


def _segment_distance(points: Array, a: Array, b: Array) -> Array:
    d = b - a
    t = np.clip((points - a) @ d / (d @ d), 0, 1)
    return np.asarray(np.linalg.norm(points - a - t[:, None] * d, axis=-1))


def make_hand() -> dict[str, NDArray[Any]]:
    """The arrays of `default_hand.npz`."""
    joints, axes, bases = make_skeleton()
    shape = HandShape(joints, axes, bases)
    mesh = build_mesh(shape)
    add_nails(mesh, shape)
    weights = make_weights(mesh, shape)
    # coarse steps keep the file small and the same on every machine
    weights[:, 1:] = np.round(weights[:, 1:], 3)
    weights[:, 0] = 1 - weights[:, 1:].sum(1)
    return {
        "rest_joints": joints / 1000,
        "axes": axes,
        "rest_vertices": (np.round(mesh.vertices, 3) / 1000).astype(np.float32),
        "faces": mesh.triangles(),
        "weights": np.abs(np.round(weights, 3)).astype(np.float32),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path, nargs="?", default=OUTPUT)
    path = parser.parse_args().output
    arrays = make_hand()
    np.savez_compressed(path, allow_pickle=False, **arrays)
    shapes = ", ".join(f"{name} {value.shape}" for name, value in arrays.items())
    print(f"{path}: {path.stat().st_size} bytes, {shapes}")


if __name__ == "__main__":
    main()
