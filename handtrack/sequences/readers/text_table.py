"""Reader of text tables: CSV with or without a header, and FPHA's `skeleton.txt`.

With a header: `wrist_x, wrist_y, wrist_z, thumb_cmc_x, ...` (this project's joint names, or
joint numbers as in `0_x`, `joint0_x`, `x0`), any columns left out are missing joints; beside
them `time`, `time_s`, `time_ms`, `time_us`, `time_ns`, `frame`, `hand`. A column's name may end
in the unit (`wrist_x_mm`). Without one: 63 numbers a line. Empty cells are missing.

FPHA (Garcia-Hernando et al. 2018): frame index and 63 numbers a line [mm], right hands, its own
joint order, 30 frames a second.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence as Items
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.fields import FRAME_KEYS, TIME_KEYS, frame_numbers
from handtrack.sequences.readers.raw import (
    Array,
    NotJointsError,
    Raw,
    Unit,
    as_hand,
    as_unit,
    stem,
)

_COLUMN = re.compile(r"(?P<joint>.+?)[_. ]?(?P<axis>[xyz])(?:[_ ]\(?(?P<unit>mm|cm|m)\)?)?")
_REVERSED = re.compile(r"(?P<axis>[xyz])_?(?P<joint>\d+)(?:_(?P<unit>mm|cm|m))?")
_NUMBER = re.compile(r"(?:joint|kp|j|landmark)?_?(\d+)")
_MISSING = {"", "nan", "na", "null", "none"}


def read_table(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a text table: one, or one per hand where a `hand` column says so.

    Raises:
        NotJointsError: text, but not a table of joints.
        InputError: a cell that is not a number, or lines of different length.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise NotJointsError(f"not UTF-8 text (byte {error.start})", path) from None
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(i, line) for i, line in lines if not line.lstrip().startswith("#")]
    if not lines:
        raise InputError("no lines in it", path)
    delimiter = next((d for d in (",", ";", "\t") if d in lines[0][1]), None)
    first = _cells(*lines[0], delimiter, path)
    # what the first line is decides whether this is a table of joints at all
    if any(map(_is_number, first)) and all(_is_number(c) or c.lower() in _MISSING for c in first):
        if len(first) not in (3 * N_JOINTS, 3 * N_JOINTS + 1):
            raise NotJointsError(
                f"a table of {len(first)} columns without a header, expected 63 (21 joints x 3)"
                " or 64 (FPHA: the frame before them)",
                path,
            )
        return [_bare(_rows(lines, delimiter, path), path)]
    columns = _columns(first, path)
    return _named(columns, first, _rows(lines, delimiter, path)[1:], path)


def _cells(number: int, line: str, delimiter: str | None, path: Path) -> list[str]:
    if delimiter is None:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error as error:
        raise InputError(f"line {number}: {error}", path) from None


def _rows(
    lines: list[tuple[int, str]], delimiter: str | None, path: Path
) -> list[tuple[int, list[str]]]:
    rows: list[tuple[int, list[str]]] = []
    for number, line in lines:
        cells = _cells(number, line, delimiter, path)
        rows.append((number, cells))
        if len(cells) != len(rows[0][1]):
            raise InputError(
                f"line {number} has {len(cells)} columns, line {rows[0][0]} has {len(rows[0][1])}",
                path,
            )
    return rows


def _bare(rows: list[tuple[int, list[str]]], path: Path) -> Raw:
    """A table of numbers alone: 63 columns, or FPHA's 64."""
    width = len(rows[0][1])
    values = _numbers(rows, range(width), [f"column {c + 1}" for c in range(width)], path)
    if width == 3 * N_JOINTS:
        return Raw(values.reshape(-1, N_JOINTS, 3), path, stem(path))
    frame = frame_numbers(values[:, 0], len(rows), path, "the frame index (column 1)")
    return Raw(
        values[:, 1:].reshape(-1, N_JOINTS, 3),
        path,
        _fpha_name(path),
        hand="right",
        unit="mm",
        order="fpha",
        frame_index=frame,
        fps=30.0,
        subject=next((p for p in path.parts if p.lower().startswith("subject")), ""),
    )


def _fpha_name(path: Path) -> str:
    """Every FPHA file is called skeleton.txt, in a folder ACTION/NUMBER."""
    if stem(path) != "skeleton":
        return stem(path)
    return " ".join(path.resolve().parts[-3:-1]) or "skeleton"


@dataclass
class _Columns:
    """What the columns of a table with a header are.

    Attributes:
        joints: column of each (joint, axis).
        unit: the unit in their titles.
        other: column of each other title, in lower case.
    """

    joints: dict[tuple[int, int], int]
    unit: Unit | None
    other: dict[str, int]


def _columns(header: list[str], path: Path) -> _Columns:
    joints: dict[tuple[int, int], int] = {}
    units: set[Unit | None] = set()
    other: dict[str, int] = {}
    for c, title in enumerate(header):
        place = _joint_column(title)
        if place is None:
            other[title.lower()] = c
            continue
        joint, axis, unit = place
        if (joint, axis) in joints:
            raise InputError(f"two columns for {JOINT_NAMES[joint]} {'xyz'[axis]}", path)
        joints[joint, axis] = c
        units.add(None if unit is None else as_unit(unit, path))
    if not joints:
        found = ", ".join(header[:6])[:60]
        raise NotJointsError(
            f"no joints in it: expected columns such as wrist_x, found {found}", path
        )
    if len(units) > 1:
        raise InputError("columns of different units", path)
    for joint in {j for j, _ in joints}:
        for axis in range(3):
            if (joint, axis) not in joints:
                raise InputError(f"no column for {JOINT_NAMES[joint]} {'xyz'[axis]}", path)
    return _Columns(joints, units.pop(), other)


def _named(
    columns: _Columns, header: list[str], rows: list[tuple[int, list[str]]], path: Path
) -> list[Raw]:
    other = columns.other
    if not rows:
        raise InputError("a header, but no frames", path)
    joints = np.full((len(rows), N_JOINTS, 3), np.nan)
    places = list(columns.joints.values())
    values = _numbers(rows, places, [header[c] for c in places], path)
    for (joint, axis), column in zip(columns.joints, values.T, strict=True):
        joints[:, joint, axis] = column
    raw = Raw(joints, path, stem(path), unit=columns.unit)
    time = next((k for k in TIME_KEYS if k in other), None)
    if time is not None:
        lines = [f"line {number}" for number, _ in rows]
        texts = [cells[other[time]] for _, cells in rows]
        raw.stamps = Stamps(texts, time, TIME_KEYS[time], lines)
    frame = next((k for k in FRAME_KEYS if k in other), None)
    if frame is not None:
        values = _numbers(rows, [other[frame]], [frame], path)[:, 0]
        raw.frame_index = frame_numbers(values, len(rows), path, frame)
    unknown = [k for k in other if k not in (time, frame, "hand")]
    if unknown:
        raw.notes = (f"columns not used: {', '.join(unknown[:8])}",)
    if "hand" not in other:
        return [raw]
    labels = [as_hand(cells[other["hand"]], path, f"line {i}: hand") for i, cells in rows]
    return [_part(raw, np.array([v == hand for v in labels]), hand) for hand in _unique(labels)]


def _unique(labels: Items[str]) -> list[str]:
    return list(dict.fromkeys(labels))


def _part(raw: Raw, keep: np.ndarray, hand: str) -> Raw:
    return Raw(
        raw.joints[keep],
        raw.path,
        raw.name,
        hand=as_hand(hand, raw.path),
        unit=raw.unit,
        stamps=None if raw.stamps is None else raw.stamps.take(np.flatnonzero(keep)),
        frame_index=None if raw.frame_index is None else raw.frame_index[keep],
        notes=raw.notes,
    )


def _joint_column(title: str) -> tuple[int, int, str | None] | None:
    """Joint, axis and unit that a column's title names, or None."""
    text = title.strip().lower()
    match = _REVERSED.fullmatch(text) or _COLUMN.fullmatch(text)
    if match is None:
        return None
    name, unit = match["joint"], match["unit"]
    axis = "xyz".index(match["axis"])
    if name in JOINT_NAMES:
        return JOINT_NAMES.index(name), axis, unit
    number = _NUMBER.fullmatch(name)
    if number is None or int(number[1]) >= N_JOINTS:
        return None
    return int(number[1]), axis, unit


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _numbers(
    rows: list[tuple[int, list[str]]], columns: Items[int] | range, names: list[str], path: Path
) -> Array:
    """(rows, columns) numbers, NaN for empty cells."""
    out = np.empty((len(rows), len(names)))
    for r, (line, cells) in enumerate(rows):
        for c, column in enumerate(columns):
            cell = cells[column]
            if cell.lower() in _MISSING:
                out[r, c] = np.nan
                continue
            try:
                out[r, c] = float(cell)
            except ValueError:
                raise InputError(
                    f"line {line}: {names[c]} is {cell[:20]!r}, expected a number", path
                ) from None
    return out
