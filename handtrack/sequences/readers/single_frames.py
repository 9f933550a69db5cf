"""Numbered files of one frame each (joints_1.npy, joints_2.npy, ...; text) as one sequence,
in the order of their numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.raw import NoFramesError, NotJointsError, Raw
from handtrack.sequences.readers.recognise import read_file

NAME = re.compile(r"(.*?)(\d{1,18})\.(npy|txt|csv|json)", re.IGNORECASE)
_FEWEST = 3
_LARGEST = 100_000
"""A file of one frame has no more bytes."""


def together(names: Iterable[str], folder: Path) -> list[list[str]]:
    """Which files of a folder are frames of one sequence: three and more of one name but for the
    number, of which the first and the last hold one frame."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in names:
        match = NAME.fullmatch(name)
        if match is not None:
            groups.setdefault((match[1], match[3].lower()), []).append(name)
    return [
        sorted(group, key=_number)
        for group in groups.values()
        if len(group) >= _FEWEST and all(_is_one_frame(folder / n) for n in (group[0], group[-1]))
    ]


def read_single_frames(
    paths: Sequence[Path], folder: Path, frames: tuple[int, int] | None = None
) -> list[Raw]:
    """The sequence of each hand in files of one frame each; only those inside `frames` are opened.

    Raises:
        InputError: no file in that range, or one that is not like the first.
    """
    numbered = [(_number(p.name), p) for p in paths]
    chosen = [(n, p) for n, p in numbered if frames is None or frames[0] <= n <= frames[1]]
    if not chosen:
        there = f"{numbered[0][0]}:{numbered[-1][0]}"
        raise NoFramesError(f"no frame in {frames}, there are {there}", folder)
    read = [_hands(path) for _, path in chosen]
    sides = dict.fromkeys(side for of in read for side in of)
    if len(sides) > 1 and None in sides:
        odd = next(path for (_, path), of in zip(chosen, read, strict=True) if None in of)
        raise InputError("does not say which hand it is of, others do", odd)
    return [_whole(side, [of.get(side) for of in read], chosen, folder) for side in sides]


def _whole(
    side: Hand | None, found: list[Raw | None], chosen: list[tuple[int, Path]], folder: Path
) -> Raw:
    """One hand's frames; those in which it is not are missing."""
    seen = [raw for raw in found if raw is not None]
    first = seen[0]
    for raw in seen:
        if raw.joints.shape != first.joints.shape or raw.unit != first.unit:
            raise InputError(
                f"holds {len(raw.joints)} frame(s) of {raw.joints.shape[1]} joints,"
                f" {first.path.name} one of {first.joints.shape[1]}",
                raw.path,
            )
    lost = np.full_like(first.joints, np.nan)
    joints = np.concatenate([lost if raw is None else raw.joints for raw in found])
    confidence = None
    if all(raw.confidence is not None for raw in seen):
        none = np.ones(first.joints.shape[:2])
        parts = [none if raw is None or raw.confidence is None else raw.confidence for raw in found]
        confidence = np.concatenate([part.reshape(1, -1) for part in parts])
    return replace(
        first,
        joints=joints,
        path=folder,
        name=folder.resolve().name,
        hand=side,
        stamps=_stamps(found),
        confidence=confidence,
        truth=None,
        frame_index=np.array([n for n, _ in chosen], dtype=np.int64),
        notes=(f"{len(found)} files of one frame each",),
    )


def _stamps(found: list[Raw | None]) -> Stamps | None:
    """The frames' times, where every file says its own."""
    said = [None if raw is None else raw.stamps for raw in found]
    first = next((stamps for stamps in said if stamps is not None), None)
    values = [None if stamps is None else stamps.values for stamps in said]
    if first is None or any(raw is not None and raw.stamps is None for raw in found):
        return None
    if not all(v is None or (isinstance(v, list | np.ndarray) and len(v) == 1) for v in values):
        return None
    return replace(first, values=[None if v is None else v[0] for v in values], places=None)


def _number(name: str) -> int:
    match = NAME.fullmatch(name)
    return 0 if match is None else int(match[2])


def _hands(path: Path) -> dict[Hand | None, Raw]:
    raws = read_file(path)
    found = {raw.hand: raw for raw in raws}
    if len(found) < len(raws):
        raise InputError(f"holds {len(raws)} hands, expected one of each side", path)
    return found


def _is_one_frame(path: Path) -> bool:
    try:
        if path.stat().st_size > _LARGEST:
            return False
        raws = read_file(path)
    except (InputError, NotJointsError, OSError):
        return False  # read by itself it will say what is wrong
    one_each = len({raw.hand for raw in raws}) == len(raws)
    return one_each and all(
        len(raw.joints) == 1 and raw.pending is None and raw.mano is None for raw in raws
    )
