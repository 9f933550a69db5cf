"""Joints of an animated .glb file, as a program that plays it has them."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS, PARENTS

Array = NDArray[np.float64]


def glb_joints(path: Path, hand: str) -> tuple[Array, Array]:
    """Times (T,) [s] and joints (T, 21, 3) [m] of a hand in a file that `write_glb` wrote.

    Args:
        path: the file.
        hand: the name of the hand in it: its nodes are HAND_wrist and so on.
    """
    data = path.read_bytes()
    (size,) = struct.unpack_from("<I", data, 12)
    gltf, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    names = {node.get("name"): i for i, node in enumerate(gltf["nodes"])}
    animation = gltf["animations"][0]
    curves: dict[tuple[int, str], tuple[Array, Array]] = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        target = channel["target"]["node"], channel["target"]["path"]
        values = [_array(gltf, binary, sampler[key]) for key in ("input", "output")]
        curves[target] = values[0][:, 0], values[1]
    nodes = [names[f"{hand}_{name}"] for name in JOINT_NAMES]
    times = curves[nodes[0], "translation"][0]
    n = len(times)
    place, turn = np.zeros((n, N_JOINTS, 3)), np.zeros((n, N_JOINTS, 3, 3))
    for joint, node in enumerate(nodes):
        at = np.array(gltf["nodes"][node]["translation"])
        own = curves.get((node, "translation"), (times, np.broadcast_to(at, (n, 3))))[1]
        rest = np.broadcast_to([0.0, 0, 0, 1], (n, 4))
        xyzw = curves.get((node, "rotation"), (times, rest))[1]
        rotation = quaternion_to_matrix(np.roll(xyzw, 1, -1))
        if joint == 0:
            place[:, 0], turn[:, 0] = own, rotation
        else:
            above = int(PARENTS[joint])
            place[:, joint] = place[:, above] + np.einsum("tij,tj->ti", turn[:, above], own)
            turn[:, joint] = turn[:, above] @ rotation
    return times, place


def _array(gltf: dict[str, Any], binary: bytes, number: int) -> Array:
    """An accessor of floats (n, width)."""
    accessor = gltf["accessors"][number]
    view = gltf["bufferViews"][accessor["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    values = np.frombuffer(binary, "<f4", accessor["count"] * width, view["byteOffset"])
    return values.astype(np.float64).reshape(-1, width)
