"""Reader of text tables: CSV with or without titles, and FPHA's `skeleton.txt`.

With titles: a joint's name or number and an axis (`wrist_x`, `INDEX_FINGER_MCP_X`, `x0`, `x1` to
`x21`), of one hand or of both (`left_wrist_x`); beside them times, frame numbers, hands and
confidences, under any of the names in `names`. Joints without columns are missing. A title may
end in the unit (`wrist_x_mm`). Without titles: 63 numbers a line, 64 with a count before them,
126 of two hands, or 21 lines of 3 numbers. Empty cells are missing. A cell may hold a place or a
hand (`table_places`), a row one joint (`long_table`).

FPHA (Garcia-Hernando et al. 2018): frame index and 63 numbers a line [mm], right hands, its own
joint order, 30 frames a second.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.names import AXES, words
from handtrack.sequences.readers.aria import InDevice
from handtrack.sequences.readers.bare_table import read_bare, with_texts
from handtrack.sequences.readers.bone_ends import ends_as_joints
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.long_columns import long_columns
from handtrack.sequences.readers.long_table import read_long
from handtrack.sequences.readers.pictures import flat, seen_in_picture
from handtrack.sequences.readers.raw import (
    Array,
    NotJointsError,
    Raw,
    stem,
    usable_confidence,
)
from handtrack.sequences.readers.table_cells import Table, read_cells
from handtrack.sequences.readers.table_columns import HandColumns, read_columns
from handtrack.sequences.readers.table_remarks import remarked, stated
from handtrack.sequences.readers.table_rows import by_hand, exported, label_column, stamps_in
from handtrack.sequences.short_names import spelt_out
from handtrack.sequences.titles import column

_MOST_COLUMNS = 5000
_FEWEST_DOUBLED = 60
_OF_HAND = re.compile(r"(?i)(?:h|hand)[_ .-]?([0-3])[_ .-]+(\D.*|\d+\D.*)")
_FEWEST_OF_HAND = 36
"""Titles that begin with a hand's number, h0_x0 or hand_1_wrist_x."""
_PICTURE = {"image", "img", "picture", "pixel", "pixels", "px", "screen", "norm", "normalized"}
_MANUS = {"hand", "thumb_cmc", "thumb_dip", "index_cmc", "pinky_tip"}


def read_table(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a text table: one, or one of each hand.

    Raises:
        NotJointsError: text, but not a table of joints.
        InputError: a cell that is not a number, lines of different length, or a column that
            looks like a joint, a hand or a time and is not understood.
    """
    table = read_cells(data, path)
    raws = read_made(table, path)
    if table.unit is not None:
        raws = stated(raws, table.unit)
    raws = remarked(raws, table.remarks)
    if table.again:
        places = ", ".join(str(table.places[row] - 1) for row in table.again[:3])
        note = f"the titles stand again in line {places}: files that were joined"
        raws[0].notes = (*raws[0].notes, note)
    return raws


def read_made(table: Table, path: Path) -> list[Raw]:
    """The sequences of a table whose cells are known; errors as `read_table`."""
    if table.titles is not None and [t.lower() for t in table.titles] == list("xyz"):
        table.titles = None
    titles = with_texts(table) if table.titles is None else None
    if titles is not None:
        return _read_titled(replace(table, titles=titles), titles, path)
    if table.titles is None or all(c.isdigit() or not c for c in table.titles):
        return read_bare(table, path)
    table.titles = plain_axes(worlds_only(doubled(spelt_out(counted(table.titles)))))
    if table.width > _MOST_COLUMNS:
        raise NotJointsError(f"a table of {table.width} columns is of no hands", path)
    bones = ends_as_joints(table)
    if bones is not None:
        raws = read_made(bones[0], path)
        raws[0].notes = (*raws[0].notes, *filter(None, bones[1:]))
        return raws
    own = exported(table.titles)
    if own is not None:
        return _of_export(table, *own)
    long = long_columns(table, table.titles, path)
    if long is not None:
        return read_long(table.titles, long)
    numbers = {m[1] for t in table.titles if (m := _OF_HAND.fullmatch(t)) is not None}
    if not numbers or sum(map(bool, map(_OF_HAND.fullmatch, table.titles))) < _FEWEST_OF_HAND:
        return _read_titled(table, table.titles, path)
    raws = []
    for number in sorted(numbers):
        titles = [_of_hand(title, number) for title in table.titles]
        for raw in _read_titled(replace(table, titles=titles), titles, path):
            raws.append(raw)
            if len(numbers) > 1:
                raw.name, raw.by_number = f"{raw.name} hand {number}", raw.hand is None
    return raws


def _of_hand(title: str, number: str) -> str:
    """A title without the hand's number, "" of another hand's."""
    match = _OF_HAND.fullmatch(title)
    if match is None:
        return title
    return match[2] if match[1] == number else ""


def _read_titled(table: Table, titles: list[str], path: Path) -> list[Raw]:
    """The sequences of a table with a row for each frame; errors as `read_table`."""
    columns = read_columns(titles, path)
    if not table.lines:
        raise InputError("a header, but no frames", path)
    table.check_width()
    stamps, note = stamps_in(table, titles, columns)
    frame = None
    if columns.frame is not None:
        title = titles[columns.frame]
        values = table.numbers([columns.frame], [title])[:, 0]
        frame = frame_numbers(values, len(values), path, title)
    elif stamps is None and table.again:  # each file's frames begin anew
        begins = np.array([0, *table.again])
        rows = np.arange(len(table.lines))
        frame = rows - begins[np.searchsorted(begins, rows, "right") - 1]
    label = label_column(table, columns)
    notes = [note] if note else []
    if columns.unit is None and is_manus(titles):
        columns.unit = "cm"
        notes.append("Manus Core's columns: read as cm")
    unused = [*columns.unused, *(titles[c] for c in columns.maybe_label if c != label)]
    if unused:
        notes.append(f"columns not used: {', '.join(unused[:8])}")
    raws = []
    for hand, places in columns.hands.items():
        joints, confidence = _joints(table, titles, places)
        raw = Raw(
            joints,
            path,
            stem(path),
            confidence=confidence,
            hand=hand,
            unit=columns.unit,
            order=columns.order,
            frame_index=frame,
            stamps=stamps,
            notes=tuple(notes),
        )
        raw = flat(raw) if places.flat else seen_in_picture(raw, table.normalised)
        parts = by_hand(raw, table, titles, columns, label)
        if columns.order == "umetrack":
            parts = [replace(part, pending=InDevice()) for part in parts]
        raws += parts
        notes = []
    return raws


def _of_export(table: Table, observed: list[str], truth: list[str] | None) -> list[Raw]:
    """What was observed, and the truth, of a table that `handtrack export` wrote."""
    raws = _read_titled(replace(table, titles=observed), observed, table.path)
    if truth is not None:
        (places,) = read_columns(truth, table.path).hands.values()
        for raw in raws:
            raw.truth, _ = _joints(table, truth, places)
    return raws


def doubled(titles: list[str]) -> list[str]:
    """Titles that all stand twice, as Manus Core's of positions and then of rotations, so that
    the second ones are told apart."""
    count = Counter(titles)
    twice = [t for t, n in count.items() if n == 2]
    if len(twice) < _FEWEST_DOUBLED or max(count.values()) > 2:
        return titles
    seen: set[str] = set()
    out = []
    for title in titles:
        out.append(f"{title} rotation" if title in seen else title)
        seen.add(title)
    return out


_WORLD_AXIS = re.compile(r"(?<![A-Za-z])w([xyz])$", re.IGNORECASE)
_WORLDS = 36
"""So many coordinates called of the world are a hand's."""


def worlds_only(titles: list[str]) -> list[str]:
    """Titles of places in the picture left empty, where the same table has them in the world."""
    named = [_WORLD_AXIS.sub(r"world_\1", title) for title in titles]
    of_world = sum(a != b for a, b in zip(named, titles, strict=True))
    if of_world in (3 * N_JOINTS, 6 * N_JOINTS):
        titles = named
    places = [
        c for c, t in enumerate(titles) if (said := column(t)) is not None and said.axis is not None
    ]
    worlds = {c for c in places if "world" in words(titles[c])}
    if len(worlds) < _WORLDS:
        return titles
    axes = {w for c in worlds for w in words(titles[c]) if w in AXES}
    flat = {c for c, t in enumerate(titles) if axes & set(words(t)) and _PICTURE & set(words(t))}
    gone = (set(places) - worlds) | flat
    return ["" if c in gone else t for c, t in enumerate(titles)]


_P_AXIS = re.compile(r"(?<![A-Za-z])[pP]([xyzXYZ])$|(?<=[a-z])P([XYZ])$")


def plain_axes(titles: list[str]) -> list[str]:
    """Titles that end in px, py, pz, as engines write positions beside rotations, with x, y, z."""
    ends = [m[1] or m[2] for t in titles if (m := _P_AXIS.search(t)) is not None]
    count = Counter(end.lower() for end in ends)
    if not count or len(set(count.values())) > 1 or len(count) < 3:
        return titles
    plain = [_P_AXIS.sub(lambda m: m[1] or m[2], t) for t in titles]
    return plain if len(set(plain)) == len(set(titles)) else titles


_COUNTED = re.compile(r"(?i)(|f|feature|v|var|col|column|kp|coord|val|value|p|lm|x)[ _]?(\d{1,3})")


def counted(titles: list[str]) -> list[str]:
    """Titles of a hand's 63 numbers that only count them, beside those of a label or a time, as
    those of its joints."""
    found = {c: m for c, t in enumerate(titles) if (m := _COUNTED.fullmatch(t)) is not None}
    numbers = [int(m[2]) for m in found.values()]
    alike = len({m[1].lower() for m in found.values()}) == 1
    if not alike or len(found) == len(titles) or len(numbers) != 3 * N_JOINTS:
        return titles
    if numbers != list(range(numbers[0], numbers[0] + 3 * N_JOINTS)) or numbers[0] > 1:
        return titles
    named = dict(zip(found, (f"joint {k // 3} {'xyz'[k % 3]}" for k in range(63)), strict=True))
    return [named.get(c, title) for c, title in enumerate(titles)]


def is_manus(titles: list[str]) -> bool:
    """Whether a table is Manus Core's, by the joints that no other calls so."""
    there = {t.lower().replace("_position", "").rpartition("_")[0] for t in titles}
    return there >= _MANUS


def _joints(table: Table, titles: list[str], places: HandColumns) -> tuple[Array, Array | None]:
    """(T, N, 3) joints, NaN = missing, and their confidence (T, N)."""
    n = len(table.lines)
    joints = np.full((n, places.n_joints, 3), np.nan)
    at = np.array(list(places.joints), dtype=np.int64)
    sure = places.confidence
    columns = [*places.joints.values(), *sure.values()]  # each look at the text costs the same
    numbers = table.numbers(columns, [titles[c] for c in columns])
    values = numbers[:, len(at) :]
    joints[:, at[:, 0], at[:, 1]] = numbers[:, : len(at)]
    if not sure:
        return joints, None
    confidence = np.ones((n, places.n_joints))
    for joint, said in zip(sure, values.T, strict=True):
        # a whole hand's confidence counts for each joint
        rows = slice(None) if joint == -1 else joint
        confidence[:, rows] *= said[:, None] if joint == -1 else said
    return joints, usable_confidence(confidence, joints)


FORMATS = (
    Format(
        "CSV, tables",
        "columns by name or number (`wrist_x`, `INDEX_FINGER_MCP.x`, `x1` ... `z21`), of one hand"
        " or both; a row for each joint (`frame, hand, joint, x, y, z`); cells of `[x, y, z]`; 63"
        " or 126 bare numbers a line; commas, semicolons with decimal commas, tabs",
        "handtrack, or by name",
        "m, or as the columns say (`wrist_x_mm`)",
        "one or both",
        "its text",
        suffixes=(".csv", ".txt"),
    ),
    Format(
        "Manus Core, Rokoko",
        "CSV of joints (`Thumb_CMC_Position_X`, `Thumb_CMC_X`, `LeftFinger1Proximal_position_x`);"
        " rotations, velocities and pinches are left out",
        "by name",
        "cm (Manus), m (Rokoko)",
        "by name, or by the file's name",
        "its titles",
        "`--mirror` where the world is left-handed",
    ),
    Format(
        "First-person hand action (FPHA)",
        "`skeleton.txt`",
        "fpha",
        "mm",
        "right",
        "64 numbers a line",
        kinds={"fpha": read_table},
    ),
)
