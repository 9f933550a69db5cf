"""Reader of InterHand2.6M's `joint_3d.json` and of AssemblyHands', which has its layout.

InterHand2.6M (Moon et al. 2020): {capture: {frame: {"world_coord": 42 x 3, "joint_valid": 42 or
42 x 1, ...}}}; AssemblyHands (Ohkawa et al. 2023): {"annotations": {sequence: {frame: ...}}}.
World frame, mm; the right hand is 0-20, the left 21-41, each finger from its tip to its base,
thumb first, the wrist last. What is not valid is missing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import NotJointsError, Raw

_HANDS: tuple[Hand, Hand] = ("right", "left")
_MARK = b'"world_coord"'
_Valid = bool | int | float


class _Frame(msgspec.Struct):
    world_coord: list[tuple[float | None, float | None, float | None]]
    joint_valid: list[_Valid | list[_Valid]] | None = None


_Captures = dict[str, dict[str, _Frame]]


class _Annotated(msgspec.Struct):
    annotations: _Captures


def is_interhand(fields: dict[str, msgspec.Raw]) -> bool:
    """Whether a JSON object's values hold frames with world coordinates."""
    return any(_MARK in bytes(value)[:4000] for value in list(fields.values())[:3])


def read_interhand(data: bytes, path: Path) -> list[Raw]:
    """Two sequences of each capture, the right hand's and the left's.

    Raises:
        NotJointsError: no frame in it.
        InputError: malformed, or a frame without 42 joints.
    """
    fields = decode(data, dict[str, msgspec.Raw], path)
    assembly = "annotations" in fields
    captures: _Captures = (
        decode(data, _Annotated, path).annotations if assembly else decode(data, _Captures, path)
    )
    # of a name that is there twice JSON's readers keep the last
    there, kept = data.count(_MARK), sum(map(len, captures.values()))
    if there > kept:
        raise InputError(f"{there - kept} frame(s) are there twice, by the same number", path)
    found = []
    for capture, frames in captures.items():
        if not frames:
            continue
        name = shown(capture if assembly else f"capture{capture}", 80)
        found += _hands(name, frames, path)
    if not found:
        raise NotJointsError("no frame in it", path)
    return found


def _hands(name: str, frames: dict[str, _Frame], path: Path) -> list[Raw]:
    named: dict[int, _Frame] = {}
    for key, frame in frames.items():
        number = _number(key, name, path)
        if number in named:
            raise InputError(f"{name}: frame {number} is there twice", path)
        named[number] = frame
    numbered = sorted(named.items(), key=lambda item: item[0])
    numbers = np.array([n for n, _ in numbered], dtype=np.int64)
    joints = np.empty((len(numbered), 2 * N_JOINTS, 3))
    for row, (number, frame) in zip(joints, numbered, strict=True):
        where = f"{name}, frame {number}"
        if len(frame.world_coord) != 2 * N_JOINTS:
            raise InputError(
                f"{where}: world_coord has {len(frame.world_coord)} joints, expected 42", path
            )
        row[:] = np.array(frame.world_coord, dtype=np.float64)
        if frame.joint_valid is not None:
            row[~_valid(frame.joint_valid, where, path)] = np.nan
    return [
        Raw(
            joints[:, i * N_JOINTS : (i + 1) * N_JOINTS],
            path,
            name,
            hand=hand,
            unit="mm",
            order="interhand",
            frame_index=numbers,
            tagged=True,
        )
        for i, hand in enumerate(_HANDS)
    ]


def _number(key: str, name: str, path: Path) -> int:
    if not (key.isascii() and key.isdigit() and len(key) <= 18):
        raise InputError(f"{name}: frame {shown(key, 40)} is no number", path)
    return int(key)


def _valid(given: list[Any], where: str, path: Path) -> Any:
    try:
        valid = np.array(given, dtype=np.float64).reshape(-1)
    except (ValueError, TypeError, OverflowError):
        raise InputError(f"{where}: joint_valid is ragged, expected 42 numbers", path) from None
    if len(valid) != 2 * N_JOINTS:
        raise InputError(f"{where}: joint_valid has {len(valid)} numbers, expected 42", path)
    return valid > 0


FORMATS = (
    Format(
        "InterHand2.6M",
        "`*_joint_3d.json`",
        "interhand",
        "mm",
        "both",
        "`world_coord` in the JSON",
        kinds={"interhand": read_interhand},
        ways=(Way("fields", lambda fields, data: is_interhand(fields), read_interhand),),
    ),
    Format(
        "AssemblyHands",
        "`assemblyhands_*_joint_3d*.json`",
        "interhand",
        "mm",
        "both",
        "`annotations` of `world_coord`",
        kinds={"assemblyhands": read_interhand},
    ),
)
