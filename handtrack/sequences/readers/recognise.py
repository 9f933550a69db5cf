"""Finding the reader for a file by what is in it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO

import msgspec
import numpy as np

from handtrack.errors import InputError, SettingsError
from handtrack.files import budget, npz
from handtrack.files.collecting import no_collecting
from handtrack.files.long_arrays import MOST, mapped
from handtrack.sequences.readers import (
    freemocap,
    freihand,
    long_text,
    packed,
    panoptic_tar,
    text_table,
)
from handtrack.sequences.readers.catalogue import kinds, ways
from handtrack.sequences.readers.json_file import from_value, is_lines, read_json, read_lines
from handtrack.sequences.readers.jsontext import as_utf8, decode, of_python, one_after_another
from handtrack.sequences.readers.numpy_file import NPY_MAGIC, read_npy, read_npz
from handtrack.sequences.readers.raw import NotJointsError, Raw

_TAR_MAGIC_AT = 257
_BLANK = b"\xef\xbb\xbf \t\r\n"


def read_file(
    path: Path, frames: tuple[int, int] | None = None, kind: str | None = None
) -> list[Raw]:
    """The sequences of one file, whatever it is.

    Args:
        path: an existing file.
        frames: source frame numbers (both included) that will be kept; readers that can skip
            the others do.
        kind: a name of `catalogue.kinds`; None: by what is in the file.

    Raises:
        NotJointsError: a whole file of which nothing is a hand.
        InputError: empty, damaged, cut short, or not as its format says.
    """
    with budget.opened(path) as stream:
        head = stream.read(512)
        if not head:
            raise InputError("the file is empty", path)
        for way in ways("file"):
            if way.mine(head, path):
                return way.read(path)
        if _is_tar(head):
            return panoptic_tar.read_tar(path, frames)
        if packed.is_packed(head, path):
            return _read_packed(path, frames, kind)
        alone = packed.only_member(path)
        if alone is not None:
            with packed.member(path, alone) as (first, content):
                return _unpacked(first, content, path, kind, alone)
        if head.startswith(npz.ZIP) and kind is None and path.is_file():
            # its members are read one by one, not the file as a whole
            budget.check(path.stat().st_size, path)
            return freemocap.with_unit(read_npz(path, path), path)
        found = _read_long(path, head) if kind is None else None
        if found is not None:
            return found
        size = os.fstat(stream.fileno()).st_size
        if head.startswith(NPY_MAGIC) and kind is None and size > MOST:
            budget.check(size, path)
            return freemocap.with_unit(read_npy(mapped(stream, (size,), np.uint8), path), path)
        data = budget.rest(stream, path, head)
    return read_bytes(data, path, kind)


def _read_long(path: Path, head: bytes) -> list[Raw] | None:
    """The sequences of a large table or of large JSON lines; None of anything else."""
    text = head.lstrip(_BLANK)
    if not path.is_file() or path.stat().st_size <= long_text.LARGE or b"\0" in head:
        return None
    if any(way.mine(text, path) for way in (*ways("bytes"), *ways("text"))):
        return None
    return long_text.read_long_text(path, read_bytes)


def read_bytes(data: bytes, path: Path, kind: str | None = None) -> list[Raw]:
    """The sequences of a file's content; `path` names it.

    Raises:
        As `read_file`.
    """
    if kind is not None:
        return kinds()[kind](data, path)
    return freemocap.with_unit(_by_content(data, path), path)


def _by_content(data: bytes, path: Path) -> list[Raw]:
    for way in ways("bytes"):
        if way.mine(data, path):
            return way.read(data, path)
    data = as_utf8(data).lstrip(b"\0")
    if not data or b"\0" in data[:512]:
        raise NotJointsError(
            "not a joint sequence: expected JSON, CSV, .npz, .npy, .mcap or a Panoptic .tar", path
        )
    data = of_python(data)
    text = data.lstrip(_BLANK)
    for way in ways("text"):
        if way.mine(text, path):
            return way.read(data, path)
    start = text[:5]
    if start[:1] in (b"{", b"[") or start.strip() == b"null":
        with no_collecting():
            return _read_json(data, path)
    return text_table.read_table(data, path)


def check_format(kind: str | None) -> None:
    """Refuse a format that has no reader.

    Raises:
        SettingsError: there is no such.
    """
    if kind is not None and kind not in kinds():
        raise SettingsError(f"unknown format {kind!r}, expected one of {', '.join(kinds())}")


def _read_json(data: bytes, path: Path) -> list[Raw]:
    if freihand.FILE_NAME.fullmatch(path.name):
        return freihand.read_freihand(data, path)
    if is_lines(data):
        return read_lines(data, path)
    if data.lstrip(_BLANK)[:1] != b"{":
        return read_json(data, path)
    try:
        fields = decode(data, dict[str, msgspec.Raw], path)
    except InputError:
        several = one_after_another(data)
        if several is None:
            raise
        return from_value(several, path)
    for way in ways("fields"):
        if way.mine(fields, data):
            return way.read(data, path)
    return read_json(data, path)


def _is_tar(head: bytes) -> bool:
    return head[_TAR_MAGIC_AT : _TAR_MAGIC_AT + 5] == b"ustar"


def _read_packed(path: Path, frames: tuple[int, int] | None, kind: str | None) -> list[Raw]:
    with packed.unpacking(path) as (head, stream):
        if not _is_tar(head):
            return _unpacked(head, stream, path, kind)
    return panoptic_tar.read_tar(path, frames)


def _unpacked(
    head: bytes, stream: IO[bytes], path: Path, kind: str | None, inner: str = ""
) -> list[Raw]:
    way = packed.way_of(head, path)
    if way is not None:
        return packed.from_scratch(head, stream, path, way.read, inner)
    data = head + budget.unpacked(stream, path, path.stat().st_size)
    return read_bytes(data, path, kind)
