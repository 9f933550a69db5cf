"""The rows of a table: when each was, and whose hand it is of; frames without rows; and what
`handtrack export` wrote, of whose many columns the observed joints and the truth are taken.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import as_side, words
from handtrack.sequences.readers.columns_at_once import MISSING
from handtrack.sequences.readers.fields import FINEST
from handtrack.sequences.readers.raw import Raw, as_hand, take_rows
from handtrack.sequences.readers.record_places import Places
from handtrack.sequences.readers.table_cells import Table
from handtrack.sequences.readers.table_columns import Columns
from handtrack.sequences.titles import side_if_true, time_unit


def stamps_in(
    table: Table, titles: list[str], columns: Columns
) -> tuple[Stamps | None, str | None]:
    """The times, and what to say of further ones."""
    pair = _seconds_and_nanoseconds(columns.times)
    if pair is not None:
        both = [table.texts(titles.index(t)) for t in pair]
        if all(c.isdigit() for column in both for c in column):
            values = [int(s) * 10**9 + int(ns) for s, ns in zip(*both, strict=True)]
            return Stamps(np.array(values, dtype=np.int64), pair[0], "ns"), None
    for unit in FINEST:
        for title in columns.times:
            if time_unit(title) != unit:
                continue
            held = table.held(titles.index(title))
            cells = table.texts(titles.index(title)) if held is None else []
            if held is None and all(c.lower() in MISSING for c in cells):
                continue
            others = [t for t in columns.times if t != title]
            note = f"timed by {title}, not by {', '.join(others[:4])}" if others else None
            places = Places("line", table.places)
            times = _as_numbers(cells) if held is None else held
            return Stamps(times, title, unit or None, places), note
    return None, None


def _seconds_and_nanoseconds(titles: list[str]) -> tuple[str, str] | None:
    """Columns of a ROS stamp, flattened."""
    parts = {time_unit(t): t for t in titles if words(t)[-1] not in ("time", "stamp", "timestamp")}
    if "s" in parts and "ns" in parts and words(parts["s"])[:-1] == words(parts["ns"])[:-1]:
        return (parts["s"], parts["ns"]) if len(words(parts["s"])) > 1 else None
    return None


def _as_numbers(cells: list[str]) -> Any:
    """Numbers where all cells are, with all digits of whole ones; else the cells."""
    if all(c.lstrip("-").isdigit() and len(c) < 20 for c in cells):
        values = [int(c) for c in cells]  # nanoseconds of today do not fit in a float
        return np.array(values, dtype=np.int64) if max(map(abs, values)) < 2**63 else cells
    if max(map(len, cells)) < 18:
        try:
            return np.array([np.nan if c.lower() in MISSING else float(c) for c in cells])
        except ValueError:
            return cells
    return cells


def label_column(table: Table, columns: Columns) -> int | None:
    """The column of the hands' names: a "label" or "type" may be of something else."""
    if columns.label is not None:
        return columns.label
    for c in columns.maybe_label:
        said = [cell for cell in table.texts(c) if cell.lower() not in MISSING]
        if said and all(as_side(cell) for cell in said):
            return c
    return None


def by_hand(
    raw: Raw, table: Table, titles: list[str], columns: Columns, label: int | None
) -> list[Raw]:
    """One of each hand that the lines name or number, where the columns do not."""
    keys: list[tuple[str, str]] = [("", "")] * len(table.lines)
    if label is not None and raw.hand is None:
        texts = table.texts(label)
        sides: dict[str, str] = {}
        for i, text in enumerate(texts):
            if text not in sides:
                sides[text] = _side(text, i, table, titles[label])
        keys = [(sides[text], "") for text in texts]
    if columns.number is not None and _doubled(keys, raw):
        numbers = table.texts(columns.number)
        keys = [(side, n) for (side, _), n in zip(keys, numbers, strict=True)]
    finite = np.isfinite(raw.joints).reshape(len(raw.joints), -1)
    seen: list[bool] = np.asarray(finite.any(axis=1)).tolist()
    for i, (side, _) in enumerate(keys):
        if label is not None and raw.hand is None and not side and seen[i]:
            raise InputError(f"line {table.places[i]}: {titles[label]} is empty", raw.path)
    groups = dict.fromkeys(
        k for k, there in zip(keys, seen, strict=True) if there
    ) or dict.fromkeys(keys)
    raws = []
    for key in groups:
        # a line in which nothing was seen is a frame of the only hand
        rows = [i for i, k in enumerate(keys) if k == key] if len(groups) > 1 else None
        part = replace(raw) if rows is None else take_rows(raw, np.array(rows, dtype=np.int64))
        side, number = key
        if side in ("left", "right"):
            part.hand = as_hand(side, raw.path)
        elif side or number:
            part.name = f"{raw.name} hand {side or number}" if len(groups) > 1 else raw.name
        if side.isdigit():
            part.by_number = True
            note = f"{titles[label or 0]} is {side}: which hand that is, the fingers tell"
            part.notes = (*part.notes, note)
        raws.append(part)
    return raws


_TRUE, _FALSE = {"true", "1", "1.0", "yes"}, {"false", "0", "0.0", "no"}


def _side(cell: str, row: int, table: Table, title: str) -> str:
    """ "left", "right", a number, or nothing."""
    if cell.lower() in MISSING:
        return ""
    asked = side_if_true(title)
    if asked is not None and cell.lower() in _TRUE | _FALSE:
        other = "left" if asked == "right" else "right"
        return asked if cell.lower() in _TRUE else other
    if cell in ("0", "1", "0.0", "1.0"):
        return cell[0]
    side = as_side(cell)
    if side is None:
        raise InputError(
            f"line {table.places[row]}: {title} is {cell[:40]!r}, expected left or right",
            table.path,
        )
    return side


def _doubled(keys: list[tuple[str, str]], raw: Raw) -> bool:
    """Whether a hand is there twice at one time, so that its number tells more than its name."""
    if not any(side for side, _ in keys):
        return True
    times = None if raw.stamps is None else raw.stamps.values
    when = raw.frame_index if raw.frame_index is not None else times
    return when is not None and len({*zip(keys, list(when), strict=True)}) < len(keys)


_ALL = [f"{name}_{axis}_mm" for name in JOINT_NAMES for axis in "xyz"]
OBSERVED, TRUTH = "observed_", "truth_"
_KEPT = ("frame", "time_ns", "hand")


def exported(titles: list[str]) -> tuple[list[str], list[str] | None] | None:
    """The titles of what was observed and of the truth, others left empty; None of another table.

    The second is None where no truth is in it.
    """
    there = set(titles)
    if not there.issuperset(OBSERVED + name for name in _ALL):
        return None
    observed = [_bare(t, OBSERVED) or (t if t in _KEPT else "") for t in titles]
    if not there.issuperset(TRUTH + name for name in _ALL):
        return observed, None
    return observed, [_bare(t, TRUTH) for t in titles]


def _bare(title: str, kind: str) -> str:
    name = title.removeprefix(kind)
    return name if name != title and name in _ALL else ""


_MOST_FILLED = 300


def filled(numbers: NDArray[np.int64], stamps: Stamps | None) -> bool:
    """Whether numbers without rows are frames in which nothing was seen."""
    steps = np.diff(numbers)
    if not len(steps) or (steps == 1).mean() < 0.5 or steps.max() > _MOST_FILLED:
        return False
    few = numbers[-1] - numbers[0] <= 3 * len(numbers) + 100
    return bool(few) and (stamps is None or isinstance(stamps.values, np.ndarray))


def between(stamps: Stamps, numbers: NDArray[np.int64], every: NDArray[np.int64]) -> Stamps:
    """Times of all frames, of those without rows between their neighbours'."""
    values = stamps.values
    since = values - values[0]
    between = np.interp(every, numbers, since.astype(np.float64))
    if values.dtype.kind == "i":
        full = np.round(between).astype(np.int64) + values[0]
        full[numbers - numbers[0]] = values
        return Stamps(full, stamps.name, stamps.unit)
    full = between + values[0]
    full[numbers - numbers[0]] = values
    return Stamps(full, stamps.name, stamps.unit)
