"""Reader of HOT3D's hands (Banerjee et al. 2024), JSON lines of both hands' poses.

    {"timestamp_ns": N, "hand_poses": {"0": {...}, "1": {...}}}    0: left, 1: right
    umetrack_hand_pose_trajectory.jsonl: "wrist_xform" {"q_wxyz", "t_xyz"} [m] and "joint_angles"
        (22, of which 20 are the fingers'), with a hand's profile beside it
    mano_hand_pose_trajectory.jsonl: "wrist_xform", "pose" (15 principal components from the mean
        pose), "betas" (10); joints need the user's MANO

Frames that `masks/` beside it leaves out (mask_qa_pass, mask_hand_pose_available) are missing.

HOT3D-Clips: archives of short clips, a few files for each frame; their pictures are passed over.

    NNNNNN.hands.json   "left", "right": "umetrack_pose" {"joint_angles", "T_world_from_wrist"
                        {"quaternion_wxyz", "translation_xyz"} or "wrist_xform" (4 x 4)},
                        "mano_pose" {"thetas" (15), "wrist_xform" (axis times angle, place)}
    NNNNNN.info.json    "ref_timestamp_ns"
    __hand_shapes.json__  "umetrack": the hand's profile, "mano": 10 betas
"""

from __future__ import annotations

import re
from collections.abc import Sequence as Items
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.hand.rotations import (
    matrix_to_quaternion,
    matrix_to_vector,
    quaternion_to_matrix,
    vector_to_matrix,
)
from handtrack.hand.skeleton import Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.mano_params import ManoValues
from handtrack.sequences.readers.panoptic import Frames, in_range
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem
from handtrack.sequences.readers.umetrack import N_HINGES, Angles, Profile, read_profile

_HANDS: dict[str, Hand] = {"0": "left", "1": "right"}
_MASKS = ("mask_qa_pass.csv", "mask_hand_pose_available.csv")
_LARGEST_MASK = 100_000_000
_SAME_NS = 1_000_000
_LARGEST = 1e6
_TRUTHS = {"true": True, "false": False, "1": True, "0": False}


def is_frame(line: dict[str, Any]) -> bool:
    """Whether a line's record is one of its frames."""
    return isinstance(line.get("hand_poses"), dict) and "timestamp_ns" in line


def read_lines(values: list[Any], places: Items[str], path: Path) -> list[Raw]:
    """The hands of a trajectory, with their joints still to be made.

    Raises:
        NotJointsError: no hand in any line.
        InputError: a pose that is none (with its line).
    """
    for value, place in zip(values, places, strict=True):
        if not isinstance(value, dict) or not isinstance(value.get("hand_poses"), dict):
            raise InputError(f"{place} has no hand_poses", path)
    kept = _moments([v.get("timestamp_ns") for v in values])
    values, places = [values[i] for i in kept], [places[i] for i in kept]
    times = [v.get("timestamp_ns") for v in values]
    poses: list[dict[str, Any]] = [v["hand_poses"] for v in values]
    bad = _left_out(times, path)
    raws = []
    for number, hand in _HANDS.items():
        given = [p.get(number) for p in poses]
        seen = [isinstance(g, dict) and not b for g, b in zip(given, bad, strict=True)]
        if not any(seen):
            continue
        raw = Raw(
            np.full((len(given), 21, 3), np.nan),
            path,
            stem(path),
            hand=hand,
            unit="m",
            stamps=Stamps(times, "timestamp_ns", "ns", places),
            tagged=True,
        )
        gone = sum(isinstance(g, dict) and b for g, b in zip(given, bad, strict=True))
        if gone:
            raw.notes = (f"{gone} frames that the masks leave out were taken as missing",)
        rows = [g if s else None for g, s in zip(given, seen, strict=True)]
        raws.append(_with_values(raw, rows, places, path))
    if not raws:
        raise NotJointsError("no hand in any line", path)
    return raws


def _moments(times: list[Any]) -> list[int]:
    """The frames of Aria's first camera, where those of another follow within a millisecond."""
    kept: list[int] = []
    for i, time in enumerate(times):
        before = times[kept[-1]] if kept else None
        if isinstance(time, int) and isinstance(before, int) and 0 < time - before < _SAME_NS:
            continue
        kept.append(i)
    return kept


def _with_values(raw: Raw, rows: list[Any], places: Items[str], path: Path) -> Raw:
    first = next(r for r in rows if r is not None)
    mano = "pose" in first
    first = next((r for r in rows if r is not None and r.get("pose")), first) if mano else first
    if not mano and "joint_angles" not in first:
        there = shown(", ".join(list(first)[:6]))
        raise InputError(f"a hand has {there}, expected joint_angles or pose", path)
    n = len(rows)
    key, width = ("pose", len(first["pose"] or ())) if mano else ("joint_angles", N_HINGES)
    wanted = (key, "wrist_xform", *(("betas",) if mano else ()))
    at = np.flatnonzero([row is not None for row in rows])
    together = None if mano else _together([rows[i] for i in at.tolist()], width)
    if together is None:
        rows = [None if row is None or _is_blank(row, wanted) else row for row in rows]
    turn, move = np.full((n, 4), np.nan), np.full((n, 3), np.nan)
    values = np.full((n, width), np.nan)
    betas = np.zeros((n, 10))
    sure = np.ones(n)
    if together is None and not mano:
        at = np.flatnonzero([row is not None for row in rows])
        together = _together([rows[i] for i in at.tolist()], width)
    if together is not None:
        turn[at], move[at], values[at] = together
        said = [rows[i].get("hand_confidence") for i in at.tolist()]
        sure[at] = [s if isinstance(s, int | float) else 1.0 for s in said]
        rows = []
    for t, row in enumerate(rows):
        if row is None:
            continue
        where = f"{places[t]}: hand {raw.hand}"
        wrist = row.get("wrist_xform")
        if not isinstance(wrist, dict):
            raise InputError(f"{where} has no wrist_xform", path)
        turn[t] = _numbers(wrist.get("q_wxyz"), 4, f"{where}: q_wxyz", path)
        move[t] = _numbers(wrist.get("t_xyz"), 3, f"{where}: t_xyz", path)
        values[t] = _numbers(row.get(key), width, f"{where}: {key}", path)
        if mano:
            betas[t] = _numbers(row.get("betas"), 10, f"{where}: betas", path)
        elif isinstance(row.get("hand_confidence"), int | float):
            sure[t] = row["hand_confidence"]
    seen = np.isfinite(turn).all(1)
    length = np.linalg.norm(turn[seen], axis=1)
    if not ((length > 0.5) & (length < 2)).all():
        raise InputError("a wrist's q_wxyz is no rotation: a quaternion has the length 1", path)
    rotation = quaternion_to_matrix(np.where(seen[:, None], turn, [1.0, 0.0, 0.0, 0.0]))
    if not mano:
        raw.pending = Angles(values, rotation, np.nan_to_num(move))
        raw.confidence = np.clip(sure, 0.0, 1.0)
        return raw
    raw.mano = ManoValues(
        matrix_to_vector(rotation),
        np.nan_to_num(values),
        components=True,
        flat=False,
        betas=betas,
        transl=np.nan_to_num(move),
    )
    raw.confidence = np.where(seen, 1.0, 0.0)
    return raw


def _is_blank(row: dict[str, Any], wanted: Items[str]) -> bool:
    """Whether a hand is there that was not seen: null stands for what is wanted, or in it."""
    said = [row[key] for key in wanted if key in row]
    inner = [v for value in said if isinstance(value, dict) for v in value.values()]
    lists = [v for v in (*said, *inner) if isinstance(v, list)]
    return None in (*said, *inner) or any(None in v for v in lists)


def _together(rows: list[Any], width: int) -> tuple[Array, Array, Array] | None:
    """The wrists' turns and places and the angles of all frames; None where one has others."""
    try:
        wrists = [row["wrist_xform"] for row in rows]
        turn = np.array([w["q_wxyz"] for w in wrists], dtype=np.float64)
        move = np.array([w["t_xyz"] for w in wrists], dtype=np.float64)
        values = np.array([row["joint_angles"] for row in rows], dtype=np.float64)
    except (ValueError, TypeError, OverflowError, KeyError):
        return None
    out = []
    for array, n in ((turn, 4), (move, 3), (values, width)):
        if array.ndim != 2 or array.shape[1] < n or not (np.abs(array[:, :n]) < _LARGEST).all():
            return None
        out.append(array[:, :n])
    return out[0], out[1], out[2]


def _numbers(given: Any, n: int, where: str, path: Path) -> Array:
    """At least n numbers, of which the first n count."""
    try:
        array = np.array(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.zeros(0)
    if array.ndim != 1 or len(array) < n or not (np.abs(array[:n]) < _LARGEST).all():
        raise InputError(f"{where} is not {n} numbers", path)
    return array[:n]


def _left_out(times: list[Any], path: Path) -> NDArray[np.bool_]:
    """(T,) whether the masks beside the file leave a frame out."""
    out: set[str] = set()
    for name in _MASKS:
        mask = path.parent / "masks" / name
        if not mask.is_file():
            continue
        lines = budget.read(mask, _LARGEST_MASK).decode("latin-1").splitlines()
        for n, line in enumerate(lines[1:], 2):
            cells = [cell.strip() for cell in line.split(",")]
            good = _TRUTHS.get(cells[-1].lower()) if len(cells) > 1 else None
            if good is None and line.strip():
                raise InputError(f"line {n} is no mask: expected a time, ..., True", mask)
            if good is False:
                out.add(cells[0])
    return np.array([str(t) in out for t in times], dtype=bool)


FORMATS = (
    Format(
        "HOT3D",
        "`umetrack_hand_pose_trajectory.jsonl`, `mano_hand_pose_trajectory.jsonl`; frames that"
        " `masks/` leave out are missing; HOT3D-Clips' .tar, with the profile in it",
        "umetrack; by your MANO",
        "m",
        "both",
        "`hand_poses` in the JSON",
        "the profile beside it (`--profile FILE`); `--mano DIR`",
    ),
)


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
    for raw in read_lines(values, places, path):
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
