"""BVH and glTF as other programs read them: parsers and forward kinematics of their own."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

KINDS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}


class Bvh:
    """A BVH file.

    names, parents and offsets are of joints and end sites in the order of the file; an end
    site is called `None`. channels are (joint, name); values (T, channels).
    """

    def __init__(self, path: Path) -> None:
        words = path.read_text().split()
        self.names: list[str | None] = []
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.channels: list[tuple[int, str]] = []
        above: list[int] = []
        i = 0
        while words[i] != "MOTION":
            if words[i] in ("ROOT", "JOINT", "End"):
                self.names.append(None if words[i] == "End" else words[i + 1])
                self.parents.append(above[-1] if above else -1)
                i += 2
            elif words[i] == "{":
                above.append(len(self.names) - 1)
                i += 1
            elif words[i] == "}":
                above.pop()
                i += 1
            elif words[i] == "OFFSET":
                self.offsets.append([float(w) for w in words[i + 1 : i + 4]])
                i += 4
            elif words[i] == "CHANNELS":
                count = int(words[i + 1])
                self.channels += [(above[-1], name) for name in words[i + 2 : i + 2 + count]]
                i += 2 + count
            else:
                i += 1
        assert words[i + 1] == "Frames:"
        assert words[i + 3 : i + 5] == ["Frame", "Time:"]
        self.frames, self.step = int(words[i + 2]), float(words[i + 5])
        values = np.array(words[i + 6 :], float)
        self.values = values.reshape(self.frames, len(self.channels))

    def positions(self) -> np.ndarray:
        """(T, joints and end sites, 3)."""
        where = np.zeros((self.frames, len(self.names), 3))
        turned = np.zeros((self.frames, len(self.names), 3, 3))
        for joint, parent in enumerate(self.parents):
            turn = np.broadcast_to(np.eye(3), (self.frames, 3, 3))
            move = np.broadcast_to(np.array(self.offsets[joint]), (self.frames, 3)).copy()
            for column, (owner, name) in enumerate(self.channels):
                if owner != joint:
                    continue
                axis = "XYZ".index(name[0])
                if name.endswith("position"):
                    move[:, axis] += self.values[:, column]
                else:
                    turn = turn @ _turn(axis, np.deg2rad(self.values[:, column]))
            if parent < 0:
                where[:, joint], turned[:, joint] = move, turn
            else:
                above = turned[:, parent]
                where[:, joint] = where[:, parent] + np.einsum("tij,tj->ti", above, move)
                turned[:, joint] = above @ turn
        return where


def _turn(axis: int, angle: np.ndarray) -> np.ndarray:
    out = np.zeros((len(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[:, axis, axis] = 1
    out[:, i, i] = out[:, j, j] = np.cos(angle)
    out[:, i, j], out[:, j, i] = -np.sin(angle), np.sin(angle)
    return out


class Glb:
    """A .glb file: its JSON, and what its accessors hold."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json: dict[str, Any] = json.loads(data[20 : 20 + size])
        binary, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert kind == b"BIN\0"
        assert binary == self.json["buffers"][0]["byteLength"] == length - 28 - size
        self._data = data[28 + size :]

    def array(self, number: int) -> np.ndarray:
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        width = KINDS[accessor["type"]]
        dtype = TYPES[accessor["componentType"]]
        raw = self._data[view["byteOffset"] :][: view["byteLength"]]
        values = np.frombuffer(raw, dtype, accessor["count"] * width).reshape(-1, width)
        if "min" in accessor:
            np.testing.assert_array_equal(values.min(0), accessor["min"])
            np.testing.assert_array_equal(values.max(0), accessor["max"])
        return values

    def node(self, name: str) -> int:
        (found,) = [i for i, node in enumerate(self.json["nodes"]) if node["name"] == name]
        return found

    def keys(self, path: str) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """node -> (times, values) of the animation's channels of one kind."""
        animation = self.json["animations"][0]
        out = {}
        for channel in animation["channels"]:
            if channel["target"]["path"] == path:
                sampler = animation["samplers"][channel["sampler"]]
                assert sampler["interpolation"] == "LINEAR"
                values = self.array(sampler["output"])
                out[channel["target"]["node"]] = (self.array(sampler["input"])[:, 0], values)
        return out

    def worlds(self) -> np.ndarray:
        """(T, nodes, 4, 4) of every node at every key; all channels have the same times."""
        nodes = self.json["nodes"]
        moved, turned = self.keys("translation"), self.keys("rotation")
        frames = len(next(iter(turned.values()))[0])
        local = np.tile(np.eye(4), (frames, len(nodes), 1, 1))
        for i, node in enumerate(nodes):
            local[:, i, :3, 3] = moved[i][1] if i in moved else node.get("translation", [0, 0, 0])
            if i in turned:
                local[:, i, :3, :3] = _of_xyzw(turned[i][1].astype(float))
        out = np.zeros_like(local)

        def place(i: int, above: np.ndarray) -> None:
            out[:, i] = above @ local[:, i]
            for child in nodes[i].get("children", []):
                place(child, out[:, i])

        for root in self.json["scenes"][0]["nodes"]:
            place(root, np.broadcast_to(np.eye(4), (frames, 4, 4)))
        return out

    def skinned(self, name: str) -> np.ndarray:
        """(T, V, 3) of a mesh node, by the formula of glTF 2.0, section 3.7.3.2."""
        node = self.json["nodes"][self.node(name)]
        skin = self.json["skins"][node["skin"]]
        (primitive,) = self.json["meshes"][node["mesh"]]["primitives"]
        points, joints, weights = (
            self.array(primitive["attributes"][key])
            for key in ("POSITION", "JOINTS_0", "WEIGHTS_0")
        )
        bind = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        matrices = self.worlds()[:, skin["joints"]] @ bind
        homogeneous = np.concatenate([points, np.ones((len(points), 1))], 1)
        return np.einsum("vk,tvkij,vj->tvi", weights, matrices[:, joints, :3], homogeneous)


def _of_xyzw(q: np.ndarray) -> np.ndarray:
    x, y, z, w = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
