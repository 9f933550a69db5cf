"""The cells of a text table: what separates them, which lines are titles, numbers and texts."""

from __future__ import annotations

import re
from collections.abc import Callable
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.units import Unit
from handtrack.sequences.readers.columns_at_once import LARGE, MISSING, AtOnce, Coded
from handtrack.sequences.readers.label_cells import as_table
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.readers.spelt_numbers import plain_numbers
from handtrack.sequences.readers.table_lines import lines_of, unquoted, without_last, without_titles
from handtrack.sequences.readers.table_places import (
    NORMALISED,
    SEPARATOR,
    guarded,
    is_place,
    spread,
)
from handtrack.sequences.readers.text_places import with_points

_WORD = re.compile(r"(?i)\b(?:null|none|na|n/a|nat)\b|#n/a|(?<![\d.eE])-(?![\d.])")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
_MAX_TITLE_LINES = 4
_NARROW = 16
_FIRST = 50
# what MATLAB, R, pandas and spreadsheets call columns without names
_NUMBERED = re.compile(r"(?i)(?:var|v|col|column|feature|f|unnamed: )[_ ]?(\d+)")


@dataclass
class Table:
    """A table's lines, whose cells are only looked at where they are needed.

    Attributes:
        lines: those of data.
        places: each one's number in the file.
        separator: between cells; None: blanks.
        titles: of the columns; None where the table has none.
        first: the first line's cells, for messages.
        path: the file.
        normalised: whether its places are called normalised landmarks, as MediaPipe does.
        remarks: lines of comment above it.
        again: rows before which the titles stand again, as where files were joined.
        unit: of length, that its cells state behind each number.
    """

    lines: list[str]
    places: list[int]
    separator: str | None
    titles: list[str] | None
    first: list[str]
    path: Path
    normalised: bool = False
    remarks: list[str] = field(default_factory=list)
    again: list[int] = field(default_factory=list)
    unit: Unit | None = None
    _all: list[str] | None = field(default=None, init=False, repr=False)
    _once: AtOnce | None = field(default=None, init=False, repr=False)

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.first if self.titles is None else self.titles)

    def cells(self, row: int) -> list[str]:
        """One row's cells."""
        return _cells(self.lines[row], self.separator)

    def check_width(self) -> None:
        """Refuse lines of another length than the first.

        Raises:
            InputError: there is one.
        """
        once = self._at_once() if self.width <= _NARROW else None
        if once is not None and once.is_even():
            return
        mark, n = self.separator, self.width - 1
        for i, line in enumerate(self.lines):
            if (len(line.split()) - 1 if mark is None else line.count(mark)) != n:
                first = self.places[0] if self.titles is None else 1
                cut = i and i == len(self.lines) - 1
                raise InputError(
                    f"line {self.places[i]} has {len(self.cells(i))} columns,"
                    f" line {first} has {self.width}"
                    + (": it is cut short, leave it out" if cut else ""),
                    self.path,
                )

    def _at_once(self) -> AtOnce | None:
        """The rows as columns, of a large table."""
        mark, n = self.separator, len(self.lines)
        if self._once is None and mark is not None and n and n * len(self.lines[0]) > LARGE:
            self._once = AtOnce("\n".join(self.lines).encode(), mark, self.width, n)
        return self._once

    def coded(self, column: int) -> Coded:
        """What one column's cells say."""
        once = self._at_once()
        found = None if once is None else once.coded(column)
        return Coded.of(self.texts(column)) if found is None else found

    def texts(self, column: int) -> list[str]:
        """One column's cells."""
        if self.separator is None:
            return [line.split(None, column + 1)[column] for line in self.lines]
        if self.width <= _NARROW:
            if self._all is None:
                text = self.separator.join(self.lines)
                blank = " " in text or not text.isprintable()
                cells = text.split(self.separator)
                self._all = [c.strip() for c in cells] if blank else cells
            if len(self._all) == self.width * len(self.lines):  # all lines are as wide
                return self._all[column :: self.width]
        return [line.split(self.separator, column + 1)[column].strip() for line in self.lines]

    def held(self, column: int) -> NDArray[np.float64 | np.int64] | None:
        """One column's numbers, where the table is not of text and none is missing."""
        return None

    def numbers(self, columns: Items[int], names: Items[str]) -> Array:
        """(rows, columns) numbers, NaN for empty cells.

        Raises:
            InputError: a cell that is no number, with its line and its column's name.
        """
        if not len(columns):
            return np.empty((len(self.lines), 0))
        once = self._at_once()
        ways: list[Callable[[], Array | None]] = [
            lambda: self._plain(self.lines, columns),
            lambda: None if once is None else once.floats(columns),
            lambda: self._plain(self._without_blanks(), columns),
        ]
        for way in ways:
            found = way()
            if found is not None:
                return found
        return self._slowly(columns, names)

    def _plain(self, lines: list[str], columns: Items[int]) -> Array | None:
        """Numbers of lines that have some in all cells."""
        mark = self.separator
        try:
            return np.loadtxt(lines, delimiter=mark, usecols=columns, comments=None, ndmin=2)
        except ValueError:
            return None

    def _without_blanks(self) -> list[str]:
        """The lines with NaN in cells that are empty or say so."""
        s = self.separator
        text = "\n".join(self.lines)
        lower = text.lower()
        if any(word in lower for word in ("null", "none", "na", "n/a", f"-{s}", "-\n")):
            text = _WORD.sub("nan", text)
        if s is not None:
            if f" {s}" in text or f"{s} " in text:
                text = re.sub(f" *{re.escape(s)} *", s, text)
            text = f"\n{text}\n"
            for _ in range(2):  # neighbours share a separator
                text = text.replace(s + s, f"{s}nan{s}")
            text = text.replace(f"\n{s}", f"\nnan{s}").replace(f"{s}\n", f"{s}nan\n")
            text = text[1:-1]
        return text.split("\n")

    def _slowly(self, columns: Items[int], names: Items[str]) -> Array:
        out = np.empty((len(self.lines), len(columns)))
        for r in range(len(self.lines)):
            cells = self.cells(r)
            for c, column in enumerate(columns):
                cell = cells[column]
                try:
                    out[r, c] = np.nan if cell.lower() in MISSING else float(cell)
                except ValueError:
                    raise InputError(
                        f"line {self.places[r]}: {names[c]} is {cell[:20]!r}, expected a number",
                        self.path,
                    ) from None
        return out


def read_cells(data: bytes, path: Path) -> Table:
    """A text's lines as a table.

    Raises:
        NotJointsError: no text.
        InputError: no lines.
    """
    lines, places, remarks = lines_of(data, path)
    comment = remarks[-1] if remarks else ""
    if not lines:
        raise InputError("no lines in it", path)
    lines = with_points(lines)
    lines, places = as_table(lines, places) or (lines, places)
    quoted = b'"' in data and any('"' in line for line in lines)
    if not quoted:
        lines = guarded(lines)
    if re.fullmatch(r"sep=[,;|\t]", lines[0]):
        separator: str | None = lines[0][-1]
        lines, places = lines[1:], places[1:]
    else:
        separator = _separator(lines)
    if separator is not None and quoted:
        lines = unquoted(lines, separator, places, path)
        separator = SEPARATOR
    lines, unit = plain_numbers(lines, separator, path)
    n_titles = _title_lines(lines, separator)
    titles = [_cells(line, separator) for line in lines[:n_titles]]
    body, places, again = without_titles(lines[n_titles:], places[n_titles:], lines[:n_titles])
    if body and not titles and comment:
        # np.savetxt puts its header behind a "#"
        said = (
            _cells(comment, separator if separator in comment else None)
            if separator
            else comment.split()
        )
        if len(said) == len(_cells(body[0], separator)) and not any(map(is_number, said)):
            titles = [said]
    body = _points(body, separator)
    joined = numbered(_joined(titles))
    body = without_last(body, separator, joined)
    normalised = any(NORMALISED in line for line in body[:_FIRST])
    apart = spread(body, places, lambda line: _cells(line, separator), joined, path)
    if apart is not None:
        (body, joined), separator = apart, SEPARATOR
    table = Table(body, places, separator, joined, [], path, normalised, remarks, again, unit)
    table.first = table.cells(0) if body else []
    return table


def is_number(cell: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return bool(_DECIMAL_COMMA.fullmatch(cell))
    return True


def _separator(lines: list[str]) -> str | None:
    """What separates cells; blanks where nothing else does."""
    few = [lines[0], lines[-1], *lines[1:4]]
    for mark in (SEPARATOR, ";", "\t", ",", "|"):
        if all(mark in line for line in few):
            return mark
    return next((mark for mark in (";", "\t", ",", "|") if mark in lines[0]), None)


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return [cell.strip() for cell in line.split(separator)]


def _title_lines(lines: list[str], separator: str | None) -> int:
    """How many of the first lines are titles; those in which nothing was seen are none."""
    begin = next((n for n, line in enumerate(lines) if not _blank(line, separator)), 0)
    if begin:
        titles = _title_lines(lines[begin:], separator)
        return begin + titles if titles else 0
    for n, line in enumerate(lines[: _MAX_TITLE_LINES + 1]):
        cells = _cells(line, separator)
        full = [c for c in cells if c.lower() not in MISSING]
        numbers = [c for c in full if is_number(c) or is_place(c)]
        if n == 0 and len(numbers) > 1 and _counts(cells):
            continue
        if numbers and len(numbers) >= len(full) / 2:
            return n
        if n and (not full or _under(cells, _cells(lines[n - 1], separator))):
            return n  # a frame in which nothing was seen
    return 1


def _blank(line: str, separator: str | None) -> bool:
    """Whether all cells of a line are missing."""
    return all(c.lower() in MISSING for c in _cells(line, separator))


def _under(cells: list[str], titles: list[str]) -> bool:
    """Whether few cells are full, each under its title in a line of titles: a hand's name."""
    full = [c for c, cell in enumerate(cells) if cell.lower() not in MISSING]
    titled = [bool(title) for title in titles]
    few = 3 * len(full) < len(cells) and sum(titled) > 0.9 * len(cells)
    return few and all(c < len(titled) and titled[c] for c in full)


def _counts(cells: list[str]) -> bool:
    """Whether cells are 0, 1, 2, ... or 1, 2, 3, ...: the titles of columns without names."""
    if len(cells) > 9 and cells[0] == "":
        cells = cells[1:]
    counted = [cell for cell in cells if is_number(cell)]
    cells = counted if len(counted) > len(cells) - 4 else cells  # a label beside them
    if not cells:
        return False
    begin = cells[0]
    if len(cells) < 9 or begin not in ("0", "1"):
        return False
    return cells == [str(i) for i in range(int(begin), int(begin) + len(cells))]


def _joined(titles: list[list[str]]) -> list[str] | None:
    """Titles of several lines as one each; a merged cell stands over all that are empty."""
    if not titles:
        return None
    if len(titles) == 1:
        return titles[0]
    width = max(map(len, titles))
    parts: list[list[str]] = [[] for _ in range(width)]
    for n, line in enumerate(titles):
        full = {cell for cell in line[1:] if cell}
        if len(full) <= 1 and not (full and n == len(titles) - 1 and len(line) < 3):
            if not full and line[0]:  # pandas names its index in a line of its own
                parts[0] = [line[0]]
            continue  # the same over all columns: who made the file
        last = ""
        for c in range(width):
            cell = line[c] if c < len(line) else ""
            last = cell or (last if n < len(titles) - 1 else "")
            if last:
                parts[c].append(last)
    return [" ".join(p) for p in parts]


def numbered(titles: list[str] | None) -> list[str] | None:
    """Titles of columns without names (Var1, V1, ...) as their numbers."""
    found = [_NUMBERED.fullmatch(t) for t in titles or []]
    first = next((m for m in found if m is not None), None)
    if titles is None or first is None or len(titles) < 9 or not all(found):
        return titles
    numbers = [m[1] for m in found if m is not None]
    return numbers if len(set(numbers)) == len(numbers) else titles


def _points(lines: list[str], separator: str | None) -> list[str]:
    """Decimal commas as points, where commas separate nothing."""
    if separator == "," or not lines:
        return lines
    for line in lines[:50]:
        if "," in line and any(_DECIMAL_COMMA.fullmatch(c) for c in _cells(line, separator)):
            return [line.replace(",", ".") for line in lines]
    return lines
