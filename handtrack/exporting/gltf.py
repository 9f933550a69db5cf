"""Tracks as binary glTF 2.0 (.glb): skinned hands that move."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.exporting.motion import Motion, offsets
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_quaternion
from handtrack.hand.skeleton import BONES, JOINT_NAMES, N_JOINTS, PARENTS, PART_JOINT, TIPS
from handtrack.hand.skinning import VertexNormals

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


# numbers of glTF 2.0, section 3.6 and 3.7
_FLOAT, _UBYTE, _USHORT, _UINT = 5126, 5121, 5123, 5125
_COMPONENTS = {"<f4": _FLOAT, "|u1": _UBYTE, "<u2": _USHORT, "<u4": _UINT}
_KINDS = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
_VERTICES, _TRIANGLES = 34962, 34963
_LARGEST = 2**32 - 1  # bytes in a .glb


class Hand(NamedTuple):
    """A hand in the file: its name, its model and how it moves."""

    name: str
    model: HandModel
    motion: Motion


def write_glb(hands: Sequence[Hand], path: Path, generator: str) -> str:
    """Write hands into one scene, in metres, y up, with one animation of all of them.

    Every hand is a skin on 21 joints: the wrist, which carries the whole hand, and the chains
    of the fingers with their tips. Bound in the rest pose (the flat hand, all frames
    parallel), so that each inverse bind matrix only moves the joint to the origin. Each frame
    is a key; between keys rotations go the short way round.

    A model without a skin gets a plain one around its bones, see `skin`.

    Returns:
        What was changed to fit the format, in words; else "".

    Raises:
        SettingsError: there are more frames than times in float32 can tell apart, or than a
            file can hold.
    """
    made = _Document(generator)
    notes = [made.hand(hand) for hand in hands]
    made.write(path)
    return "; ".join(dict.fromkeys(filter(None, notes)))


class _Document:
    """A glTF document that grows, and the bytes that it describes."""

    def __init__(self, generator: str) -> None:
        self._blocks: list[bytes] = []
        self._size = 0
        self._gltf: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": generator},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "skins": [],
            "materials": [],
            "animations": [{"name": "track", "channels": [], "samplers": []}],
            "accessors": [],
            "bufferViews": [],
        }

    def hand(self, hand: Hand) -> str:
        """Add a hand; what had to be changed, in words."""
        nodes = self._gltf["nodes"]
        first = len(nodes)
        rest = offsets(hand.model)
        for joint, name in enumerate(JOINT_NAMES):
            at = hand.model.rest_joints[0] if joint == 0 else rest[joint]
            node: dict[str, Any] = {"name": f"{hand.name}_{name}", "translation": at.tolist()}
            if joint not in TIPS:
                node["children"] = (first + np.flatnonzero(joint == PARENTS)).tolist()
            nodes.append(node)
        cover, note = skin(hand.model)
        mesh = self._mesh(hand.name, cover)
        bind = np.tile(np.eye(4), (N_JOINTS, 1, 1))
        bind[:, :3, 3] = -hand.model.rest_joints
        # glTF's matrices stand column by column
        inverse = self._accessor(bind.swapaxes(1, 2).astype("<f4"))
        joints = list(range(first, first + N_JOINTS))
        self._gltf["skins"].append(
            {"name": hand.name, "joints": joints, "skeleton": first, "inverseBindMatrices": inverse}
        )
        nodes.append(
            {"name": f"{hand.name}_skin", "mesh": mesh, "skin": len(self._gltf["skins"]) - 1}
        )
        # the root joint's parent is what programs call the armature
        nodes.append({"name": hand.name, "children": [first]})
        self._gltf["scenes"][0]["nodes"] += [len(nodes) - 1, len(nodes) - 2]
        self._animate(hand.motion, first)
        return note

    def _mesh(self, name: str, cover: Skin) -> int:
        material = {
            "name": f"{name}_skin",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.76, 0.45, 0.31, 1.0],  # linear
                "metallicFactor": 0.0,
                "roughnessFactor": 0.65,
            },
        }
        self._gltf["materials"].append(material)
        attributes = {
            "POSITION": self._accessor(cover.vertices.astype("<f4"), _VERTICES, bounds=True),
            "NORMAL": self._accessor(cover.normals.astype("<f4"), _VERTICES),
            "JOINTS_0": self._accessor(cover.joints.astype("|u1"), _VERTICES),
            "WEIGHTS_0": self._accessor(cover.weights.astype("<f4"), _VERTICES),
        }
        kind = "<u2" if len(cover.vertices) < 65535 else "<u4"
        primitive = {
            "attributes": attributes,
            "indices": self._accessor(cover.faces.ravel().astype(kind), _TRIANGLES),
            "material": len(self._gltf["materials"]) - 1,
        }
        self._gltf["meshes"].append({"name": f"{name}_skin", "primitives": [primitive]})
        return len(self._gltf["meshes"]) - 1

    def _animate(self, moved: Motion, first: int) -> None:
        seconds = moved.time_s.astype("<f4")
        if len(seconds) > 1 and not (np.diff(seconds) > 0).all():
            raise SettingsError(
                "glTF keeps times in float32, which cannot tell these frames apart: export a"
                " shorter part, with --start and --end"
            )
        times = self._accessor(seconds, bounds=True)
        quaternions = matrix_to_quaternion(moved.rotations)[..., [1, 2, 3, 0]]
        # q and -q are the same rotation: neighbours of like sign, for programs that mix numbers
        turned = (quaternions[1:] * quaternions[:-1]).sum(-1) < 0
        quaternions[1:][np.logical_xor.accumulate(turned, axis=0)] *= -1
        self._channel(first, "translation", times, moved.wrist.astype("<f4"))
        for part, joint in enumerate(PART_JOINT.tolist()):
            self._channel(first + joint, "rotation", times, quaternions[:, part].astype("<f4"))

    def _channel(self, node: int, path: str, times: int, values: NDArray[Any]) -> None:
        animation = self._gltf["animations"][0]
        animation["samplers"].append(
            {"input": times, "output": self._accessor(values), "interpolation": "LINEAR"}
        )
        target = {"node": node, "path": path}
        sampler = len(animation["samplers"]) - 1
        animation["channels"].append({"sampler": sampler, "target": target})

    def _accessor(
        self, values: NDArray[Any], target: int | None = None, bounds: bool = False
    ) -> int:
        """Add an array (n, ...); its number."""
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": self._size,
            "byteLength": values.nbytes,
        }
        if target is not None:
            view["target"] = target
        self._gltf["bufferViews"].append(view)
        accessor: dict[str, Any] = {
            "bufferView": len(self._gltf["bufferViews"]) - 1,
            "componentType": _COMPONENTS[values.dtype.str],
            "count": len(values),
            "type": _KINDS[values.shape[1:]],
        }
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor["min"] = rows.min(0).tolist()
            accessor["max"] = rows.max(0).tolist()
        self._gltf["accessors"].append(accessor)
        data = np.ascontiguousarray(values).tobytes()
        data += bytes(-len(data) % 4)
        self._blocks.append(data)
        self._size += len(data)
        return len(self._gltf["accessors"]) - 1

    def write(self, path: Path) -> None:
        """The container: a header, the JSON and the bytes (glTF 2.0, section 4)."""
        self._gltf["buffers"] = [{"byteLength": self._size}]
        text = json.dumps(self._gltf, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + 8 + self._size
        if length > _LARGEST:
            raise SettingsError(
                f"a .glb file holds 4 GiB at most, these frames take {length / 2**30:.1f}: export"
                " a shorter part, with --start and --end"
            )
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, length))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            file.write(struct.pack("<I4s", self._size, b"BIN\0"))
            file.writelines(self._blocks)
