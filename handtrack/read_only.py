"""Arrays that can only be read, so that nobody changes what others go on with."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

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


def make_read_only(value: DataclassInstance) -> None:
    """Let the arrays of a frozen dataclass, and those in its dictionaries, only be read."""
    for of in fields(value):
        held: Any = getattr(value, of.name)
        if isinstance(held, np.ndarray):
            object.__setattr__(value, of.name, read_only(held))
        elif isinstance(held, dict) and any(isinstance(v, np.ndarray) for v in held.values()):
            kept = {
                key: read_only(v) if isinstance(v, np.ndarray) else v for key, v in held.items()
            }
            object.__setattr__(value, of.name, kept)
