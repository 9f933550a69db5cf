"""Numbers in cells as people's programs spell them: with their unit ("12.3 mm"), as a percentage,
with marks between thousands ("1,234.5", "1.234,5", "1'234.5")."""

from __future__ import annotations

import re
from pathlib import Path

from handtrack.errors import InputError
from handtrack.hand.units import METRES, Unit

_FIRST = 50
_MARKS = ".,'’_\u00a0\u202f"
_SUFFIXES = (*METRES, "%")
_PLAIN = re.compile(r"[-+]?\d{1,3}")
_SPACES = "'’_\u00a0\u202f \u2009"
"""Marks that only stand between thousands."""
_A_PLACE = 3
"""So many cells a line with a unit of length are of places: "5 m" alone may be minutes."""


def plain_numbers(
    lines: list[str], separator: str | None, path: Path
) -> tuple[list[str], Unit | None]:
    """Lines whose numbers are plain, and the unit of length that their cells state, if any.

    Raises:
        InputError: cells are in several units.
    """
    lines, unit = _without_units(lines, separator, path)
    return (lines if separator is None else _without_thousands(lines, separator)), unit


def _without_units(
    lines: list[str], separator: str | None, path: Path
) -> tuple[list[str], Unit | None]:
    end = r"\s" if separator is None else re.escape(separator)
    before = r"(?<!\S)" if separator is None else rf"(?:(?<=^)|(?<=[{end}\s]))"
    marks = _MARKS.replace(separator or " ", "")
    number = rf"[-+]?(?:\d[\d{marks}]*|\.\d+)(?:[eE][-+]?\d+)?"
    spelt = re.compile(rf"{before}({number})\s*({'|'.join(_SUFFIXES)})(?=\s*(?:{end}|$))")
    some = [spelt.findall(line) for line in lines[: _FIRST + 1]]
    lengths = [[unit for _, unit in found if unit != "%"] for found in some]
    there = {unit for found in lengths for unit in found}
    units: list[Unit] = [unit for unit in METRES if unit in there]
    of_places = max(map(len, lengths), default=0) >= _A_PLACE
    shares = any(unit == "%" for found in some for _, unit in found)
    if of_places and len(units) > 1:
        raise InputError(
            f"its cells are in {' and in '.join(units)}, expected one unit of length", path
        )
    if not of_places and not shares:
        return lines, None
    unit = units[0] if of_places else None

    def plain(match: re.Match[str]) -> str:
        number, suffix = match[1], match[2]
        if suffix == "%":
            return _hundredth(number)
        if of_places and suffix != unit:
            raise InputError(f"its cells are in {unit} and in {suffix}, expected one unit", path)
        return number if of_places else match[0]

    return [spelt.sub(plain, line) for line in lines], unit


def _hundredth(number: str) -> str:
    try:
        return repr(float(number.replace(",", ".")) / 100)
    except ValueError:
        return number


def _without_thousands(lines: list[str], separator: str) -> list[str]:
    rows = [[c.strip() for c in line.split(separator)] for line in lines[: _FIRST + 1]]
    mark = _mark_of(rows)
    if mark is None:
        return lines
    between = re.escape(mark)
    grouped = re.compile(rf"\s*[-+]?\d{{1,3}}(?:{between}\d{{3}})+(?:[.,]\d+)?\s*")
    return [
        separator.join(
            c.replace(mark, "") if mark in c and grouped.fullmatch(c) else c
            for c in line.split(separator)
        )
        for line in lines
    ]


def _mark_of(rows: list[list[str]]) -> str | None:
    """What stands between thousands; None where nothing does, or it may be the decimal point."""
    cells = [c for row in rows for c in row if c[-1:].isdigit()]
    for mark in _SPACES:
        whole = re.compile(rf"[-+]?\d{{1,3}}(?:{re.escape(mark)}\d{{3}})+(?:[.,]\d+)?")
        if any(mark in c and whole.fullmatch(c) for c in cells):
            return mark
    for mark, point in ((",", "."), (".", ",")):
        both = re.compile(rf"[-+]?\d{{1,3}}(?:\{mark}\d{{3}})+\{point}\d+")
        if any(mark in c and both.fullmatch(c) for c in cells):
            return mark
    return next((mark for mark in ",." if _groups(rows, cells, mark)), None)


def _groups(rows: list[list[str]], cells: list[str], mark: str) -> bool:
    """Whether a mark that might be the decimal point groups digits: always three behind it, none
    of 0 before it, and in the same column whole numbers below a thousand."""
    marked = [c for c in cells if mark in c]
    group = re.compile(rf"[-+]?[1-9]\d{{0,2}}\{mark}\d{{3}}")
    if not marked or not all(map(group.fullmatch, marked)):
        return False
    columns: dict[int, set[bool]] = {}
    for row in rows:
        for c, cell in enumerate(row):
            if mark in cell and group.fullmatch(cell):
                columns.setdefault(c, set()).add(True)
            elif _PLAIN.fullmatch(cell):
                columns.setdefault(c, set()).add(False)
    return any(len(kinds) == 2 for kinds in columns.values())
