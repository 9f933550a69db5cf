"""Files that are packed: .gz, .bz2 and .xz of one file, and .zip of one file or of a folder.

Texts are unpacked in memory; what is read from a file (MCAP, HDF5, Parquet, bags) is unpacked to
a folder that is gone afterwards. The budget bounds both.
"""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import IO, Any

from handtrack.errors import InputError, shown
from handtrack.files import budget, npz
from handtrack.files.long_arrays import scratch
from handtrack.sequences.readers.catalogue import Way, ways
from handtrack.sequences.readers.raw import NotJointsError, Raw

HEAD = 512
_PIECE = 1 << 20
_BY_MAGIC: dict[bytes, tuple[str, Callable[[Path], Any]]] = {
    b"\x1f\x8b": ("gzip", gzip.open),
    b"BZh": ("bzip2", bz2.open),
    b"\xfd7zXZ": ("xz", lzma.open),
}
_ZSTD = b"\x28\xb5\x2f\xfd"
_SUFFIXES = (".gz", ".bz2", ".xz", ".zip")
_DAMAGED = (OSError, EOFError, zlib.error, lzma.LZMAError, ValueError)
Read = Callable[[Path], list[Raw]]


def is_packed(head: bytes, path: Path) -> bool:
    """Whether a file that begins so is one packed file.

    Raises:
        InputError: it is packed by zstd, whose library does not say where a file is cut short.
    """
    if head.startswith(_ZSTD):
        raise InputError("is packed by zstd, which is not read: unpack it ('zstd -d')", path)
    return any(head.startswith(magic) for magic in _BY_MAGIC)


@contextmanager
def unpacking(path: Path) -> Iterator[tuple[bytes, IO[bytes]]]:
    """The first bytes of a packed file's content, and what gives the others.

    Raises:
        InputError: damaged or cut short, also where the block reads on.
    """
    with budget.opened(path) as file:
        start = file.read(8)
    name, opened = next(way for magic, way in _BY_MAGIC.items() if start.startswith(magic))
    try:
        with opened(path) as stream:
            yield stream.read(HEAD), stream
    except InputError:
        raise
    except _DAMAGED as error:
        reason = shown(str(error), 120)
        raise InputError(f"the {name} file is damaged or cut short ({reason})", path) from None


def only_member(path: Path) -> str | None:
    """The file that alone is in a .zip; None of a .npz and of what has several.

    Raises:
        InputError: encrypted, or with more members than any .npz.
    """
    infos = _members(path)
    if len(infos) != 1:
        return None
    name = infos[0].filename
    if infos[0].flag_bits & 1:
        raise InputError(f"{shown(name, 60)} is encrypted, which is not read: unpack it", path)
    return name


def holds_files(path: Path) -> bool:
    """Whether it is a .zip of several files, other than an .npz."""
    return len(_members(path)) > 1


def _members(path: Path) -> list[zipfile.ZipInfo]:
    """The files in a .zip; none of an .npz, which its name tells from a folder of .npy, of what is
    damaged and of any other file."""
    if not path.is_file():
        return []  # a pipe would wait for its writer
    try:
        with path.open("rb") as file:
            if file.read(len(npz.ZIP)) != npz.ZIP:
                return []
            npz.check_directory(file, path)
            with zipfile.ZipFile(file) as archive:
                infos = [i for i in archive.infolist() if _is_content(i)]
    except (*npz.DAMAGED, OSError):
        return []  # said where its arrays are looked for
    arrays = any(i.filename.endswith(".npy") for i in infos)
    return [] if arrays and path.suffix.lower() != ".zip" else infos


@contextmanager
def as_folder(path: Path, wanted: Callable[[str], bool]) -> Iterator[Path]:
    """A .zip's files in a folder that is gone afterwards.

    Args:
        path: the archive.
        wanted: whether a file of that name is looked at.

    Raises:
        InputError: damaged, encrypted, or larger than the budget; errors from within the block
            name the archive instead of the folder.
    """
    packed, size = path.stat().st_size, 0
    with scratch() as folder:
        try:
            with zipfile.ZipFile(path) as archive:
                for info in filter(_is_content, archive.infolist()):
                    steps = PurePosixPath(info.filename.replace("\\", "/")).parts
                    if ".." in steps or info.filename.startswith("/") or not wanted(steps[-1]):
                        continue
                    if info.flag_bits & 1:
                        name = shown(info.filename, 60)
                        raise InputError(f"{name} is encrypted, which is not read", path)
                    here = folder.joinpath(*steps)
                    here.parent.mkdir(parents=True, exist_ok=True)
                    with archive.open(info) as stream, here.open("wb") as file:
                        while piece := stream.read(_PIECE):
                            size += len(piece)
                            budget.check(size, path, packed)
                            file.write(piece)
        except InputError:
            raise
        except (*npz.DAMAGED, OSError) as error:
            raise InputError(npz.damage("the .zip file", error), path) from None
        yield folder


def _is_content(info: zipfile.ZipInfo) -> bool:
    """Whether it is no folder, and not what macOS adds."""
    hidden = info.filename.startswith("__MACOSX/") or info.filename.endswith(".DS_Store")
    return not (info.is_dir() or hidden)


@contextmanager
def member(path: Path, name: str) -> Iterator[tuple[bytes, IO[bytes]]]:
    """The first bytes of a .zip's member, and what gives the others.

    Raises:
        InputError: damaged or cut short, also where the block reads on.
    """
    try:
        with zipfile.ZipFile(path) as archive, archive.open(name) as stream:
            yield stream.read(HEAD), stream
    except InputError:
        raise
    except npz.DAMAGED as error:
        raise InputError(npz.damage("the .zip file", error), path) from None


def way_of(head: bytes, path: Path) -> Way | None:
    """The reader of content that is read from a file, not as a whole."""
    return next((way for way in ways("file") if way.mine(head, path)), None)


def from_scratch(
    head: bytes, stream: IO[bytes], path: Path, read: Read, inner: str = ""
) -> list[Raw]:
    """The sequences of content that needs a file of its own.

    Args:
        head, stream: of `unpacking` or `member`.
        path: the packed file, which messages and sequences name.
        read: the content's reader.
        inner: the file's name inside; by default the packed one's without its ending.

    Raises:
        InputError: more than the budget; as the reader.
    """
    name = PurePosixPath(inner).name or _without_suffix(path)
    packed = path.stat().st_size
    with scratch() as folder:
        here = folder / name
        size = len(head)
        with here.open("wb") as file:
            file.write(head)
            while piece := stream.read(_PIECE):
                size += len(piece)
                budget.check(size, path, packed)
                file.write(piece)
        try:
            raws = read(here)
        except NotJointsError as error:
            raise NotJointsError(_without(error, here), path) from None
        except InputError as error:
            raise InputError(_without(error, here), path) from None
    return [replace(raw, path=path) for raw in raws]


def _without(error: InputError, here: Path) -> str:
    return str(error).removeprefix(f"{here}: ").replace(f"{here.parent}/", "")


def _without_suffix(path: Path) -> str:
    return path.stem if path.suffix.lower() in _SUFFIXES else path.name
