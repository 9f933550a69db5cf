"""What a conversion loses: the file that was written, read back and compared between its frames."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.converting.source import Source
from handtrack.hand.rotations import matrix_to_vector, quaternion_to_matrix, vector_to_matrix
from handtrack.hand.skeleton import BONES, JOINT_NAMES, N_JOINTS, PARENTS

Array = NDArray[np.float64]
Times = NDArray[np.int64]

_LONGEST_NS = 250_000_000
"""Between frames farther apart nothing is made up."""
_NEAR_NS = 1_000_000
"""A frame this near is taken as it is."""


def _between(times: Times, given: Times) -> tuple[NDArray[np.int64], Array, NDArray[np.bool_]]:
    """The frame before each time, how far it is to the next, and whether the time is between
    two frames of one stretch."""
    if len(given) == 1:
        return np.zeros(len(times), int), np.zeros(len(times)), np.abs(times - given) <= _NEAR_NS
    before = np.clip(np.searchsorted(given, times, "right") - 1, 0, len(given) - 2)
    step = given[before + 1] - given[before]
    share = (times - given[before]) / step
    near = np.abs(share - np.round(share)) * step <= _NEAR_NS
    share = np.where(near, np.round(share), share)
    inside = (share >= 0) & (share <= 1) & (near | (step <= _LONGEST_NS))
    return before, np.clip(share, 0, 1), inside


def at_times(times: Times, given: Times, values: Array) -> Array:
    """Values (T, ...) at `given` times, brought to others (n, ...); NaN where there are none."""
    before, share, inside = _between(times, given)
    after = np.minimum(before + 1, len(given) - 1)
    part = share.reshape(-1, *(1,) * (values.ndim - 1))
    mixed = values[before] + part * (values[after] - values[before])
    # a frame that is met exactly does not need its neighbour
    mixed = np.where(part == 0, values[before], np.where(part == 1, values[after], mixed))
    mixed[~inside] = np.nan
    return np.asarray(mixed)


def turned_at(times: Times, given: Times, rotations: Array) -> Array:
    """Rotations (T, ..., 3, 3) likewise, the short way round."""
    before, share, inside = _between(times, given)
    after = np.minimum(before + 1, len(given) - 1)
    first, second = rotations[before], rotations[after]
    turn = matrix_to_vector(np.nan_to_num(first.swapaxes(-1, -2) @ second))
    part = share.reshape(-1, *(1,) * (turn.ndim - 1))
    mixed = first @ vector_to_matrix(part * turn)
    edge = part[..., None]
    mixed = np.where(edge == 0, first, np.where(edge == 1, second, mixed))
    mixed[~inside] = np.nan
    return np.asarray(mixed)


_FIRST, _LAST = np.array(BONES).T


class Loss(NamedTuple):
    """How far what was read back is from what was converted.

    Attributes:
        mean_mm, max_mm: distance of joints that both have.
        mean_deg, max_deg: angle between bones that both have.
        joints: joints, over all frames, that the source has and the file has not.
        of: how many the source has.
    """

    mean_mm: float
    max_mm: float
    mean_deg: float
    max_deg: float
    joints: int
    of: int

    def __str__(self) -> str:
        text = (
            f"read back: {self.mean_mm:.3g} mm off (at most {self.max_mm:.3g}),"
            f" bones {self.mean_deg:.2g}° (at most {self.max_deg:.2g})"
        )
        if self.joints:
            text += f", without {100 * self.joints / self.of:.1f} % of the joints"
        return text


def loss(source: Source, time_ns: NDArray[np.int64], back: Array) -> Loss:
    """What a source lost.

    Args:
        source: what was converted.
        time_ns: (n,) of what was read back, on the source's clock.
        back: (n, 21, 3) its joints [m].
    """
    there = at_times(source.time_ns, time_ns, back)
    wanted = source.present
    both = wanted & np.isfinite(there).all(-1)
    off = np.linalg.norm(there - source.joints, axis=-1)[both] * 1e3
    bones = both[:, _FIRST] & both[:, _LAST]
    before, after = (x[:, _LAST] - x[:, _FIRST] for x in (source.joints, there))
    across = np.linalg.norm(np.cross(before, after), axis=-1)
    # atan2 tells small angles too
    angle = np.rad2deg(np.arctan2(across, (before * after).sum(-1)))[bones]
    return Loss(
        *_mean_and_max(off),
        *_mean_and_max(angle),
        int((wanted & ~both).sum()),
        int(wanted.sum()),
    )


def _mean_and_max(values: Array) -> tuple[float, float]:
    if not values.size:
        return float("nan"), float("nan")
    return float(values.mean()), float(values.max())


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
