"""Numbered files of one frame each (joints_1.npy, joints_2.npy, ...; text) as one sequence,
in the order of their numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.readers.raw import NoFramesError, NotJointsError, Raw
from handtrack.sequences.readers.recognise import read_file

NAME = re.compile(r"(.*?)(\d{1,18})\.(npy|txt)", re.IGNORECASE)
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
    """The one sequence of files of one frame each; only those inside `frames` are opened.

    Raises:
        InputError: no file in that range, or one that is not like the first.
    """
    numbered = [(_number(p.name), p) for p in paths]
    chosen = [(n, p) for n, p in numbered if frames is None or frames[0] <= n <= frames[1]]
    if not chosen:
        there = f"{numbered[0][0]}:{numbered[-1][0]}"
        raise NoFramesError(f"no frame in {frames}, there are {there}", folder)
    read = [_one(path) for _, path in chosen]
    first = read[0]
    for raw in read:
        if raw.joints.shape != first.joints.shape or raw.unit != first.unit:
            raise InputError(
                f"holds {len(raw.joints)} frame(s) of {raw.joints.shape[1]} joints,"
                f" {first.path.name} one of {first.joints.shape[1]}",
                raw.path,
            )
    name = folder.resolve().name
    return [
        replace(
            first,
            joints=np.concatenate([raw.joints for raw in read]),
            path=folder,
            name=name,
            stamps=None,
            confidence=None,
            truth=None,
            frame_index=np.array([n for n, _ in chosen], dtype=np.int64),
            notes=(f"{len(read)} files of one frame each",),
        )
    ]


def _number(name: str) -> int:
    match = NAME.fullmatch(name)
    return 0 if match is None else int(match[2])


def _one(path: Path) -> Raw:
    raws = read_file(path)
    if len(raws) != 1:
        raise InputError(f"holds {len(raws)} hands, expected one", path)
    return raws[0]


def _is_one_frame(path: Path) -> bool:
    try:
        if path.stat().st_size > _LARGEST:
            return False
        raws = read_file(path)
    except (InputError, NotJointsError, OSError):
        return False  # read by itself it will say what is wrong
    return len(raws) == 1 and len(raws[0].joints) == 1 and raws[0].stamps is None
