"""Read pickled arrays without running what the pickle says.

MANO files were pickled by Python 2 and hold objects of libraries that are gone: chumpy (whose
objects compute an array from others) and scipy's sparse matrices under module names of old.
Only the few classes below are known here, each as a stand-in that keeps what was stored; the
arrays are computed afterwards. A pickle that asks for anything else is refused.
"""

from __future__ import annotations

import pickle
import struct
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError

# what numpy, pickle and our stand-ins raise when the bytes are not what they should be
_DAMAGED = (
    pickle.UnpicklingError,
    AssertionError,
    AttributeError,
    EOFError,
    ImportError,
    LookupError,
    MemoryError,
    OverflowError,
    RecursionError,
    TypeError,
    ValueError,
    struct.error,
)


class _Stored:
    """An object of another library: what was stored of it, nothing of what it can do."""

    def __init__(self, *arguments: object) -> None:
        self.stored: dict[str, Any] = {}

    def __setstate__(self, state: object) -> None:
        if not isinstance(state, dict):
            raise pickle.UnpicklingError(f"{type(self).__name__} holds a {type(state).__name__}")
        self.stored = state

    def array(self) -> NDArray[Any]:
        """What it stands for."""
        raise NotImplementedError


class _Ch(_Stored):
    """chumpy.ch.Ch: an array."""

    def array(self) -> NDArray[Any]:
        return plain(self.stored["x"])


class _Select(_Stored):
    """chumpy.reordering.Select: entries of another array, flattened, in a shape of their own."""

    def array(self) -> NDArray[Any]:
        picked = plain(self.stored["a"]).ravel()[np.asarray(self.stored["idxs"])]
        shape = self.stored.get("preferred_shape")
        return np.asarray(picked if shape is None else picked.reshape(shape))


class _Reshape(_Stored):
    """chumpy.reordering.Reshape."""

    def array(self) -> NDArray[Any]:
        return plain(self.stored["a"]).reshape(self.stored["newshape"])


class _Transpose(_Stored):
    """chumpy.reordering.transpose."""

    def array(self) -> NDArray[Any]:
        return np.transpose(plain(self.stored["a"]), self.stored.get("axes"))


class _Sparse(_Stored):
    """A scipy.sparse matrix; scipy itself is not asked."""

    def _empty(self) -> NDArray[Any]:
        shape = self.stored.get("_shape", self.stored.get("shape"))
        rows, columns = map(int, cast(Any, shape))
        if not 0 < rows * columns < 10**7:
            raise ValueError(f"a sparse matrix of {rows} x {columns}")
        return np.zeros((rows, columns), np.asarray(self.stored["data"]).dtype)


class _Csc(_Sparse):
    """Compressed by columns."""

    def array(self) -> NDArray[Any]:
        out = self._empty()
        self._fill(out.T)
        return out

    def _fill(self, lines: NDArray[Any]) -> None:
        starts = np.asarray(self.stored["indptr"])
        # before memory is taken for them
        if np.diff(starts).min() < 0 or starts[-1] - starts[0] != np.size(self.stored["indices"]):
            raise ValueError("a sparse matrix whose lines do not hold its entries")
        line = np.repeat(np.arange(len(lines)), np.diff(starts))
        np.add.at(lines, (line, np.asarray(self.stored["indices"])), self.stored["data"])


class _Csr(_Csc):
    """Compressed by rows."""

    def array(self) -> NDArray[Any]:
        out = self._empty()
        self._fill(out)
        return out


class _Coo(_Sparse):
    """Coordinates and values."""

    def array(self) -> NDArray[Any]:
        out = self._empty()
        place = self.stored.get("coords") or (self.stored["row"], self.stored["col"])
        np.add.at(out, tuple(np.asarray(p) for p in place), self.stored["data"])
        return out


def _encode(text: str, encoding: str = "latin1") -> bytes:
    """_codecs.encode, which protocol 2 writes bytes with: for that encoding, and no other."""
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"bytes encoded as {encoding!r}")
    return text.encode("latin1")


def _blank(cls: type, base: type, state: object) -> Any:
    """copy_reg._reconstructor: a new object of a class that we know, nothing else."""
    if not (isinstance(cls, type) and issubclass(cls, _Stored)):
        raise pickle.UnpicklingError(f"a new object of {cls!r}")
    return cls()


def _known() -> dict[tuple[str, str], Any]:
    """Everything that a pickle may ask for, by module and name, old and new."""
    found: dict[tuple[str, str], Any] = {
        ("chumpy.ch", "Ch"): _Ch,
        ("chumpy", "Ch"): _Ch,
        ("chumpy.reordering", "Select"): _Select,
        ("chumpy.reordering", "Reshape"): _Reshape,
        ("chumpy.reordering", "transpose"): _Transpose,
        ("_codecs", "encode"): _encode,
        ("collections", "OrderedDict"): dict,
        ("numpy", "ndarray"): np.ndarray,
        ("numpy", "dtype"): np.dtype,
        # what scipy's todense() makes: an array is as good
        ("numpy.matrixlib.defmatrix", "matrix"): np.ndarray,
        ("numpy", "matrix"): np.ndarray,
    }
    for module in ("__builtin__", "builtins"):
        found |= {(module, "set"): set, (module, "object"): object}
    for module in ("copy_reg", "copyreg"):
        found[module, "_reconstructor"] = _blank
    for kind, stand_in in (("csc", _Csc), ("csr", _Csr), ("coo", _Coo)):
        for module in (f"scipy.sparse.{kind}", f"scipy.sparse._{kind}", "scipy.sparse"):
            found[module, f"{kind}_matrix"] = found[module, f"{kind}_array"] = stand_in
    # numpy's own functions, as its arrays name them today; the module had another name before
    functions = {
        "multiarray._reconstruct": np.zeros(1).__reduce__()[0],
        "multiarray.scalar": np.float64(0).__reduce__()[0],
        "numeric._frombuffer": np.zeros(1).__reduce_ex__(5)[0],
    }
    for core in ("numpy.core", "numpy._core"):
        for place, function in functions.items():
            module, _, name = place.partition(".")
            found[f"{core}.{module}", name] = function
    return found


# the one written in Python: the other takes as much memory as a few wrong bytes ask for
_Unpickler: Any = pickle._Unpickler


class _Reader(_Unpickler):  # type: ignore[misc]
    """Unpickles what `_known` lists."""

    def __init__(self, file: IO[bytes]) -> None:
        super().__init__(file, encoding="latin1")
        self.known = _known()

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in self.known:
            raise _Refused(f"{module}.{name}")
        return self.known[module, name]


class _Refused(pickle.UnpicklingError):
    """The pickle asked for something else."""


def unpickle(file: IO[bytes], path: str | Path) -> Any:
    """The object that a file holds, of plain types, arrays and stand-ins (see `plain`).

    Args:
        file: where the pickle begins.
        path: the file's name, for errors.

    Raises:
        InputError: it asks for a class or function that does not belong in a MANO file, or it
            is no pickle, or damaged.
    """
    try:
        return _Reader(file).load()
    except _Refused as error:
        raise InputError(
            f"asks for {error}, which has no place among arrays: not read any further", path
        ) from error
    except _DAMAGED as error:
        raise InputError(f"is no pickle, or a damaged one: {error or 'it ends early'}", path) from (
            error
        )


def plain(value: object) -> NDArray[Any]:
    """The array that a value is, or that a stand-in stands for.

    Raises:
        AttributeError, IndexError, KeyError, OverflowError, RecursionError, TypeError,
        ValueError: what was stored does not make an array.
    """
    return value.array() if isinstance(value, _Stored) else np.asarray(value)
