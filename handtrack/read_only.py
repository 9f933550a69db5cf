"""Arrays, dictionaries and lists that can only be read: nobody changes what others go on with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound=np.generic)


def read_only(array: NDArray[T]) -> NDArray[T]:
    """The array, or a view of it that cannot be written to: who made it may go on with it."""
    if not array.flags.writeable:
        return array
    view = array.view()
    view.flags.writeable = False
    return view


def _refuse(self: object, *_: object, **__: object) -> NoReturn:
    raise TypeError("this can only be read; dataclasses.replace makes an object with other values")


class ReadOnlyDict(dict[str, Any]):
    """A dictionary that can only be read; `{**it}` is one of one's own."""

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyDict, (dict(self),)


class ReadOnlyList(list[Any]):
    """A list that can only be read; `[*it]` is one of one's own."""

    __setitem__ = __delitem__ = __iadd__ = __imul__ = _refuse
    append = clear = extend = insert = pop = remove = reverse = sort = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyList, (list(self),)


def frozen(value: Any) -> Any:
    """A copy of dictionaries, lists and arrays in one another that can only be read."""
    if isinstance(value, (ReadOnlyDict, ReadOnlyList)):
        return value
    if isinstance(value, Mapping):
        return ReadOnlyDict({key: frozen(v) for key, v in value.items()})
    if isinstance(value, list):
        return ReadOnlyList(frozen(v) for v in value)
    return read_only(value) if isinstance(value, np.ndarray) else value


def make_read_only(value: DataclassInstance) -> None:
    """Let the arrays and the dictionaries of a frozen dataclass, and what is in them, only be read.

    Dictionaries become copies.
    """
    for of in fields(value):
        held: Any = getattr(value, of.name)
        if isinstance(held, np.ndarray):
            object.__setattr__(value, of.name, read_only(held))
        elif isinstance(held, Mapping):
            object.__setattr__(value, of.name, frozen(held))
