"""Reader of archives of CMU Panoptic hands and of HOT3D-Clips: .tar, .tar.gz, .tar.bz2, .tar.xz.

Nothing is unpacked to disk, and of an archive no more than the budget: what it would unpack to,
its sparse members and its headers may be many times larger than it is.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import tarfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, cast

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.sequences.readers import hot3d
from handtrack.sequences.readers.panoptic import (
    FILE_NAME,
    FRAME,
    Frames,
    collect,
    in_range,
    recording_name,
)
from handtrack.sequences.readers.raw import NotJointsError, Raw, stem

_DAMAGED = (
    tarfile.TarError,
    EOFError,
    OSError,
    ValueError,
    MemoryError,
    OverflowError,
    RecursionError,
    zlib.error,
    lzma.LZMAError,
)
_PIECE = 1 << 20
# names alone pack so well that their number says nothing; what has content takes some bytes
_MEMBERS, _PACKED_MEMBER = 20_000, 100


class _Unpacking(io.RawIOBase):
    """A stream that a tar is read from, as far as the budget goes."""

    def __init__(self, stream: IO[bytes], path: Path, packed: int | None):
        self._stream, self._path, self._packed = stream, path, packed

    def read(self, size: int = -1) -> bytes:
        """Its next bytes."""
        if self._packed is not None and size < 0:
            raise tarfile.ReadError("a read without an end")
        self._check(self._stream.tell() + max(size, 0))
        return self._stream.read(size)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place."""
        if whence == io.SEEK_SET:
            self._check(offset)
        return self._stream.seek(offset, whence)

    def tell(self) -> int:
        """Where it is."""
        return self._stream.tell()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
        super().close()

    def _check(self, end: int) -> None:
        if self._packed is not None:
            budget.check(end, self._path, self._packed)


def read_tar(path: Path, frames: Frames = None) -> list[Raw]:
    """The sequences of a .tar, .tar.gz (.bz2, .xz).

    Raises:
        NotJointsError: no Panoptic hand file and no clip of HOT3D in it.
        InputError: damaged or cut short, larger than the budget, no file in that range, or as
            `panoptic.read_file`.
    """
    groups: dict[Path, list[tuple[int, Path, bytes]]] = {}
    numbers: list[tuple[int, Path]] = []
    clip: dict[str, bytes] = {}
    try:
        with _stream(path) as stream, tarfile.open(fileobj=stream, mode="r:") as archive:
            for member in _members(archive, path):
                inside = Path(member.name)
                if hot3d.takes(inside.name) and member.isfile():
                    clip[inside.name] = _content(archive, member, path)
                match = FILE_NAME.fullmatch(inside.name)
                if match is None or not member.isfile():
                    continue
                number = int(match[1])
                numbers.append((number, inside))
                if frames is None or frames[0] <= number <= frames[1]:
                    data = _content(archive, member, path)
                    groups.setdefault(inside.parent, []).append((number, path / inside, data))
            _check_end(archive)
    except InputError:
        raise
    except _DAMAGED as error:
        detail = shown(" ".join(str(error).split()), 120) or type(error).__name__
        raise InputError(f"the archive is damaged or cut short ({detail})", path) from None
    if not numbers and clip:
        return hot3d.read_clip(clip, path, frames)
    if not numbers:
        raise NotJointsError(
            "no handRecon3D_hd*.json in the archive, and no *.hands.json of HOT3D-Clips", path
        )
    in_range(sorted(numbers), frames, path)
    raws: list[Raw] = []
    for inside in sorted(groups):
        name = recording_name(path.parent / stem(path))
        if len(groups) > 1:
            name = f"{name} {recording_name(inside)}"
        raws += collect(sorted(groups[inside]), path, name)
    return raws


def _stream(path: Path) -> _Unpacking:
    packed = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(6)
    if head.startswith(b"\x1f\x8b"):
        return _Unpacking(cast(IO[bytes], gzip.open(path)), path, packed)
    if head.startswith(b"BZh"):
        return _Unpacking(cast(IO[bytes], bz2.open(path)), path, packed)
    if head.startswith(b"\xfd7zXZ"):
        return _Unpacking(cast(IO[bytes], lzma.open(path)), path, packed)
    return _Unpacking(path.open("rb"), path, None)


def _members(archive: tarfile.TarFile, path: Path) -> Iterator[tarfile.TarInfo]:
    most = _MEMBERS + path.stat().st_size // _PACKED_MEMBER
    count = 0
    while (member := archive.next()) is not None:
        # tarfile keeps them all, to find them again by name
        archive.members.clear()  # type: ignore[attr-defined]
        count += 1
        if count > most:
            raise InputError(f"the archive has more than {most:,} members", path)
        yield member


def _content(archive: tarfile.TarFile, member: tarfile.TarInfo, path: Path) -> bytes:
    name = shown(member.name, 80)
    if member.issparse():
        raise InputError(f"{name} is a sparse file, which is not read", path)
    if not 0 <= member.size <= FRAME:
        raise InputError(f"{name} has {member.size} bytes, expected a frame of a hand", path)
    stream = archive.extractfile(member)
    data = b"" if stream is None else stream.read()
    if len(data) != member.size:
        raise tarfile.ReadError(f"{name} ends early")
    return data


def _check_end(archive: tarfile.TarFile) -> None:
    """A tar ends in blocks of zeros; Python's reader takes any end for the end."""
    stream = cast(IO[bytes], archive.fileobj)
    stream.seek(archive.offset)
    if stream.read(tarfile.BLOCKSIZE) != bytes(tarfile.BLOCKSIZE):
        raise tarfile.ReadError("no end of the archive")
    while stream.read(_PIECE):  # the packer's checksum stands behind all of it
        pass
