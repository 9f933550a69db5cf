"""Reader of OptiTrack Motive's CSV export, of version 1.x ("Data Export: CSV" of its documents).

    Format Version,1.23,Take Name,a,...,Export Frame Rate,120.0,...,Length Units,Meters,...

    ,Type,Bone,Bone,...,Marker,...
    ,Name,Ann:RHand,Ann:RHand,...,Ann:RThumb3,...
    ,ID,1,1,...
    ,Parent,0,0,...
    ,,Rotation,...,Position,...
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,...
    0,0.000000,...

Rotations and qualities are passed over, empty cells are missing. Markers, or bones, are joints by
their names or by `--markers`.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from handtrack.errors import InputError, shown
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.companions import Companions
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.jsontext import as_utf8
from handtrack.sequences.readers.markers import (
    Markers,
    by_hand,
    frames_told,
    stated_unit,
    told_apart,
)
from handtrack.sequences.readers.raw import Raw, as_fps, stem
from handtrack.sequences.readers.table_cells import Table

START = b"format version"
_KINDS = ("marker", "bone", "bone marker", "rigid body marker", "marker set", "rigid body")
"""Types of what has a position; of one name in several, what was measured comes first."""
_RELATIVE = ("bone",)
_HEAD, _MOST = 20, 5000
_VERSION = re.compile(r"1\.\d+")
_COMMA = re.compile(r"\d+,\d+")


class _Column(NamedTuple):
    """What has a position: its type and name, and the column of its x; y and z follow."""

    kind: str
    name: str
    at: int


@dataclass(frozen=True)
class _Named(Markers):
    """Markers, bones and others: the joints are of the type that has most of them."""

    kinds: tuple[str, ...] = ()

    def resolved(self, raw: Raw, companions: Companions) -> list[Raw]:
        """As of markers; by a companion those of all types."""
        if companions.markers is None:
            there = sorted(dict.fromkeys(self.kinds), key=_KINDS.index)
            best = max(there, key=self._joints_of)
            taken = [i for i, kind in enumerate(self.kinds) if kind == best]
        else:
            first: dict[str, int] = {}
            for i in sorted(range(len(self.names)), key=lambda i: _KINDS.index(self.kinds[i])):
                first.setdefault(self.names[i], i)
            taken = sorted(first.values())
        names = tuple(self.names[i] for i in taken)
        return Markers(names).resolved(replace(raw, joints=raw.joints[:, taken]), companions)

    def _joints_of(self, kind: str) -> int:
        own = [n for n, k in zip(self.names, self.kinds, strict=True) if k == kind]
        try:
            found = by_hand({n: n for n in own}, Path())
        except InputError:  # two are one joint: said where they are taken
            return 0
        return sum(map(len, found.values()))


def read_motive(data: bytes, path: Path) -> list[Raw]:
    """The markers or bones of an export of Motive, joints by their names or by a companion.

    Raises:
        InputError: another version, a header that is cut short, or rows that do not fit it.
    """
    text = as_utf8(data).decode("utf-8", "replace").removeprefix("\ufeff").lstrip()
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    mark = lines[0][len(START) : len(START) + 1]
    said = _said(_cells(lines[0], mark), path)
    named = next((i for i, li in enumerate(lines[:_HEAD]) if li.lower().startswith("frame")), None)
    if named is None:
        raise InputError(
            "the header is cut short: expected a line that begins with Frame,Time", path
        )
    titles = _cells(lines[named], mark)
    columns = _columns([_cells(li, mark) for li in lines[1:named]], titles, path)
    notes: list[str] = []
    if said.get("coordinate space", "").lower() == "local":
        kept = [c for c in columns if c.kind not in _RELATIVE]
        if not kept:
            raise InputError(
                "its bones are relative to their parents (Coordinate Space is Local): export them"
                " with Coordinate Space Global",
                path,
            )
        if len(kept) < len(columns):
            notes.append("bones relative to their parents (Coordinate Space Local): left out")
        columns = kept
    table = _table(lines, named, titles, mark, path)
    notes += frames_told(said.get("total exported frames", ""), len(table.lines))
    return [_raw(table, columns, said, notes)]


def _raw(table: Table, columns: list[_Column], said: dict[str, str], notes: list[str]) -> Raw:
    path, titles = table.path, table.titles or []
    taken = [c.at + axis for c in columns for axis in range(3)]
    values = table.numbers(taken, [f"{shown(c.name, 40)} {a}" for c in columns for a in "XYZ"])
    names = tuple(c.name for c in columns)
    raw = Raw(
        values.reshape(len(values), -1, 3),
        path,
        stem(path),
        pending=_Named(names, kinds=tuple(c.kind for c in columns)),
        notes=tuple(notes),
    )
    raw.unit = stated_unit(said.get("length units", "").lower(), path)
    rate = said.get("export frame rate") or said.get("capture frame rate")
    raw.fps = as_fps(rate, path) if rate else None
    frames = table.numbers([0], ["Frame"])[:, 0]
    raw.frame_index = frame_numbers(frames, len(frames), path, "Frame")
    clock = next((i for i, t in enumerate(titles) if t.lower().startswith("time (")), None)
    if clock is not None and len(values) > 1:
        times = table.numbers([clock], ["Time"])[:, 0]
        raw.stamps = Stamps(times, "Time", "s", [f"line {n}" for n in table.places])
    return raw


def _cells(line: str, mark: str) -> list[str]:
    cells = [cell.strip() for cell in next(csv.reader([line], delimiter=mark or ","), [])]
    if mark == ";":  # as spreadsheets save it where decimals have a comma
        return [cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell for cell in cells]
    return cells


def _said(cells: list[str], path: Path) -> dict[str, str]:
    """What the first line says, by its names."""
    said: dict[str, str] = {}
    for key, value in pairwise(cells):
        said.setdefault(key.lower(), value)
    version = said.get("format version", "")
    if not _VERSION.fullmatch(version):
        raise InputError(
            f"line 1: Format Version is {shown(version, 20)!r}, expected 1.x as Motive writes it:"
            " export the take as CSV once more, with its header",
            path,
        )
    return said


def _columns(head: list[list[str]], titles: list[str], path: Path) -> list[_Column]:
    """What has a position, from the rows between the first line and that of Frame."""
    kinds = _row(head, "type", {*_KINDS})
    places = _row(head, "", {"position", "rotation"})
    below = head.index(kinds) + 1 if kinds in head else 0
    names = _row(head, "name", set()) or (head[below] if 0 < below < len(head) else [])
    for row, what in ((kinds, "Type"), (names, "Name"), (places, "Rotation and Position")):
        if not row:
            raise InputError(f"the header has no row of {what}: it is cut short", path)
    if len(titles) > 3 * _MOST:
        raise InputError(f"the line of Frame has {len(titles)} columns", path)
    found: list[_Column] = []
    width = min(map(len, (kinds, names, places, titles)))
    c = 0
    while c + 2 < width:
        some = slice(c, c + 3)
        whole = [t.lower() for t in titles[some]] == ["x", "y", "z"]
        whole &= all(p.lower() == "position" for p in places[some]) and len({*names[some]}) == 1
        if whole and kinds[c].lower() in _KINDS and names[c]:
            found.append(_Column(kinds[c].lower(), names[c], c))
        c += 3 if whole else 1
    if not found:
        there = ", ".join(dict.fromkeys(k for k in kinds[2:] if k)) or "none"
        raise InputError(
            f"no markers or bones with a position, types are {shown(there, 80)}: export Markers or"
            " Bones",
            path,
        )
    names = told_apart([column.name for column in found], [column[:2] for column in found])
    return [column._replace(name=name) for column, name in zip(found, names, strict=True)]


def _row(head: list[list[str]], label: str, among: set[str]) -> list[str]:
    """The row of a label in its first cells, else the one that has such cells; [] if none."""
    for row in head:
        if label and label in (cell.lower() for cell in row[:2]):
            return row
    return next((row for row in head if among & {cell.lower() for cell in row}), [])


def _table(lines: list[str], named: int, titles: list[str], mark: str, path: Path) -> Table:
    """The frames, each line as wide as the titles.

    Raises:
        InputError: no frames, or a line of another width.
    """
    rows = [(n, li) for n, li in enumerate(lines[named + 1 :], named + 2) if li.strip()]
    if not rows:
        raise InputError("a header, but no frames", path)
    width, even = len(titles), []
    for n, line in rows:
        while line.endswith(mark) and line.count(mark) >= width:
            line = line[:-1]
        if line.count(mark) != width - 1:
            cut = n == rows[-1][0]
            raise InputError(
                f"line {n} has {line.count(mark) + 1} columns, expected {width} as the line of"
                f" Frame has{': it is cut short, leave it out' if cut else ''}",
                path,
            )
        even.append(line.replace(",", ".") if mark == ";" else line)
    return Table(even, [n for n, _ in rows], mark, titles, [], path)


def _is_motive(text: bytes, path: Path) -> bool:
    return text[: len(START)].lower() == START and text[len(START) : len(START) + 1] in (
        *(b",", b";", b"\t"),
    )


FORMATS = (
    Format(
        "Motion capture: OptiTrack Motive",
        "CSV export 1.x of markers or bones named as joints, or by a file of pairs",
        "by name",
        "as the file says",
        "by name",
        "`Format Version`",
        "`--markers FILE` for other names",
        kinds={"motive": read_motive},
        ways=(Way("text", _is_motive, read_motive),),
    ),
)
