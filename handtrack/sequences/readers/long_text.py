"""Text files of gigabytes, some megabytes at a time: of the text no more is in memory than that.

Tables, JSON lines and lists of objects say in each block the same as in the whole, where their
titles, hands and forms are the same throughout. Whatever differs from block to block, or cannot be
read, is read as a whole file is, which also says what is wrong and where.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.files.long_arrays import Growing, release
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.alike import append_list
from handtrack.sequences.readers.json_file import alike, is_lines
from handtrack.sequences.readers.number_text import Forms, NotAlikeError
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.readers.record_places import Places
from handtrack.sequences.readers.table_cells import read_cells
from handtrack.sequences.titles import is_frame_number

LARGE = 64 * budget.MB
"""Smaller files are read at once."""
_BLOCK = 8 * budget.MB
_FIRST = 2 * budget.MB
_NEXT = re.compile(rb'\s*(,\s*\{\s*"[^"\\]*")')
_MARK = b"\xef\xbb\xbf"
_WIDE = 60
"""A line of so many cells is a frame."""


class DiffersError(Exception):
    """A block is not as those before."""


def read_long_text(path: Path, read: Callable[[bytes, Path], list[Raw]]) -> list[Raw] | None:
    """The sequences of a large text file.

    Args:
        path: the file.
        read: reads a whole file's bytes.

    Returns:
        None where it must be read as a whole.

    Raises:
        InputError: it is larger than is allowed.
    """
    budget.check(path.stat().st_size, path)
    with budget.opened(path) as file:
        piece = file.read(_BLOCK)
        first = piece[: piece.rfind(b"\n") + 1]
        file.seek(0)
        begin = piece.removeprefix(_MARK).lstrip()[:1]
        try:
            if begin in (b"{", b"["):
                if first and is_lines(first):
                    return _of_json(file, path)
                return _of_list(file, path) if begin == b"[" else None
            return _of_table(file, first, path, read) if first else None
        except (InputError, NotAlikeError, DiffersError):
            return None


def _lines_of(file: IO[bytes]) -> Iterator[bytes]:
    """Blocks of whole lines."""
    rest = b""
    while piece := file.read(_BLOCK):
        end = piece.rfind(b"\n") + 1
        if end:
            yield rest + piece[:end]
            rest = piece[end:]
        else:
            rest += piece
        release()
    if rest:
        yield rest


def _of_json(file: IO[bytes], path: Path) -> list[Raw] | None:
    forms, numbers = Forms(), Growing((), np.int64)
    line = 0
    for block in _lines_of(file):
        there = block.split(b"\n")
        full = [i for i, text in enumerate(there) if text.strip()]
        numbers.append(np.array(full, np.int64) + (line + 1))
        text = b",".join(there[i].removeprefix(_MARK) for i in full)
        if not append_list(forms, b"[" + text + b"]") or len(forms) != len(numbers):
            return None
        line += len(there) - 1
    return alike(forms, Places("line", numbers.whole().tolist()), path)


def _of_list(file: IO[bytes], path: Path) -> list[Raw] | None:
    """The hands of one list of objects; None of any other document."""
    forms, mark = Forms(), b""
    rest = file.read(_BLOCK).removeprefix(_MARK).lstrip()[1:]
    while True:
        mark = mark or _between_objects(rest)
        at = rest.rfind(mark) if mark else -1
        # cut where no object ends it is no list, and neither is what follows
        if at < 0 or not append_list(forms, b"".join((b"[", rest[:at], b"]"))):
            return None
        rest = rest[at + 1 :]
        piece = file.read(_BLOCK)
        if not piece:
            break
        rest += piece
    if not append_list(forms, b"[" + rest):
        return None
    return alike(forms, Places("frame", range(len(forms))), path, {})


def _between_objects(text: bytes) -> bytes:
    """What stands between the first two objects of a list, with the second one's first name;
    nothing where they are no objects, or longer than a block."""
    some = text[:_FIRST].lstrip()
    try:
        _, end = json.JSONDecoder().raw_decode(some.decode("ascii", "replace"))
    except (ValueError, RecursionError):
        return b""
    found = _NEXT.match(some, end)
    return found[1] if found else b""


def _of_table(
    file: IO[bytes], first: bytes, path: Path, read: Callable[[bytes, Path], list[Raw]]
) -> list[Raw] | None:
    table = read_cells(first, path)
    if b'"' in first or b"#" in first or not table.lines:
        return None
    header = b"".join(first.splitlines(keepends=True)[: table.places[0] - 1])
    column = None
    if table.width < _WIDE:
        column = next((c for c, t in enumerate(table.titles or ()) if is_frame_number(t)), None)
        if column is None or table.separator is None:
            return None
    kept: list[Whole] = []
    rest, skip = b"", len(header)
    for block in _lines_of(file):
        body, rest = _cut(rest + block[skip:], column, (table.separator or " ").encode())
        skip = 0
        if not body:
            continue
        if b'"' in body:
            raise DiffersError
        join(kept, read(header + body, path))
    if rest:
        join(kept, read(header + rest, path))
    return [hand.whole() for hand in kept]


def _cut(text: bytes, column: int | None, separator: bytes) -> tuple[bytes, bytes]:
    """Whole frames, and the lines of one that may go on."""
    if column is None:
        return text, b""

    def frame(line: bytes) -> bytes:
        cells = line.split(separator, column + 1)
        return cells[column] if len(cells) > column else b""

    end = len(text)
    last: bytes | None = None
    while end > 0:
        begin = text.rfind(b"\n", 0, end - 1) + 1
        here = frame(text[begin:end])
        if last is not None and here != last:
            return text[:end], text[end:]
        last, end = here, begin
    return b"", text


class Whole:
    """One hand, block by block."""

    def __init__(self, raw: Raw) -> None:
        self.raw = raw
        self.joints = Growing(raw.joints.shape[1:])
        self.sure = None if raw.confidence is None else Growing(raw.confidence.shape[1:])
        self.index = None if raw.frame_index is None else Growing((), np.int64)
        self.last = -1
        self.times: list[Stamps] = []

    def append(self, raw: Raw) -> None:
        """More of it.

        Raises:
            DiffersError: it is not alike.
        """
        same = all(
            getattr(raw, name) == getattr(self.raw, name)
            for name in ("name", "hand", "unit", "order", "fps", "subject", "picture", "by_number")
        )
        same &= (raw.confidence is None, raw.frame_index is None, raw.stamps is None) == (
            self.sure is None,
            self.index is None,
            self.raw.stamps is None,
        )
        odd = raw.pending, raw.mano, raw.truth, raw.time_ns
        if not same or odd != (None,) * 4 or raw.joints.shape[1:] != self.joints.shape:
            raise DiffersError
        self.joints.append(raw.joints)
        if self.sure is not None and raw.confidence is not None:
            self.sure.append(raw.confidence)
        if self.index is not None and raw.frame_index is not None:
            if self.last >= 0 and raw.frame_index[0] != self.last + 1:
                raise DiffersError  # frames between, or a clip that begins again
            self.index.append(raw.frame_index)
            self.last = int(raw.frame_index[-1])
        if raw.stamps is not None:
            values = raw.stamps.values
            known = self.times[0].values if self.times else values
            if getattr(values, "dtype", list) != getattr(known, "dtype", list):
                raise DiffersError
            self.times.append(replace(raw.stamps, places=None))

    def whole(self) -> Raw:
        """All of it."""
        raw = replace(self.raw, joints=self.joints.whole())
        raw.confidence = None if self.sure is None else self.sure.whole()
        raw.frame_index = None if self.index is None else np.array(self.index.whole())
        if self.times:
            parts = [t.values for t in self.times]
            values: Any
            if isinstance(parts[0], np.ndarray):
                values = np.concatenate(parts)
            else:
                values = [v for part in parts for v in part]
            raw.stamps = replace(self.times[0], values=values)
        return raw


def join(kept: list[Whole], raws: list[Raw]) -> None:
    """Add the hands of one more block.

    Raises:
        DiffersError: they are not as those before.
    """
    if not kept:
        kept += map(Whole, raws)
    if len(raws) != len(kept):
        raise DiffersError
    for hand, raw in zip(kept, raws, strict=True):
        hand.append(raw)
