"""Arrays of .npy and .npz files: what a header claims is checked before it is believed."""

from __future__ import annotations

import io
import lzma
import struct
import tokenize
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import budget, long_arrays

ZIP = b"PK\x03\x04"
"""What a .zip begins with, and so an .npz."""
DAMAGED = (
    ValueError,
    EOFError,
    OSError,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    MemoryError,
    NotImplementedError,
    RecursionError,
    RuntimeError,
    SyntaxError,
    UnicodeError,
    struct.error,
    tokenize.TokenError,
    lzma.LZMAError,
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
)
"""All that NumPy and zipfile raise for damaged files."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_MEMBERS, _DIRECTORY = 65_535, 16 * budget.MB
_END, _END_SIZE, _COMMENT = b"PK\x05\x06", 22, 65_535
_HEADER = 10_000
_PIECE = 1 << 20
_DIMENSIONS = 32
Unpickle = Callable[[bytes], Any]


def read_npy(data: bytes | NDArray[np.uint8], path: Path, unpickle: Unpickle | None = None) -> Any:
    """The array of a .npy file's bytes, which it holds exactly; it may not be written to.

    Args:
        data: they, as an array where they are many.
        path: named in errors.
        unpickle: for arrays of objects, which are pickles; without it they are refused.

    Raises:
        InputError: damaged, cut short, of objects, or of a type that is no plain one.
    """
    try:
        shape, fortran, dtype, start = _header(io.BytesIO(bytes(data[: 2 * _HEADER])))
    except DAMAGED as error:
        raise InputError(damage("the .npy file", error), path) from None
    if dtype.hasobject:
        if unpickle is None:
            raise InputError(
                "the .npy file holds pickled Python objects, which are not read; save plain"
                " numbers: np.save(path, np.asarray(joints, dtype=float)), NaN where none are",
                path,
            )
        return unpickle(bytes(data[start:]))
    count = 1
    for n in shape:
        count *= n
    if count * dtype.itemsize != len(data) - start:
        cut = count * dtype.itemsize > len(data) - start
        claim = f"its header tells of {shown(str(shape), 60)} {dtype} numbers"
        raise InputError(
            f"the .npy file is damaged{' or cut short' if cut else ''} ({claim}, it holds"
            f" {len(data) - start} bytes)",
            path,
        )
    if count == 0 or dtype.itemsize == 0:
        return np.zeros(shape, dtype)
    array = np.frombuffer(data, dtype, count, start)
    if dtype.kind == "b":  # any byte may stand there
        array = array.view(np.uint8) != 0
    return array.reshape(shape, order="F" if fortran else "C")


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    version = npy.read_magic(file)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"version {version}")
    place = file.tell()
    file.seek(place + (2 if version == (1, 0) else 4))  # its length
    if not file.read(_HEADER).partition(b"\n")[0].isascii():
        raise ValueError("a header that is no plain text")  # Python would import for it
    file.seek(place)
    header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = header(file, max_header_size=_HEADER)
    if len(shape) > _DIMENSIONS or any(n < 0 for n in shape):
        raise ValueError(f"an array of {len(shape)} dimensions")
    return shape, fortran, dtype, file.tell()


def read_npz(
    source: Path | bytes,
    path: Path,
    wanted: Collection[str] | None = None,
    unpickle: Unpickle | None = None,
) -> tuple[dict[str, Any], list[str]]:
    """The arrays of a .npz file by name, and the names of all that are in it.

    Args:
        source: the file, or its bytes.
        path: named in errors.
        wanted: only those are unpacked, of those that are there; None: all.
        unpickle: as in `read_npy`.

    Raises:
        InputError: damaged, encrypted, packed in a way that is not known, a name twice, larger
            than the budget, or as `read_npy`.
    """
    try:
        with io.BytesIO(source) if isinstance(source, bytes) else source.open("rb") as file:
            size = check_directory(file, path)
            with zipfile.ZipFile(file) as archive:
                chosen = _chosen(archive, path, wanted, size)
                found = {}
                for name, info in chosen.items():
                    with archive.open(info) as member:
                        data = _content(member, info.file_size)
                    # else a note, a picture
                    if bytes(data[: len(npy.MAGIC_PREFIX)]) == npy.MAGIC_PREFIX:
                        found[name] = _named(data, path, name, unpickle)
                return found, [i.filename.removesuffix(".npy") for i in archive.infolist()]
    except InputError:
        raise
    except DAMAGED as error:
        raise InputError(damage("the .npz file", error), path) from None


def check_directory(file: IO[bytes], path: Path) -> int:
    """The list of members is read whole: not if it is larger than a .npz has any use for.

    Returns:
        The file's size.
    """
    size = file.seek(0, io.SEEK_END)
    file.seek(max(0, size - _COMMENT - _END_SIZE))
    tail = file.read()
    at = tail.rfind(_END)
    if at < 0 or len(tail) - at < _END_SIZE:
        raise zipfile.BadZipFile("it has no end")
    members, directory = struct.unpack_from("<HI", tail, at + 10)
    if members >= _MEMBERS or directory > _DIRECTORY:
        raise InputError(f"an .npz file of {_MEMBERS} members or more", path)
    file.seek(0)
    return size


def _chosen(
    archive: zipfile.ZipFile, path: Path, wanted: Collection[str] | None, size: int
) -> dict[str, zipfile.ZipInfo]:
    """The members to unpack, none larger than the budget, nor all of them."""
    infos = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    if len(infos) < len(archive.infolist()):
        names = Counter(info.filename.removesuffix(".npy") for info in archive.infolist())
        raise InputError(f"holds {shown(names.most_common(1)[0][0], 60)} twice", path)
    chosen = {k: i for k, i in infos.items() if wanted is None or k in wanted}
    for name, info in chosen.items():
        if info.flag_bits & 1:
            raise InputError(f"{shown(name, 60)} is encrypted, which is not read", path)
        if info.compress_type not in _METHODS:
            raise InputError(
                f"{shown(name, 60)} is packed by method {info.compress_type},"
                " expected np.savez or np.savez_compressed",
                path,
            )
        budget.check(info.file_size, path, size, shown(name, 60))
    budget.check(sum(info.file_size for info in chosen.values()), path, size)
    return chosen


def _content(member: IO[bytes], size: int) -> bytes | NDArray[np.uint8]:
    """All of a member; of a large one a map of a file that it is unpacked to."""
    if size <= long_arrays.MOST:
        return member.read()
    made = long_arrays.Growing((), np.uint8)
    while piece := member.read(_PIECE):
        made.append(np.frombuffer(piece, np.uint8))
    return made.whole()


def _named(
    data: bytes | NDArray[np.uint8], path: Path, name: str, unpickle: Unpickle | None
) -> NDArray[Any] | Any:
    try:
        return read_npy(data, path, unpickle)
    except InputError as error:
        text = str(error).removeprefix(f"{path}: ").removeprefix("the .npy file ")
        raise InputError(f"{shown(name, 60)} {text}", path) from None


def damage(what: str, error: Exception) -> str:
    """What to say of a NumPy file that raised one of `DAMAGED`."""
    detail = " ".join(str(error).split()) or type(error).__name__
    return f"{what} is damaged or cut short ({shown(detail, 120)})"
