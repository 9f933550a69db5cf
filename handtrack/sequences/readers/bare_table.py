"""Tables of numbers without titles: what their columns are is guessed from how many there are,
checked against the hand's geometry, and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, ORDERS
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import as_side
from handtrack.sequences.readers.both_hands import two_hands
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.joint_frames import JOINT_COUNTS as COUNTS
from handtrack.sequences.readers.joint_frames import PAIRS
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem
from handtrack.sequences.readers.table_cells import Table, is_number
from handtrack.sequences.size import fitting_unit
from handtrack.sequences.skeleton_check import GOOD, misfit

_FAR_BETTER = 0.8
"""One order makes so much better a hand than another, at least."""


def read_bare(table: Table, path: Path) -> list[Raw]:
    """The sequences of a table of numbers.

    Raises:
        NotJointsError: a number of columns that makes no joints.
        InputError: a cell that is no number, or a first column that counts nothing.
    """
    width = table.width
    if not table.lines:
        raise InputError("a header, but no frames", path)
    begin, n, per_joint = _layout(table, path)
    table.check_width()
    values = table.numbers(range(width), [f"column {c + 1}" for c in range(width)])
    first = values[:, 0] if begin else None
    labelled = begin and (n, per_joint) == (N_JOINTS, 3) and is_label_last(values)
    if labelled:
        begin, first, values = 0, None, values[:, :-1]
    if width == 3:
        frames = values.reshape(-1, n, 3)
    else:
        frames = values[:, begin:].reshape(len(values), n, per_joint)
    confidence = frames[..., 3] if per_joint == 4 else None
    raw = Raw(frames[..., :3], path, stem(path), confidence=confidence)
    if labelled:
        return two_hands(replace(raw, notes=(LABELLED,)))
    if n in COUNTS:
        (pictured,) = two_hands(raw)
        if pictured.picture:
            return [_with_count(pictured, first, table, path)]
        return [_one_hand(raw, first, table, path)]
    return two_hands(_with_count(raw, first, table, path))


def with_texts(table: Table) -> list[str] | None:
    """Titles for a table without any that has words before or behind the 63 numbers of a hand: a
    hand's name, a time, a label; None of any other."""
    texts = [c for c, cell in enumerate(table.first) if cell and not is_number(cell)]
    n = len(table.first) - len(texts)
    others = [c for c in range(len(table.first)) if c not in texts]
    if not texts or n not in (3 * N_JOINTS, 3 * N_JOINTS + 1) or len(texts) > 4:
        return None
    few = [table.cells(row)[others[0]] for row in range(min(3, len(table.lines)))]
    counts = len({*few}) == 3 and all(c.isdigit() for c in few)
    is_time = not counts and others[0] < texts[0] and _goes_on(table, others[0])
    extra = {others[0 if counts or is_time else -1]} if n > 3 * N_JOINTS else set()
    numbers = iter([f"{axis}{j}" for j in range(N_JOINTS) for axis in "xyz"])
    titles = []
    for c, cell in enumerate(table.first):
        if c in texts:
            time = cell[:1].isdigit() and ":" in cell
            titles.append("timestamp" if time else "hand" if as_side(cell) else f"label {c}")
        else:
            name = "frame" if counts else "time" if is_time else f"label {c}"
            titles.append(name if c in extra else next(numbers))
    return titles


def _goes_on(table: Table, column: int) -> bool:
    """Whether a column's numbers rise and never fall: times."""
    try:
        values = np.array([float(cell) for cell in table.texts(column)])
    except (ValueError, IndexError):
        return False
    steps = np.diff(values)
    return len(steps) > 0 and bool((steps >= 0).all()) and bool((steps > 0).any())


LABELLED = "64 columns without titles: the last one is none of a hand and was left out"


def is_label_last(values: Array) -> bool:
    """Whether of (T, 64) numbers the last is none of a hand's, and not the first: a label."""
    before, after = (
        misfit(part.reshape(-1, N_JOINTS, 3), ORDERS["handtrack"])
        for part in (values[:, :-1], values[:, 1:])
    )
    return bool(before < min(GOOD, _FAR_BETTER * after)) or bool(before < GOOD and np.isnan(after))


def _layout(table: Table, path: Path) -> tuple[int, int, int]:
    """How many columns stand before the joints, how many joints there are, numbers of each."""
    width = table.width
    if width == 3 and len(table.lines) % N_JOINTS == 0:
        return 0, N_JOINTS, 3
    numbered = table.titles is not None and table.titles[0] == ""
    for per_joint, known in ((3, [*COUNTS, *PAIRS]), (4, [N_JOINTS, 2 * N_JOINTS])):
        for begin in (1,) if numbered else (0, 1):
            n, rest = divmod(width - begin, per_joint)
            if rest == 0 and n in known:
                return begin, n, per_joint
    raise NotJointsError(
        f"a table of {width} columns without a header, expected 63 (21 joints x 3), 64 (the frame"
        " before them) or 126 (two hands); a frame has one of"
        f" {', '.join(map(str, COUNTS))} joints",
        path,
    )


def _one_hand(raw: Raw, first: Array | None, table: Table, path: Path) -> Raw:
    n = raw.joints.shape[1]
    if first is None or n != N_JOINTS or raw.confidence is not None:
        return _with_count(raw, first, table, path)
    if stem(path) == "skeleton" and table.separator is None:
        return _fpha(raw, first, path)
    ours, theirs = (misfit(raw.joints, ORDERS[order]) for order in ("handtrack", "fpha"))
    if theirs < _FAR_BETTER * ours:
        note = "64 columns without titles: read as FPHA's (index, its joint order, mm)"
        return replace(_fpha(raw, first, path), notes=(note,))
    if ours > _FAR_BETTER * theirs:
        raise InputError(
            "64 columns without titles: neither this project's joint order nor FPHA's makes a"
            " hand of them (--order says which it is, titles as x0, y0, z0 say it too)",
            path,
        )
    raw = _with_count(raw, first, table, path)
    unit = fitting_unit(raw.joints)
    note = f"joints in this project's order{'' if unit is None else f', in {unit}'}"
    return replace(raw, unit=unit, notes=(*raw.notes, f"64 columns without titles: {note}"))


def _with_count(raw: Raw, first: Array | None, table: Table, path: Path) -> Raw:
    """With what stands in the first column: a count of frames, or their times."""
    if first is None or (table.titles is not None and table.titles[0] == ""):
        return raw  # pandas counts lines
    steps = np.diff(first)
    whole = bool((first == np.round(first)).all())
    if len(steps) and (steps > 0).mean() > 0.9 and (not whole or np.median(steps) > 5):
        cells = table.texts(0)
        exact = all(c.isdigit() and len(c) < 19 for c in cells)
        values = np.array([int(c) for c in cells], dtype=np.int64) if exact else first
        note = "the first column was read as times"
        return replace(raw, stamps=Stamps(values, "column 1"), notes=(*raw.notes, note))
    frame = frame_numbers(first, len(first), path, "the frame index (column 1)")
    note = "the first column was read as frame numbers"
    return replace(raw, frame_index=frame, notes=(*raw.notes, note))


def _fpha(raw: Raw, first: Array, path: Path) -> Raw:
    return replace(
        raw,
        name=_fpha_name(path),
        hand="right",
        unit="mm",
        order="fpha",
        frame_index=frame_numbers(first, len(first), path, "the frame index (column 1)"),
        fps=30.0,
        subject=next((p for p in path.parts if p.lower().startswith("subject")), ""),
    )


def _fpha_name(path: Path) -> str:
    """Every FPHA file is called skeleton.txt, in a folder ACTION/NUMBER."""
    if stem(path) != "skeleton":
        return stem(path)
    return " ".join(path.resolve().parts[-3:-1]) or "skeleton"
