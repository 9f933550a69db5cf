"""What a pickle may name, each with our own code for it: nothing of NumPy's or scipy's is called.

An array is made of its bytes once its state is read, a type of one once it is used; until then
`Array` and `Type` keep what was said.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import shown
from handtrack.hand.stand_ins import Ch, Coo, Csc, Csr, Reshape, Select, Stored, Transpose, Unread

_DIMENSIONS = 32
# letter and bytes, as NumPy writes them
_NUMBERS = {"b1", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8"}
_KINDS_UNREAD = "SUOaM"
# Python 2 on Linux and older NumPys wrote some by their names
_ALIASES = {"?": "b1", "b": "i1", "h": "i2", "i": "i4", "l": "i8", "q": "i8", "B": "u1", "d": "f8"}
_ALIASES |= {"f": "f4", "e": "f2", "bool": "b1", "float64": "f8", "float32": "f4", "int64": "i8"}
_ALIASES |= {"int32": "i4", "uint8": "u1", "uint32": "u4"}


class PickleError(Exception):
    """The pickle is damaged, or too much."""


class RefusedError(PickleError):
    """The pickle asks for what has no place in one of arrays."""


class Type:
    """numpy.dtype of plain numbers; of text and of objects only that it is one."""

    def __init__(self, name: object = None, *_: object) -> None:
        text = name if isinstance(name, str) else ""
        self.order = text[:1] if text[:1] in "<>|=" else "="
        text = text.lstrip("<>|=")
        self.code = _ALIASES.get(text, text)
        if self.code not in _NUMBERS and not self.unread:
            raise RefusedError(f"numpy.dtype({shown(name, 40)!r})")

    @property
    def unread(self) -> bool:
        """Whether it is of text or of objects."""
        return self.code == "O" or (self.code[:1] in _KINDS_UNREAD and self.code[1:].isdigit())

    def build(self, state: object) -> None:
        """As `dtype.__setstate__`: the order of bytes, and no fields."""
        if not (isinstance(state, tuple) and len(state) >= 5):
            raise PickleError("a type of numbers with a state that is none")
        if any(part is not None for part in state[2:5]):
            raise RefusedError("numpy.dtype with fields")
        if state[1] not in ("<", ">", "|", "="):
            raise PickleError("a type of numbers with an unknown order of bytes")
        self.order = str(state[1])

    def dtype(self) -> np.dtype[Any]:
        """It, for NumPy."""
        order = "=" if self.order == "|" else self.order
        return np.dtype(order + self.code)

    def of_bytes(self, data: object, count: int, spend: Callable[[int], None]) -> NDArray[Any]:
        """`count` numbers, which the bytes hold exactly."""
        dtype = self.dtype()
        if isinstance(data, str):  # as Python 2 wrote bytes
            spend(len(data))
            data = latin1(data)
        if not isinstance(data, bytes) or len(data) != count * dtype.itemsize:
            raise PickleError(f"an array of {shown(count)} numbers that are not in it")
        spend(len(data) + 64)
        if self.code == "b1":  # any byte may stand there
            return np.asarray(np.frombuffer(data, np.uint8) != 0)
        return np.frombuffer(data, dtype)


class Array:
    """numpy.ndarray, empty until `build`."""

    def __init__(self, *_: object) -> None:
        self.value: NDArray[Any] | Stored | list[Any] | None = None

    def build(self, state: object, spend: Callable[[int], None]) -> None:
        """As `ndarray.__setstate__`: version, shape, type, Fortran order, bytes."""
        if not isinstance(state, tuple) or len(state) not in (4, 5):
            raise PickleError("an array with a state that is none")
        self.fill(state[-4], state[-3], state[-1], "F" if state[-2] else "C", spend)

    def fill(
        self, shape: object, kind: object, data: object, order: str, spend: Callable[[int], None]
    ) -> None:
        """Make the array of its bytes."""
        shape = (shape,) if isinstance(shape, int) else shape
        sizes = list(shape) if isinstance(shape, tuple | list) else [-1]
        if len(sizes) > _DIMENSIONS or not all(type(n) is int and n >= 0 for n in sizes):
            raise PickleError("an array whose shape is none")
        count = 1
        for n in sizes:
            count = min(count * n, 2**62)
        if not isinstance(kind, Type):
            raise PickleError("an array without a type of numbers")
        if kind.unread:
            # np.savez keeps an object as an array of one; a row of them is a list
            row = kind.code[0] == "O" and (count == 1 or len(sizes) == 1)
            whole = row and isinstance(data, list) and len(data) == count
            self.value = data if whole and isinstance(data, list) else Unread()
            return
        numbers = kind.of_bytes(data, count, spend)
        self.value = numbers.reshape(sizes, order="F" if order == "F" else "C")


class Named:
    """A class or function that a pickle may name.

    Attributes:
        name: as the pickle has it.
        made: our own for it.
        is_class: whether objects may be made of it without arguments.
    """

    def __init__(self, name: str, made: Callable[..., Any], is_class: bool = False) -> None:
        self.name, self.made, self.is_class = name, made, is_class


def latin1(text: str) -> bytes:
    """Bytes that stand as text."""
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError:
        raise PickleError("bytes with a letter that is none") from None


def scalar(spend: Callable[[int], None], kind: object, data: object = None) -> Any:
    """numpy.core.multiarray.scalar: a number of its bytes."""
    if not isinstance(kind, Type):
        raise PickleError("a number without a type")
    return Unread() if kind.unread else kind.of_bytes(data, 1, spend)[0]


def from_buffer(
    spend: Callable[[int], None],
    data: object,
    kind: object,
    shape: object,
    order: object = "C",
    axes: object = None,
) -> Any:
    """numpy.core.numeric._frombuffer, of protocol 5."""
    turned = order == "K" and isinstance(axes, tuple)
    array = Array()
    array.fill(shape, kind, data, "F" if order == "F" else "C", spend)
    if turned and isinstance(axes, tuple) and isinstance(array.value, np.ndarray):
        if not all(type(axis) is int for axis in axes):
            raise PickleError("an array whose axes are none")
        array.value = array.value.transpose(axes)
    return array


def encode(spend: Callable[[int], None], text: object = "", encoding: object = "latin1") -> bytes:
    """_codecs.encode, which protocol 2 writes bytes with: for that encoding, and no other."""
    if encoding not in ("latin1", "latin-1") or not isinstance(text, str):
        raise RefusedError(f"bytes encoded as {shown(encoding, 40)!r}")
    spend(len(text))
    return latin1(text)


def blank(spend: Callable[[int], None], cls: object, base: object, state: object = None) -> Any:
    """copy_reg._reconstructor: a new object of a class that we know, nothing else."""
    if not (isinstance(cls, Named) and cls.is_class):
        raise RefusedError("an object of something that is no class")
    return cls.made(spend)


def _array(spend: Callable[[int], None], *_: object) -> Array:
    """numpy.core.multiarray._reconstruct: an array whose state follows."""
    return Array()


def _type(spend: Callable[[int], None], name: object = None, *_: object) -> Type:
    return Type(name)


def _bytes(spend: Callable[[int], None], data: object = b"", encoding: object = "latin-1") -> bytes:
    """bytes and bytearray."""
    if isinstance(data, bytes):
        spend(len(data))
        return data
    return encode(spend, data, encoding)


def _maker(kind: type[Stored]) -> Callable[..., Stored]:
    return lambda spend, *_: kind()


def known() -> dict[tuple[str, str], Named]:
    """Everything that a pickle may ask for, by module and name, old and new; not containers."""
    found: dict[tuple[str, str], Named] = {}

    def add(modules: tuple[str, ...], name: str, made: Callable[..., Any], cls: bool) -> None:
        for module in modules:
            found[module, name] = Named(f"{module}.{name}", made, cls)

    chumpy = {"Select": Select, "Reshape": Reshape, "transpose": Transpose}
    add(("chumpy.ch", "chumpy"), "Ch", _maker(Ch), True)
    for name, kind in chumpy.items():
        add(("chumpy.reordering",), name, _maker(kind), True)
    for short, sparse in (("csc", Csc), ("csr", Csr), ("coo", Coo)):
        modules = (f"scipy.sparse.{short}", f"scipy.sparse._{short}", "scipy.sparse")
        for suffix in ("matrix", "array"):
            add(modules, f"{short}_{suffix}", _maker(sparse), True)
    add(("numpy",), "ndarray", _array, True)
    add(("numpy", "numpy.matrixlib.defmatrix"), "matrix", _array, True)
    add(("numpy",), "dtype", _type, False)
    cores = ("numpy.core", "numpy._core")
    add(tuple(f"{core}.multiarray" for core in cores), "_reconstruct", _array, False)
    add(tuple(f"{core}.multiarray" for core in cores), "scalar", scalar, False)
    add(tuple(f"{core}.numeric" for core in cores), "_frombuffer", from_buffer, False)
    add(("_codecs",), "encode", encode, False)
    add(("copy_reg", "copyreg"), "_reconstructor", blank, False)
    for module in ("__builtin__", "builtins"):
        add((module,), "bytes", _bytes, False)
        add((module,), "bytearray", _bytes, False)
        add((module,), "object", _maker(Unread), False)
    return found
