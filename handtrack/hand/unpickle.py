"""Read pickled arrays without running what the pickle says.

MANO files were pickled by Python 2 and hold objects of libraries that are gone: chumpy (whose
objects compute an array from others) and scipy's sparse matrices under module names of old.
`pickle_codes` and `pickle_machine` read the opcodes, `pickle_names` has our own code for the few
names that may stand there, `stand_ins` keeps what was stored; the arrays are computed
afterwards. A pickle that asks for anything else is refused.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

from handtrack.errors import InputError, shown
from handtrack.hand.pickle_codes import run
from handtrack.hand.pickle_machine import DEPTH, Machine
from handtrack.hand.pickle_names import Array, Named, PickleError, RefusedError, Type
from handtrack.hand.stand_ins import Stored, Unread, plain

__all__ = ["plain", "unpickle"]

# what our own code raises besides when the bytes are not what they should be
_DAMAGED = (PickleError, MemoryError, OverflowError, ValueError, struct.error)
_LARGEST = 10**7
"""Objects, each counted as often as it is found."""


class _Whole(NamedTuple):
    """An object with all in it, how many objects that is, and how many in one another."""

    value: Any
    objects: int
    height: int


def unpickle(data: bytes, path: str | Path) -> Any:
    """The object that a pickle holds, of plain types, arrays and stand-ins (see `plain`).

    Args:
        data: bytes that begin with it.
        path: the file's name, for errors.

    Raises:
        InputError: it asks for a class or function that does not belong in a MANO file, or it
            is no pickle, or damaged, or too deep or too large.
    """
    machine = Machine(data)
    try:
        return _Finished().of(run(machine), 0).value
    except RefusedError as error:
        raise InputError(
            f"asks for {error}, which has no place among arrays: not read any further; save"
            " the numbers instead (np.savez, json.dump, DataFrame.to_csv)",
            path,
        ) from None
    except _DAMAGED as error:
        reason = shown(str(error)) or "it ends early"
        raise InputError(f"is no pickle, or a damaged one: {reason}", path) from None
    finally:
        _cleared(machine)


def _cleared(machine: Machine) -> None:
    """Take apart what is held in one another, of which `_Finished` has made its own."""
    for container in machine.made:
        if isinstance(container, list | dict):
            container.clear()


class _Finished:
    """Objects of the machine with their arrays in place; each is made once.

    What is held by itself, deep, or doubled over and over is refused: whoever goes through it
    afterwards would not come to an end.
    """

    def __init__(self) -> None:
        self._done: dict[int, _Whole] = {}
        self._open: set[int] = set()

    def of(self, value: Any, depth: int) -> _Whole:
        """The object."""
        if isinstance(value, Array):
            value = Unread() if value.value is None else value.value
        if isinstance(value, Type | Named):
            value = Unread()
        if not isinstance(value, list | tuple | dict | Stored):
            return _Whole(value, 1, 0)
        key = id(value)
        if key in self._done:
            return self._done[key]
        if key in self._open:
            raise PickleError(f"a {type(value).__name__} that holds itself")
        self._open.add(key)
        # every object stays, so that no other gets its id
        made = self._done[key] = self._made(value, depth)
        self._open.discard(key)
        if made.height > DEPTH:
            raise PickleError(f"more than {DEPTH} objects in one another")
        if made.objects > _LARGEST:
            raise PickleError(f"the same objects over and over, more than {_LARGEST:,}")
        return made

    def _made(self, value: Any, depth: int) -> _Whole:
        if depth > DEPTH:
            raise PickleError(f"more than {DEPTH} objects in one another")
        stored = value.stored if isinstance(value, Stored) else value
        items = list(stored.values()) if isinstance(stored, dict) else stored
        found = [self.of(item, depth + 1) for item in items]
        whole: Any = [item.value for item in found]
        if isinstance(stored, dict):
            whole = dict(zip(stored, whole, strict=True))
        elif isinstance(stored, tuple):
            whole = tuple(whole)
        if isinstance(value, Stored):
            value.stored, whole = whole, value
        count = 1 + sum(item.objects for item in found)
        return _Whole(whole, count, 1 + max((item.height for item in found), default=0))
