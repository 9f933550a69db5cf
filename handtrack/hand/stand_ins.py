"""What stands in for the objects of other libraries that a pickle holds.

MANO's files hold chumpy's objects, which compute an array from others, and scipy's sparse
matrices. Each class keeps what was stored of one; the arrays are computed from that.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

_LARGEST = 10**7
"""Numbers of an array that is computed from others."""


class Stored:
    """An object of another library: what was stored of it, nothing of what it can do."""

    def __init__(self) -> None:
        self.stored: dict[str, Any] = {}

    def array(self) -> NDArray[Any]:
        """What it stands for."""
        raise TypeError(f"{type(self).__name__} is no array of numbers")


class Unread(Stored):
    """An array of text or of objects, of which nothing is wanted."""


class Ch(Stored):
    """chumpy.ch.Ch: an array."""

    def array(self) -> NDArray[Any]:
        return plain(self.stored["x"])


class Select(Stored):
    """chumpy.reordering.Select: entries of another array, flattened, in a shape of their own."""

    def array(self) -> NDArray[Any]:
        picked = plain(self.stored["a"]).ravel()[_indices(self.stored["idxs"])]
        shape = self.stored.get("preferred_shape")
        return np.asarray(picked if shape is None else picked.reshape(plain(shape)))


class Reshape(Stored):
    """chumpy.reordering.Reshape."""

    def array(self) -> NDArray[Any]:
        return plain(self.stored["a"]).reshape(plain(self.stored["newshape"]))


class Transpose(Stored):
    """chumpy.reordering.transpose."""

    def array(self) -> NDArray[Any]:
        axes = self.stored.get("axes")
        return np.transpose(plain(self.stored["a"]), None if axes is None else plain(axes))


class _Sparse(Stored):
    """A scipy.sparse matrix; scipy itself is not asked."""

    def _empty(self) -> NDArray[Any]:
        shape = self.stored.get("_shape", self.stored.get("shape"))
        rows, columns = map(int, cast(Any, shape))
        if rows < 0 or columns < 0 or not 0 < rows * columns < _LARGEST:
            raise ValueError(f"a sparse matrix of {rows} x {columns}")
        return np.zeros((rows, columns), plain(self.stored["data"]).dtype)


class Csc(_Sparse):
    """Compressed by columns."""

    def array(self) -> NDArray[Any]:
        out = self._empty()
        self._fill(out.T)
        return out

    def _fill(self, lines: NDArray[Any]) -> None:
        starts, places = _indices(self.stored["indptr"]), _indices(self.stored["indices"])
        # before memory is taken for them
        if len(starts) != len(lines) + 1 or starts[0] != 0 or np.diff(starts).min() < 0:
            raise ValueError("a sparse matrix whose lines do not begin where they should")
        if starts[-1] != len(places):
            raise ValueError("a sparse matrix whose lines do not hold its entries")
        line = np.repeat(np.arange(len(lines)), np.diff(starts))
        np.add.at(lines, (line, places), plain(self.stored["data"]))


class Csr(Csc):
    """Compressed by rows."""

    def array(self) -> NDArray[Any]:
        out = self._empty()
        self._fill(out)
        return out


class Coo(_Sparse):
    """Coordinates and values."""

    def array(self) -> NDArray[Any]:
        out = self._empty()
        rows, columns = self.stored.get("coords") or (self.stored["row"], self.stored["col"])
        place = (_indices(rows), _indices(columns))
        np.add.at(out, place, plain(self.stored["data"]))
        return out


def _indices(value: object) -> NDArray[np.int64]:
    """A list of whole numbers from zero on."""
    array = plain(value)
    if array.dtype.kind not in "iu" or array.ndim != 1 or (array.size and array.min() < 0):
        raise ValueError(f"indices are {array.dtype} of shape {array.shape}")
    return array.astype(np.int64)


def plain(value: object) -> NDArray[Any]:
    """The array of numbers that a value is, or that a stand-in stands for.

    Raises:
        AttributeError, IndexError, KeyError, OverflowError, RecursionError, TypeError,
        ValueError: what was stored does not make an array.
    """
    array = value.array() if isinstance(value, Stored) else np.asarray(value)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"an array of {array.dtype}")
    return array
