"""Reader of HOT3D's hands (Banerjee et al. 2024), JSON lines of both hands' poses.

    {"timestamp_ns": N, "hand_poses": {"0": {...}, "1": {...}}}    0: left, 1: right
    umetrack_hand_pose_trajectory.jsonl: "wrist_xform" {"q_wxyz", "t_xyz"} [m] and "joint_angles"
        (22, of which 20 are the fingers'), with a hand's profile beside it
    mano_hand_pose_trajectory.jsonl: "wrist_xform", "pose" (15 principal components from the mean
        pose), "betas" (10); joints need the user's MANO

Frames that `masks/` beside it leaves out (mask_qa_pass, mask_hand_pose_available) are missing.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.hand.rotations import matrix_to_vector, quaternion_to_matrix
from handtrack.hand.skeleton import Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.mano_params import ManoValues
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem
from handtrack.sequences.readers.umetrack import N_HINGES, Angles

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
    if not mano and "joint_angles" not in first:
        there = ", ".join(list(first)[:6])
        raise InputError(f"a hand has {there}, expected joint_angles or pose", path)
    n = len(rows)
    key, width = ("pose", len(first["pose"])) if mano else ("joint_angles", N_HINGES)
    turn, move = np.full((n, 4), np.nan), np.full((n, 3), np.nan)
    values = np.full((n, width), np.nan)
    betas = np.zeros((n, 10))
    sure = np.ones(n)
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
