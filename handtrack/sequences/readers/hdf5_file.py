"""Opening HDF5 files: what is in them is read where it is needed, and nothing outside of them."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.files.long_arrays import MOST, Growing, blocks
from handtrack.sequences.readers.catalogue import formats
from handtrack.sequences.readers.raw import NotJointsError, Raw

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_MOST_NAMES = 5000
_HEAP = re.compile(rb"GCOL\x01\0\0\0(.{8})", re.DOTALL)
_BLOCK = 8 * budget.MB
_SEARCHED = 256 * budget.MB


_MATLAB, _MATLABS_HDF5 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"


def is_hdf5(head: bytes, path: Path) -> bool:
    """Whether a file that begins so is HDF5, as MATLAB's newer .mat is.

    Raises:
        InputError: it is MATLAB's older .mat, which is not read.
    """
    if head.startswith(_MATLAB):
        raise InputError(
            "MATLAB's .mat of before 7.3 is not read: save it anew with save(..., '-v7.3')", path
        )
    return head.startswith((HDF5_MAGIC, _MATLABS_HDF5))


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """An HDF5 file as h5py gives it.

    Raises:
        InputError: h5py is not installed, or the file is damaged or cut short.
    """
    try:
        import h5py
    except ImportError:
        raise InputError(
            'HDF5 needs the package h5py: pip install "handtrack[formats]"', path
        ) from None
    _check_heaps(path)
    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except InputError:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, zlib.error) as error:
        raise InputError(
            f"the HDF5 file is damaged or cut short ({shown(str(error), 120)})", path
        ) from None


def _check_heaps(path: Path) -> None:
    """Refuse a heap of texts that is said to be larger than the file: the library would make
    room for it before it looks.

    Raises:
        InputError: there is one.
    """
    size = path.stat().st_size
    if size > _SEARCHED:
        return
    for found in _HEAP.finditer(budget.read(path)):
        told = int.from_bytes(found[1], "little")
        if told > size:
            raise InputError(
                f"the HDF5 file is damaged: it tells of {told} bytes of text, and has {size}", path
            )


def names_in(group: Any, path: Path) -> list[str]:
    """The names in a group.

    Raises:
        InputError: there are more than any hand has.
    """
    if len(group) > _MOST_NAMES:
        raise InputError(f"holds {len(group)} names in one group", path)
    return [str(name) for name in group]


def member(group: Any, name: str, path: Path) -> Any:
    """What stands under a name of a group; None where nothing does.

    Raises:
        InputError: it is a link to another file.
    """
    import h5py

    link = group.get(name, getlink=True) if name in group else None
    if link is None:
        return None
    if isinstance(link, h5py.ExternalLink):
        raise InputError(f"{shown(name, 60)} leads to another file, which is not read", path)
    return group[name]


def dataset(group: Any, name: str, path: Path) -> Any:
    """A data set, not yet read; None where there is none of that name.

    Raises:
        InputError: it is stored in other files, or larger than is read.
    """
    import h5py

    found = member(group, name, path)
    if not isinstance(found, h5py.Dataset):
        return None
    if found.is_virtual or found.external:
        raise InputError(f"{shown(name, 60)} is stored in other files, which are not read", path)
    if found.shape is None:
        return None
    packed = path.stat().st_size
    # a chunk is unpacked as a whole, however little is asked for
    for shape in (found.shape, found.chunks or ()):
        size = int(np.prod(shape, dtype=object)) * found.dtype.itemsize
        budget.check(size, path, packed, shown(name, 60))
    stored: list[int] = []
    if found.chunks:
        found.id.chunk_iter(lambda info: stored.append(info.size))
    if max(stored, default=0) > packed:
        raise InputError(
            f"{shown(name, 60)} tells of {max(stored)} bytes in one piece, the file has {packed}",
            path,
        )
    return found


def numbers(data: Any, name: str, path: Path) -> NDArray[np.float64]:
    """All of a data set of numbers.

    Raises:
        InputError: it holds something else.
    """
    if data.dtype.kind not in "fiu":
        raise InputError(f"{shown(name, 60)} holds {data.dtype}, expected numbers", path)
    if data.ndim < 2 or data.size * 8 <= MOST:
        return np.asarray(data[()], dtype=np.float64)
    made = Growing(data.shape[1:])
    # whole chunks: each is unpacked for whatever is asked of it
    step = max(1, _BLOCK * len(data) // (8 * data.size))
    step = -(-step // data.chunks[0]) * data.chunks[0] if data.chunks else step
    for part in blocks(len(data), step):
        made.append(data[part])
    return made.whole()


def read_hdf5(path: Path) -> list[Raw]:
    """The sequences of an HDF5 file: of a format that has readers of them, or named arrays.

    Raises:
        NotJointsError: nothing of a hand in it.
        InputError: damaged, or not as its format says.
    """
    from handtrack.sequences.readers import hdf5_arrays

    with opened(path) as file:
        known = [of.hdf5 for of in formats() if of.hdf5]
        for read in (*known, hdf5_arrays.read):
            found = read(file, path)
            if found is not None:
                return found
        there = ", ".join(names_in(file, path)[:8]) or "nothing"
    raise NotJointsError(
        "no joints in it: expected EgoDex's transforms, emg2pose's timeseries, or a data set"
        f" such as joints_m, found {shown(there)}",
        path,
    )
