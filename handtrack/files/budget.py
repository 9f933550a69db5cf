"""One budget for every reader: how much of a file is read, and how much it may unpack to.

Sizes are checked where they are declared, before anything is read, and again while reading, as
a file may say what it likes. What unpacks to many times its own size is no recording.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import IO, Protocol

from handtrack.errors import InputError, SettingsError, shown

MB, GB = 10**6, 10**9
JOINTS = 4 * GB
"""Bytes of joint data that are read of one source, unless `limited` says otherwise."""
MODELS = 100 * MB
"""Bytes of a hand model."""
TEXT = 2 * MB
"""Bytes of a text beside the joints: cameras, hand.json, meta.yml."""
_UNPACKED, _RATIO = 128 * MB, 30
"""What any archive may unpack to, and how many times its own size a larger one."""
_PIECE = 1 << 20
_UNITS = {"": 1, "K": 10**3, "M": MB, "G": GB, "T": 10**12}
_SIZE = re.compile(r"(\d{1,15}(?:\.\d{1,9})?)\s*([KMGT]?)I?B?", re.IGNORECASE)

_chosen: ContextVar[int | None] = ContextVar("max_size", default=None)


class Stream(Protocol):
    """What can be read from in pieces."""

    def read(self, size: int = ..., /) -> bytes: ...


def parse_size(value: str | int) -> int:
    """Bytes of a size as people write it: 16GB, 500 MB, 1000000.

    Raises:
        SettingsError: it is none.
    """
    match = _SIZE.fullmatch(str(value).strip()) if not isinstance(value, bool) else None
    size = 0 if match is None else int(float(match[1]) * _UNITS[match[2].upper()])
    if size < 1:
        raise SettingsError(f"max_size is {shown(value)}, expected a size such as 16GB")
    return size


@contextmanager
def limited(max_size: str | int | None) -> Iterator[None]:
    """Within it joint data of that size are read, packed or not; None: what is usual.

    Raises:
        SettingsError: it is no size.
    """
    token = _chosen.set(None if max_size is None else parse_size(max_size))
    try:
        yield
    finally:
        _chosen.reset(token)


def allowed(packed: int | None = None) -> int:
    """Bytes of joint data that may be read: of a file, or out of `packed` bytes of one."""
    chosen = _chosen.get()
    if chosen is not None:
        return chosen
    return JOINTS if packed is None else min(JOINTS, max(_UNPACKED, _RATIO * packed))


def check(size: int, path: str | Path, packed: int | None = None, what: str = "") -> None:
    """Refuse joint data of a declared size, before it is read.

    Args:
        size: bytes.
        path: the file.
        packed: the bytes that they are unpacked from.
        what: what in the file declares that size; the file itself where empty.

    Raises:
        InputError: it is too large; the message names the option.
    """
    if size > allowed(packed):
        has = "unpacks to" if packed is not None else "has"
        raise InputError(
            f"{what + ' ' if what else ''}{has} {_written(size)}, more than the"
            f" {_written(allowed(packed))} that are read: --max-size raises it",
            path,
        )


def unpacked(stream: Stream, path: str | Path, packed: int, what: str = "") -> bytes:
    """All that a decompressor gives.

    Args:
        stream: it.
        path: the file.
        packed: the bytes that it unpacks.
        what: what in the file it is.

    Raises:
        InputError: more than the budget; whatever the stream raises.
    """
    found = bytearray()
    while piece := stream.read(_PIECE):
        found += piece
        check(len(found), path, packed, what)
    return bytes(found)


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """A file to read, which must be one.

    Raises:
        InputError: it is not there, cannot be read, or is a pipe or a device.
    """
    try:
        with open(path, "rb", opener=_not_waiting) as file:
            check_kind(os.fstat(file.fileno()).st_mode, path)
            yield file
    except FileNotFoundError as error:
        raise InputError("no such file", path) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path) from error


def read(path: Path, limit: int | None = None) -> bytes:
    """The bytes of a file, which must be one.

    Args:
        path: it.
        limit: bytes that are read at most, `allowed()` by default.

    Raises:
        InputError: as `opened`, or it is too large.
    """
    with opened(path) as file:
        return rest(file, path, limit=limit)


def rest(file: IO[bytes], path: Path, head: bytes = b"", limit: int | None = None) -> bytes:
    """The bytes of an open file.

    Args:
        file: it.
        path: its name.
        head: what was read of it already.
        limit: as in `read`.

    Raises:
        InputError: it is too large.
    """
    most = allowed() if limit is None else limit
    cure = ": --max-size raises it" if limit is None else ""
    size = os.fstat(file.fileno()).st_size
    if head and size > _PIECE and file.seekable():
        file.seek(-len(head), os.SEEK_CUR)  # joined to the rest it would hold the whole twice
        head = b""
    data = head
    if size <= most:
        wanted = max(size - len(head), 0) + 1  # one more than there is: then its end is seen
        piece = file.read(wanted)
        data += piece
        while len(piece) >= wanted and len(data) <= most:  # a pipe, or it grows
            wanted = _PIECE
            piece = file.read(wanted)
            data += piece
        size = len(data)
    if size > most:
        raise InputError(f"has {_written(size)}, more than the {_written(most)} read{cure}", path)
    return data


def check_kind(mode: int, path: Path) -> None:
    """Refuse what is no file but a folder, a pipe or a device.

    What a shell hands over (`/dev/fd/63`, `/dev/stdin`) is a pipe that ends, and is read.

    Raises:
        InputError: it is one.
    """
    if stat.S_ISREG(mode) or (stat.S_ISFIFO(mode) and path.parts[:2] in _HANDED_OVER):
        return
    kinds = {
        "a folder": stat.S_ISDIR(mode),
        "a named pipe": stat.S_ISFIFO(mode),
        "a socket": stat.S_ISSOCK(mode),
    }
    kind = next((name for name, it_is in kinds.items() if it_is), "a device")
    raise InputError(f"is {kind}, expected a file", path)


_HANDED_OVER = (("/", "dev"), ("/", "proc"))


def _not_waiting(name: str, flags: int) -> int:
    """Opening a named pipe waits for somebody who writes to it, unless told not to."""
    descriptor = os.open(name, flags | getattr(os, "O_NONBLOCK", 0))
    if hasattr(os, "set_blocking"):
        os.set_blocking(descriptor, True)
    return descriptor


def _written(size: int) -> str:
    for unit, name in ((GB, "GB"), (MB, "MB"), (1000, "kB")):
        if size >= unit:
            return f"{size / unit:.3g} {name}"
    return f"{size} bytes"
