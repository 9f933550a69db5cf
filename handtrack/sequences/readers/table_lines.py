"""The lines of a text table."""

from __future__ import annotations

import csv
from bisect import bisect_left
from collections.abc import Iterator
from collections.abc import Sequence as Items
from pathlib import Path

from handtrack.errors import InputError
from handtrack.sequences.readers.jsontext import as_utf8
from handtrack.sequences.readers.raw import NotJointsError
from handtrack.sequences.readers.table_places import SEPARATOR

_LONGEST = 200_000
_HEAD = 20
"""Lines in which titles and notes stand, whose letters may be of a Windows code page."""
_ASCII = bytes(range(128))
_MOST_JOINED = 300
"""So many lines a quoted cell may have."""


def _text(data: bytes, path: Path) -> str:
    try:
        return as_utf8(data).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        rows = data.split(b"\n", _HEAD)[_HEAD:]
        if not any(row.translate(None, _ASCII) for row in rows) and b"\0" not in data:
            return data.decode("cp1252", "replace")
        reason = f"not UTF-8 text (byte {error.start}): save it as UTF-8"
        raise NotJointsError(reason, path) from None


def lines_of(data: bytes, path: Path) -> tuple[list[str], list[int], list[str]]:
    """Lines with something in them, their numbers, and the comments before the first.

    Raises:
        NotJointsError: no text.
        InputError: a line that is too long for a row.
    """
    text = _text(data, path)
    plain = _plain_lines(text)
    if plain is not None:
        return plain, list(range(1, len(plain) + 1)), []
    lines: list[str] = []
    places: list[int] = []
    comments: list[str] = []
    for number, line in _whole(text.replace("\r\n", "\n").replace("\r", "\n").split("\n")):
        start = line.lstrip()
        if not start:
            continue
        if start[0] == "#":
            if not lines:
                comments.append(start.lstrip("#").strip())
            continue
        if len(line) > _LONGEST:
            raise InputError(f"line {number} has {len(line):,} letters: no row of a table", path)
        lines.append(line)
        places.append(number)
    return lines, places, comments


def _plain_lines(text: str) -> list[str] | None:
    """The lines of a text without comments, blank and long ones, and cells of several lines: the
    usual case. None where it has any."""
    if "#" in text or "\r" in text.replace("\r\n", ""):
        return None
    lines = text.replace("\r\n", "\n").split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines or not all(map(str.strip, lines)) or max(map(len, lines)) > _LONGEST:
        return None
    if '"' in text and any(line.count('"') % 2 for line in lines):
        return None
    return lines


def _whole(lines: list[str]) -> Iterator[tuple[int, str]]:
    """Lines with their numbers; those that a quoted cell goes over as one."""
    at, joins = 0, True
    while at < len(lines):
        line, n = lines[at], 1
        if joins and '"' in line and line.count('"') % 2:
            more = enumerate(lines[at + 1 : at + _MOST_JOINED], 2)
            n = next((n for n, other in more if other.count('"') % 2), 0)
            joins = n > 0  # a quote that nothing closes
            n = n or 1
            line = " ".join(lines[at : at + n])
        yield at + 1, line
        at += n


def unquoted(lines: list[str], separator: str, places: Items[int], path: Path) -> list[str]:
    """Lines whose cells may be in quotes, as lines of cells between `SEPARATOR`.

    Raises:
        InputError: a line that cannot be read.
    """
    return _all_unquoted(lines, separator) or [
        _unquoted(line, separator, place, path) for line, place in zip(lines, places, strict=True)
    ]


def _all_unquoted(lines: list[str], separator: str) -> list[str] | None:
    """All lines' cells, None where one goes over several or cannot be read."""
    try:
        cells = csv.reader(lines, delimiter=separator, skipinitialspace=True)
        out = [SEPARATOR.join(row) for row in cells]
    except csv.Error:
        return None
    return out if len(out) == len(lines) else None


def _unquoted(line: str, separator: str, place: int, path: Path) -> str:
    try:
        return SEPARATOR.join(next(csv.reader([line], delimiter=separator, skipinitialspace=True)))
    except csv.Error as error:
        raise InputError(f"line {place}: {error}", path) from None


def without_titles(
    body: list[str], places: list[int], titles: list[str]
) -> tuple[list[str], list[int], list[int]]:
    """Lines of data and their numbers without those that are the titles again, and the rows that
    these stood before."""
    if not titles or titles[-1] not in body:
        return body, places, []
    known = set(titles)
    kept = [i for i, line in enumerate(body) if line not in known]
    lost = [i for i, line in enumerate(body) if line == titles[-1]]
    again = sorted({bisect_left(kept, row) for row in lost} - {0, len(kept)})
    return [body[i] for i in kept], [places[i] for i in kept], again


def without_last(lines: list[str], separator: str | None, titles: list[str] | None) -> list[str]:
    """Lines without a separator at the end that separates nothing."""
    if (
        separator is None
        or not lines
        or not all(li.rstrip(" ").endswith(separator) for li in lines)
    ):
        return lines
    if titles is not None and lines[0].count(separator) != len(titles):
        return lines
    return [line.rstrip(" ")[:-1] for line in lines]
