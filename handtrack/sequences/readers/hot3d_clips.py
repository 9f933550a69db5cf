"""HOT3D-Clips (Banerjee et al. 2024): archives of short clips, a few files for each frame.

    NNNNNN.hands.json   "left", "right": "umetrack_pose" {"joint_angles", "T_world_from_wrist"
                        {"quaternion_wxyz", "translation_xyz"} or "wrist_xform" (4 x 4)},
                        "mano_pose" {"thetas" (15), "wrist_xform" (axis times angle, place)}
    NNNNNN.info.json    "ref_timestamp_ns"
    __hand_shapes.json__  "umetrack": the hand's profile, "mano": 10 betas

The pictures in them are passed over.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.hand.rotations import matrix_to_quaternion, vector_to_matrix
from handtrack.sequences.readers import hot3d
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.panoptic import Frames, in_range
from handtrack.sequences.readers.raw import Raw, stem
from handtrack.sequences.readers.umetrack import Angles, Profile, read_profile

_FRAME = re.compile(r"(\d{1,18})\.(hands|info)\.json")
_SHAPES = "__hand_shapes.json__"
_SIDES = (("0", "left"), ("1", "right"))


def takes(name: str) -> bool:
    """Whether a file of an archive is one of a clip's that tell of hands."""
    return name == _SHAPES or _FRAME.fullmatch(name) is not None


def read_clip(files: dict[str, bytes], path: Path, frames: Frames = None) -> list[Raw]:
    """The hands of a clip.

    Args:
        files: content of those that `takes` names.
        path: of the archive.
        frames: first and last frame to read.

    Raises:
        NotJointsError: no hand in any frame.
        InputError: a file that is not as it should be.
    """
    hands: list[tuple[int, Path]] = []
    times: dict[int, Any] = {}
    for name, data in files.items():
        match = _FRAME.fullmatch(name)
        if match is not None and match[2] == "hands":
            hands.append((int(match[1]), path / name))
        elif match is not None:
            times[int(match[1])] = decode(data, dict[str, Any], path / name).get("ref_timestamp_ns")
    chosen = in_range(sorted(hands), frames, path)
    profile, betas = _shapes(files, path)
    values = []
    for number, inside in chosen:
        frame = decode(files[inside.name], dict[str, Any], inside)
        poses = {n: _pose(frame[side], betas, inside) for n, side in _SIDES if frame.get(side)}
        values.append({"timestamp_ns": times.get(number), "hand_poses": poses})
    places = [f"frame {number}" for number, _ in chosen]
    found = []
    for raw in hot3d.read_lines(values, places, path):
        raw.name = stem(path)
        if len(raw.joints) == len(chosen):
            raw.frame_index = np.array([number for number, _ in chosen], dtype=np.int64)
        if isinstance(raw.pending, Angles):
            raw.pending = replace(raw.pending, profile=profile)
        found.append(raw)
    return found


def _shapes(files: dict[str, bytes], path: Path) -> tuple[Profile | None, Any]:
    """The hand's profile and its betas, where the clip has them."""
    if _SHAPES not in files:
        return None, None
    where = path / _SHAPES
    shapes = decode(files[_SHAPES], dict[str, msgspec.Raw], where)
    profile = None
    if "umetrack" in shapes:
        profile = read_profile(bytes(shapes["umetrack"]), where)
    return profile, decode(bytes(shapes["mano"]), Any, where) if "mano" in shapes else None


def _pose(hand: Any, betas: Any, path: Path) -> dict[str, Any]:
    """One hand as HOT3D's trajectories have it."""
    if not isinstance(hand, dict):
        raise InputError("a hand is no object", path)
    pose = hand.get("umetrack_pose")
    if isinstance(pose, dict):
        wrist = pose.get("T_world_from_wrist")
        if isinstance(wrist, dict):
            turn, move = wrist.get("quaternion_wxyz"), wrist.get("translation_xyz")
        else:
            turn, move = _of_matrix(pose.get("wrist_xform"), path)
        placed = {"q_wxyz": turn, "t_xyz": move}
        return {"wrist_xform": placed, "joint_angles": pose.get("joint_angles")}
    pose = hand.get("mano_pose")
    if not isinstance(pose, dict):
        raise InputError(f"a hand has neither umetrack_pose nor mano_pose: {list(hand)[:4]}", path)
    wrist = _array(pose.get("wrist_xform"), (6,), path)
    placed = {
        "q_wxyz": matrix_to_quaternion(vector_to_matrix(wrist[:3])).tolist(),
        "t_xyz": wrist[3:].tolist(),
    }
    thetas = pose.get("thetas")
    if not isinstance(thetas, list) or betas is None:
        raise InputError(f"a MANO pose needs thetas, and the clip's {_SHAPES} betas", path)
    return {"wrist_xform": placed, "pose": thetas, "betas": betas}


def _of_matrix(given: Any, path: Path) -> tuple[list[float], list[float]]:
    matrix = _array(given, (4, 4), path)
    turn = matrix[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3:
        raise InputError("a wrist's wrist_xform is no rotation and place", path)
    return matrix_to_quaternion(turn).tolist(), matrix[:3, 3].tolist()


def _array(given: Any, shape: tuple[int, ...], path: Path) -> Any:
    try:
        array = np.array(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.zeros(0)
    if array.shape != shape or not (np.abs(array) < 1e6).all():
        raise InputError(f"a wrist's wrist_xform is not {shape} numbers", path)
    return array
