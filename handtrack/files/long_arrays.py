"""Arrays that grow by their rows: in memory while they are short, in a file when they are long.

A long clip has gigabytes of what is computed of it, of which little is looked at at a time. What
exceeds `MOST` bytes goes to a file without a name, which is gone with the array; the whole is a
map of that file, an ordinary array whose pages the system reads when they are touched. `blocks`
gives the pages back that the loop's body has touched, so that a loop over a long array holds no
more than a block of it.
"""

from __future__ import annotations

import math
import mmap
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BufferedRandom
from pathlib import Path
from typing import IO, Any
from weakref import WeakSet

import numpy as np
from numpy.typing import DTypeLike, NDArray

from handtrack.errors import HandtrackError


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder of this machine that is gone when the block ends."""
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder:
        yield Path(folder)


MOST = 16 * 10**6
"""Bytes of an array that stay in memory; a quarter of it of single numbers, of which a clip has
dozens of arrays."""
ROWS = 4096
"""Frames looked at at a time."""
PICKED = 64
"""Rows far from one another that are looked at at a time: the system reads much around each."""
_NEAR = 4
"""Of so many rows one is picked, where they are near each other."""
_mapped: WeakSet[mmap.mmap] = WeakSet()


def folder() -> str:
    """Where long arrays are: TMPDIR, else /var/tmp, which unlike /tmp is seldom in memory."""
    if "TMPDIR" not in os.environ and os.access("/var/tmp", os.W_OK | os.X_OK):
        return "/var/tmp"
    return tempfile.gettempdir()


def blocks(n: int, rows: int = ROWS) -> Iterator[slice]:
    """0..n in steps; after each the pages of long arrays that it has touched are given back."""
    for start in range(0, n, rows):
        yield slice(start, min(start + rows, n))
        release()


def release() -> None:
    """Give back the memory of all pages of long arrays; they are read again when touched."""
    if hasattr(mmap, "MADV_DONTNEED"):
        for pages in list(_mapped):
            pages.madvise(mmap.MADV_DONTNEED)


def mapped(file: IO[bytes], shape: tuple[int, ...], dtype: DTypeLike, at: int = 0) -> NDArray[Any]:
    """The array (C order) at a place of a file, to be read only."""
    dtype = np.dtype(dtype)
    count = math.prod(shape)
    pages = mmap.mmap(file.fileno(), at + count * dtype.itemsize, access=mmap.ACCESS_READ)
    _mapped.add(pages)
    return np.frombuffer(pages, dtype, count, at).reshape(shape)


class Growing:
    """Rows of one shape and type, one block after another.

    Args:
        shape: of one row.
        dtype: plain numbers.
    """

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> None:
        self.shape, self.dtype = shape, np.dtype(dtype)
        self._parts: list[NDArray[Any]] = []
        self._size = 0
        self._share = 1 if shape else 4
        self._row_bytes = math.prod(shape) * self.dtype.itemsize
        self._file: BufferedRandom | None = None
        self._n = 0

    def __len__(self) -> int:
        return self._n

    def append(self, rows: NDArray[Any]) -> None:
        """More rows (n, *shape); they are kept as they are, not copied, while there are few.

        Raises:
            HandtrackError: there is no room for them.
        """
        rows = np.ascontiguousarray(rows, self.dtype)
        self._n += len(rows)
        self._size += rows.nbytes
        if self._file is None:
            self._parts.append(rows)
            if self._size * self._share <= MOST:
                return
            parts, self._parts = self._parts, []
        else:
            parts = [rows]
        for part in parts:
            for some in blocks(len(part)):
                self._write(part[some])

    def _write(self, rows: NDArray[Any]) -> None:
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=folder())  # noqa: SIM115
            self._file.seek(0, os.SEEK_END)
            self._file.write(_bytes_of(rows))
        except OSError as error:
            reason = error.strerror or error
            raise HandtrackError(
                f"{Path(folder())}: no room for what a long clip needs ({self._size / 1e6:.0f} MB"
                f" of one array): {reason}; TMPDIR names another folder"
            ) from error

    def read(self, part: slice) -> NDArray[Any]:
        """Some rows that follow one another, as a copy."""
        start, stop, _ = part.indices(self._n)
        if self._file is None:
            return np.array(self._in_memory[start:stop])
        out = np.empty((stop - start, *self.shape), self.dtype)
        self._file.seek(start * self._row_bytes)
        self._file.readinto(_bytes_of(out))
        return out

    @property
    def _in_memory(self) -> NDArray[Any]:
        if len(self._parts) != 1:
            self._parts = [np.concatenate([*self._parts, np.empty((0, *self.shape), self.dtype)])]
        return self._parts[0]

    def whole(self) -> NDArray[Any]:
        """All rows so far."""
        if self._file is None:
            return self._in_memory
        self._file.flush()
        return mapped(self._file, (self._n, *self.shape), self.dtype)


def _bytes_of(rows: NDArray[Any]) -> memoryview:
    return rows.reshape(-1).view(np.uint8).data


def rows_of(array: NDArray[Any], places: NDArray[np.int64]) -> NDArray[Any]:
    """Copies of some rows, by their places in order, with few pages of a long array held at a
    time."""
    if array.nbytes <= MOST:
        return array[places]
    near = len(places) > 0 and places[-1] - places[0] < _NEAR * len(places)
    out = np.empty((len(places), *array.shape[1:]), array.dtype)
    for part in blocks(len(places), ROWS if near else PICKED):
        out[part] = array[places[part]]
    return out


def evenly(rows: NDArray[Any], most: int) -> NDArray[Any]:
    """At most so many of them, evenly spread from the first to the last; all where these are no
    more."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).astype(np.int64)]


class GrowingTexts:
    """Short texts, one after another, many of them the same."""

    def __init__(self) -> None:
        self._known: dict[str, int] = {}
        self._table: list[str] = []
        self._numbers = Growing((), np.int32)

    def append(self, texts: list[str]) -> None:
        """More of them."""
        for text in texts:
            if text not in self._known:
                self._known[text] = len(self._table)
                self._table.append(text)
        numbers = [self._known[text] for text in texts]
        self._numbers.append(np.array(numbers, np.int32))

    def read(self, part: slice) -> list[str]:
        """Some that follow one another."""
        return [self._table[number] for number in self._numbers.read(part).tolist()]

    def whole(self) -> NDArray[np.str_]:
        """All of them."""
        table = np.array([*self._table, ""])
        return by_blocks(lambda numbers: table[numbers], self._numbers.whole())


def by_blocks(
    function: Callable[..., NDArray[Any]], *arrays: NDArray[Any], rows: int = ROWS
) -> NDArray[Any]:
    """function(*arrays), whose rows depend on the same rows of the arrays alone, (n, ...)."""
    if len(arrays[0]) <= rows:
        return function(*arrays)
    out: Growing | None = None
    for part in blocks(len(arrays[0]), rows):
        found = function(*(array[part] for array in arrays))
        if out is None:
            out = Growing(found.shape[1:], found.dtype)
        out.append(found)
    return np.empty(0) if out is None else out.whole()
