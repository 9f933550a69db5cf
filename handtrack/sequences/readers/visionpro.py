"""Reader of VisionProTeleop's recordings: visionOS's hands, joints in the frame of the wrist.

tracking.jsonl   a line each: "timestamp", "headMatrix", "leftHand", "rightHand", each null or
                 {"wrist": 16 numbers, "thumbKnuckle": 16, "indexMetacarpal": 16, ...}: poses
                 column by column, the wrist's in the world, the others' in the wrist's frame
arrays           of its stream's names: left_wrist (T, 1, 4, 4) in the world and left_fingers
                 (T, 25, 4, 4) (or left_arm, 27) in the wrist's frame, right_..., head
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from collections.abc import Sequence as Items
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import HANDS, N_JOINTS, ORDERS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import UNUSED, joint_name, words
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import few

_JOINTS, _WRIST = ("fingers", "arm"), "wrist"
_MATRIX = 16


def is_frame(line: dict[str, Any]) -> bool:
    """Whether a line's record is one of its frames."""
    hands = [line[key] for key in ("leftHand", "rightHand") if isinstance(line.get(key), dict)]
    return "headMatrix" in line and (
        not hands or any(isinstance(h.get("wrist"), list) for h in hands)
    )


def read_lines(values: list[Any], places: Items[str], path: Path) -> list[Raw]:
    """The hands of tracking.jsonl.

    Raises:
        NotJointsError: no hand in any line.
        InputError: a pose that is no 16 numbers.
    """
    for value, place in zip(values, places, strict=True):
        if not isinstance(value, dict):
            raise InputError(f"{place} is not an object, others are", path)
    stamps = Stamps([v.get("timestamp") for v in values], "timestamp", None, places)
    raws = []
    for hand in HANDS:
        given = [v.get(f"{hand}Hand") for v in values]
        if not any(isinstance(h, dict) for h in given):
            continue
        joints = np.full((len(given), N_JOINTS, 3), np.nan)
        for t, (value, place) in enumerate(zip(given, places, strict=True)):
            if isinstance(value, dict):
                joints[t] = _in_world(value, f"{place}: {hand}Hand", path)
        raws.append(_raw(joints, hand, path, stamps))
    if not raws:
        raise NotJointsError("leftHand and rightHand are null in every line", path)
    return raws


def _in_world(value: dict[str, Any], place: str, path: Path) -> Array:
    """(21, 3) one hand's joints in the world."""
    out = np.full((N_JOINTS, 3), np.nan)
    wrist = _matrix(value.get(_WRIST), f"{place}: wrist", path)
    if wrist is None:
        return out
    out[0] = wrist[:3, 3]
    names = [name for name in value if name != _WRIST and value[name] is not None]
    said = [(name, s) for name in names if (s := joint_name(words(name))) is not None]
    known = {name for name, _ in said}
    others = [name for name in names if name not in known]
    if len(others) > len(known):
        raise InputError(
            f"{place}: most joints are not understood: {few(others)}; understood are"
            f" {few(known) or 'none'}",
            path,
        )
    for (name, _), joint in zip(said, settle(s for _, s in said), strict=True):
        if joint is None or joint in (UNUSED, 0):
            continue
        pose = _matrix(value[name], f"{place}: {name}", path)
        if pose is not None:
            out[joint] = wrist[:3, :3] @ pose[:3, 3] + wrist[:3, 3]
    return out


def _matrix(given: Any, place: str, path: Path) -> Array | None:
    if given is None:
        return None
    try:
        numbers = np.array(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        numbers = np.zeros(0)
    if numbers.shape != (_MATRIX,):
        raise InputError(f"{place} is no pose, expected 16 numbers", path)
    return numbers.reshape(4, 4).T


def arrays(names: Iterable[str]) -> bool:
    """Whether arrays of such names are its stream's."""
    there = set(names)
    return any(
        f"{hand}_{_WRIST}" in there and any(f"{hand}_{j}" in there for j in _JOINTS)
        for hand in HANDS
    )


def from_arrays(fields: Mapping[str, Any], path: Path) -> list[Raw]:
    """The hands of its stream's arrays.

    Raises:
        InputError: an array of another shape.
    """
    raws = []
    clock = next((k for k in ("timestamp", "timestamps", "time", "times") if k in fields), None)
    stamps = None if clock is None else Stamps(np.asarray(fields[clock]).ravel(), clock)
    for hand in HANDS:
        key = next((f"{hand}_{j}" for j in _JOINTS if f"{hand}_{j}" in fields), None)
        if key is None or f"{hand}_{_WRIST}" not in fields:
            continue
        joints = _poses(fields[key], key, path)
        wrist = _poses(fields[f"{hand}_{_WRIST}"], f"{hand}_{_WRIST}", path)
        if wrist.shape[1] != 1 or len(wrist) != len(joints) or joints.shape[1] not in (25, 27):
            raise InputError(
                f"{key} has shape {joints.shape}, {hand}_wrist {wrist.shape}:"
                " expected (frames, 25, 4, 4) and (frames, 1, 4, 4)",
                path,
            )
        # the wrist is the frame's origin, in which it stands too
        local = joints[..., :3, 3][:, list(ORDERS["webxr"])]
        local[:, 0] = 0.0
        places = np.einsum("tij,tkj->tki", wrist[:, 0, :3, :3], local) + wrist[:, :, :3, 3]
        places[~np.isfinite(wrist).all((1, 2, 3))] = np.nan
        fits = stamps is not None and len(stamps.values) == len(joints)
        raws.append(_raw(places, hand, path, stamps if fits else None))
    return raws


def _poses(value: Any, name: str, path: Path) -> Array:
    """(T, N, 4, 4)."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.shape[-2:] != (4, 4) or array.ndim not in (3, 4):
        raise InputError(f"{name} has shape {array.shape}, expected (frames, N, 4, 4)", path)
    poses = array.astype(np.float64)
    if poses.ndim == 4:
        return poses
    # poses of one joint, or of one frame
    return poses[:, None] if name.endswith(_WRIST) else poses[None]


def _raw(joints: Array, hand: Hand, path: Path, stamps: Stamps | None) -> Raw:
    return Raw(
        joints,
        path,
        stem(path),
        hand=hand,
        unit="m",
        order="handtrack",
        stamps=stamps,
        tagged=True,
    )


FORMATS = (
    Format(
        "VisionProTeleop",
        "`tracking.jsonl`, or its stream's arrays (`right_fingers`, `right_wrist` ...) in .npz or"
        " HDF5; brought from the wrist's frame into the world",
        "by name",
        "m",
        "both",
        "`headMatrix` in the JSON, names of arrays",
    ),
)
