"""A machine for pickles of arrays that calls nothing but our own code.

Every length is checked against what is left of the file before anything is made of it, so that
memory and work grow with the file and with nothing that stands in it. Its opcodes are in
`pickle_codes`.
"""

from __future__ import annotations

import struct
from typing import Any

from handtrack.errors import shown
from handtrack.hand.pickle_names import Array, Named, PickleError, RefusedError, Type, known
from handtrack.hand.stand_ins import Stored

DEPTH = 100
"""Containers within one another."""
_LINE = 10_000
# greater numbers can be chosen so that they share a place in a dictionary
_KEY = 2**60
_CONTAINERS = ("dict", "OrderedDict", "set", "frozenset", "list", "tuple")
_MODULES = ("__builtin__", "builtins", "collections")


class Machine:
    """Reads one pickle.

    Args:
        data: bytes that begin with it.
    """

    def __init__(self, data: bytes) -> None:
        self.data, self.place = data, 0
        self.stack: list[Any] = []
        self.below: list[list[Any]] = []
        self.memo: dict[int, Any] = {}
        self.depth: dict[int, int] = {}
        self.made: list[Any] = []
        self.left = 4 * len(data) + 10**6
        self.known = known()

    def spend(self, size: int) -> None:
        """Account for bytes that are copied out of the file."""
        self.left -= size
        if self.left < 0:
            raise PickleError("it makes more of its bytes than it has")

    # the file

    def take(self, size: int) -> bytes:
        """The next bytes."""
        end = self.place + size
        if size < 0 or end > len(self.data):
            raise PickleError(f"it ends early: {shown(size)} bytes of which there are fewer")
        found = self.data[self.place : end]
        self.place = end
        return found

    def number(self, form: str) -> int:
        """The next number, as `struct` writes it."""
        return int(struct.unpack(form, self.take(struct.calcsize(form)))[0])

    def line(self, longest: int = _LINE) -> bytes:
        """The next line without its end."""
        end = self.data.find(b"\n", self.place, self.place + longest + 1)
        if end < 0:
            raise PickleError("it ends early, within a line, or the line is too long")
        found = self.data[self.place : end]
        self.place = end + 1
        return found

    # the stack

    def pop(self) -> Any:
        """The topmost object."""
        if not self.stack:
            raise PickleError("it takes more than it has put down")
        return self.stack.pop()

    def top(self) -> Any:
        """The topmost object, which stays."""
        if not self.stack:
            raise PickleError("it takes more than it has put down")
        return self.stack[-1]

    def marked(self) -> list[Any]:
        """All down to the mark, which goes."""
        if not self.below:
            raise PickleError("it asks for a mark that is not there")
        found, self.stack = self.stack, self.below.pop()
        return found

    def push(self, value: Any) -> None:
        """Put an object down."""
        self.stack.append(value)

    def container(self, value: Any, items: list[Any]) -> None:
        """Put a container down; how deep it is is known of those that cannot change."""
        if isinstance(value, tuple):
            depth = 1 + max((self.depth.get(id(item), 0) for item in items), default=0)
            if depth > DEPTH:
                raise PickleError(f"more than {DEPTH} tuples in one another")
            self.depth[id(value)] = depth
        self.made.append(value)
        self.stack.append(value)

    # what is done with objects

    def insert(self, target: Any, items: list[Any]) -> None:
        """Keys and values into a dictionary."""
        if type(target) is not dict or len(items) % 2:
            raise PickleError("keys and values for something that has none")
        for key, value in zip(items[::2], items[1::2], strict=True):
            target[self.hashable(key)] = value

    def hashable(self, value: Any) -> Any:
        """A key, or an item of a set: one of the plain kinds, whose hash takes no time."""
        plain = value is None or type(value) in (str, bytes, bool)
        if not plain and not (type(value) is int and abs(value) < _KEY):
            raise PickleError(f"a {type(value).__name__} for a key")
        return value

    def extend(self, target: Any, items: list[Any]) -> None:
        """Items to the end of a list."""
        if type(target) is not list:
            raise PickleError(f"items for a {type(target).__name__}")
        target.extend(items)

    def named(self, module: str, name: str) -> Named:
        """What a pickle names."""
        if module in _MODULES and name in _CONTAINERS:
            return Named(name, _no_container, True)
        if (module, name) not in self.known:
            raise RefusedError(f"{shown(module, 80)}.{shown(name, 80)}")
        return self.known[module, name]

    def call(self, function: Any, arguments: Any) -> None:
        """Put down what one of our own functions makes."""
        if not isinstance(function, Named) or not isinstance(arguments, tuple):
            raise RefusedError(f"a call of a {type(function).__name__}")
        if function.made is _no_container:
            self._new_container(function.name, arguments)
            return
        try:
            self.push(function.made(self.spend, *arguments))
        except TypeError as error:
            raise PickleError(f"{function.name} with other arguments than its own") from error

    def _new_container(self, name: str, arguments: tuple[Any, ...]) -> None:
        given = arguments[0] if arguments else []
        if len(arguments) > 1 or type(given) not in (list, tuple, dict):
            raise PickleError(f"a {name} of a {type(given).__name__}")
        if name in ("dict", "OrderedDict"):
            made: dict[Any, Any] = {}
            self.spend(16 * len(given))
            pairs = list(given.items()) if type(given) is dict else list(given)
            if not all(type(p) in (list, tuple) and len(p) == 2 for p in pairs):
                raise PickleError(f"a {name} of something else than pairs")
            self.insert(made, [part for pair in pairs for part in pair])
            self.container(made, [])
            return
        self.spend(16 * len(given))
        items = list(given)
        if name in ("set", "frozenset"):
            self.container({self.hashable(item) for item in items}, [])
        else:
            self.container(items if name == "list" else tuple(items), items)

    def build(self, target: Any, state: Any) -> None:
        """Give an object its state."""
        if isinstance(target, Array):
            target.build(state, self.spend)
        elif isinstance(target, Type):
            target.build(state)
        elif isinstance(target, Stored):
            parts = state if isinstance(state, tuple) and len(state) == 2 else (state,)
            for part in parts:
                if part is not None and type(part) is not dict:
                    raise PickleError(f"a state that is a {type(part).__name__}")
                self.spend(16 * len(part or ()))
                target.stored.update(part or {})
        else:
            raise PickleError(f"a state for a {type(target).__name__}")


def _no_container(*_: object) -> None:
    """Stands for Python's own containers, which the machine makes."""
