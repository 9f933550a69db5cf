"""The opcodes of pickles, protocols 0 to 5, as `pickle_machine` has them done.

What each means stands in Python's `pickletools`.
"""

from __future__ import annotations

import codecs
import re
import struct
from collections.abc import Callable
from typing import Any

from handtrack.errors import shown
from handtrack.hand.pickle_machine import Machine
from handtrack.hand.pickle_names import PickleError, RefusedError

_DIGITS, _LONG, _FLOAT = 40, 16, 400
"""Characters of a whole number, bytes of one, characters of another."""
_NO_ESCAPE = re.compile(rb"\\[^'\"abfnrtvx0-7]")
_REFUSED = {
    b"P": "a persistent object",
    b"Q": "a persistent object",
    b"\x82": "an extension of Python",
    b"\x83": "an extension of Python",
    b"\x84": "an extension of Python",
    b"\x97": "a buffer that is not in it",
    b"\x98": "a buffer that is not in it",
}


def run(machine: Machine) -> Any:
    """The object that a pickle holds, its arrays still `Array`.

    Raises:
        PickleError: damaged, or larger or deeper than a pickle of arrays is.
        RefusedError: it asks for what has no place in one.
    """
    while (code := machine.take(1)) != b".":
        step = _STEPS.get(code)
        if step is None:
            if code in _REFUSED:
                raise RefusedError(_REFUSED[code])
            raise PickleError(f"no opcode {code!r} (byte {machine.place - 1})")
        step(machine)
    return machine.pop()


def _void(_: object) -> None:
    """Let a value go."""


def _text(data: bytes) -> str:
    # surrogates as pickle writes them; both are in Python itself, nothing is imported
    return data.decode("utf-8", "surrogatepass")


def _whole(text: bytes) -> int:
    digits = text.strip().removesuffix(b"L")
    if len(digits) > _DIGITS or not digits.lstrip(b"+-").isdigit():
        raise PickleError(f"no number: {shown(text, 20)}")
    return int(digits)


def _int(m: Machine) -> None:
    line = m.line()
    m.push({b"00": False, b"01": True}[line] if line in (b"00", b"01") else _whole(line))


def _long(size: int, m: Machine) -> None:
    if size > _LONG:
        raise PickleError(f"a number of {shown(size)} bytes")
    m.push(int.from_bytes(m.take(size), "little", signed=True))


def _string(m: Machine) -> None:
    line = m.line(len(m.data)).strip()
    if len(line) < 2 or line[:1] != line[-1:] or line[:1] not in (b"'", b'"'):
        raise PickleError("a string without its quotes")
    if _NO_ESCAPE.search(line.replace(rb"\\", b"")):  # which Python would warn of
        raise PickleError("a string with an escape that is none")
    m.push(codecs.escape_decode(line[1:-1])[0].decode("latin-1"))


def _unicode(m: Machine) -> None:
    m.push(codecs.raw_unicode_escape_decode(m.line(len(m.data)))[0])


def _float(m: Machine) -> None:
    m.push(float(m.line(_FLOAT)))


def _global(m: Machine) -> None:
    module = m.line().decode("latin-1")
    m.push(m.named(module, m.line().decode("latin-1")))


def _stack_global(m: Machine) -> None:
    name, module = m.pop(), m.pop()
    if not (isinstance(name, str) and isinstance(module, str)):
        raise PickleError("a name that is no text")
    m.push(m.named(module, name))


def _inst(m: Machine) -> None:
    _global(m)
    function = m.pop()
    m.call(function, tuple(m.marked()))


def _obj(m: Machine) -> None:
    items = m.marked()
    if not items:
        raise PickleError("an object of nothing")
    m.call(items[0], tuple(items[1:]))


def _reduce(m: Machine) -> None:
    arguments, function = m.pop(), m.pop()
    m.call(function, arguments)


def _newobj_ex(m: Machine) -> None:
    if m.pop() != {}:
        raise PickleError("an object with named arguments")
    _reduce(m)


def _build(m: Machine) -> None:
    state = m.pop()
    m.build(m.top(), state)


def _get(m: Machine, index: int) -> None:
    if index not in m.memo:
        raise PickleError(f"it asks for its object {shown(index)}, which it has not made")
    m.push(m.memo[index])


def _put(m: Machine, index: int) -> None:
    if index < 0:
        raise PickleError("an object of a number below zero")
    m.memo[index] = m.top()


def _pop_code(m: Machine) -> None:
    if m.stack:
        m.stack.pop()
    else:
        m.marked()


def _mark(m: Machine) -> None:
    m.below.append(m.stack)
    m.stack = []


def _tuple(m: Machine, items: list[Any]) -> None:
    m.container(tuple(items), items)


def _tuple_of(size: int) -> Callable[[Machine], None]:
    return lambda m: _tuple(m, [m.pop() for _ in range(size)][::-1])


def _dict(m: Machine) -> None:
    items, made = m.marked(), dict[Any, Any]()
    m.insert(made, items)
    m.container(made, [])


def _setitem(m: Machine) -> None:
    value, key = m.pop(), m.pop()
    m.insert(m.top(), [key, value])


def _setitems(m: Machine) -> None:
    items = m.marked()
    m.insert(m.top(), items)


def _append(m: Machine) -> None:
    item = m.pop()
    m.extend(m.top(), [item])


def _appends(m: Machine) -> None:
    items = m.marked()
    m.extend(m.top(), items)


def _additems(m: Machine) -> None:
    items = m.marked()
    if type(m.top()) is not set:
        raise PickleError("items for something that is no set")
    m.top().update(m.hashable(item) for item in items)


def _proto(m: Machine) -> None:
    protocol = m.take(1)[0]
    if protocol > 5:
        raise PickleError(f"protocol {protocol}, expected up to 5")


_STEPS: dict[bytes, Callable[[Machine], None]] = {
    b"\x80": _proto,
    b"\x95": lambda m: _void(m.number("<Q")),  # how much belongs together: we have all
    b"(": _mark,
    b"0": _pop_code,
    b"1": lambda m: _void(m.marked()),
    b"2": lambda m: m.push(m.top()),
    b"N": lambda m: m.push(None),
    b"\x88": lambda m: m.push(True),
    b"\x89": lambda m: m.push(False),
    b"I": _int,
    b"L": lambda m: m.push(_whole(m.line())),
    b"J": lambda m: m.push(m.number("<i")),
    b"K": lambda m: m.push(m.number("<B")),
    b"M": lambda m: m.push(m.number("<H")),
    b"\x8a": lambda m: _long(m.number("<B"), m),
    b"\x8b": lambda m: _long(m.number("<I"), m),
    b"F": _float,
    b"G": lambda m: m.push(struct.unpack(">d", m.take(8))[0]),
    b"S": _string,
    b"T": lambda m: m.push(m.take(m.number("<i")).decode("latin-1")),
    b"U": lambda m: m.push(m.take(m.number("<B")).decode("latin-1")),
    b"V": _unicode,
    b"X": lambda m: m.push(_text(m.take(m.number("<I")))),
    b"\x8c": lambda m: m.push(_text(m.take(m.number("<B")))),
    b"\x8d": lambda m: m.push(_text(m.take(m.number("<Q")))),
    b"B": lambda m: m.push(m.take(m.number("<I"))),
    b"C": lambda m: m.push(m.take(m.number("<B"))),
    b"\x8e": lambda m: m.push(m.take(m.number("<Q"))),
    b"\x96": lambda m: m.push(m.take(m.number("<Q"))),
    b"]": lambda m: m.container([], []),
    b"l": lambda m: m.container(items := m.marked(), items),
    b")": lambda m: _tuple(m, []),
    b"t": lambda m: _tuple(m, m.marked()),
    b"\x85": _tuple_of(1),
    b"\x86": _tuple_of(2),
    b"\x87": _tuple_of(3),
    b"}": lambda m: m.container({}, []),
    b"d": _dict,
    b"\x8f": lambda m: m.container(set(), []),
    b"\x91": lambda m: m.container({m.hashable(item) for item in m.marked()}, []),
    b"s": _setitem,
    b"u": _setitems,
    b"a": _append,
    b"e": _appends,
    b"\x90": _additems,
    b"c": _global,
    b"\x93": _stack_global,
    b"i": _inst,
    b"o": _obj,
    b"R": _reduce,
    b"\x81": _reduce,
    b"\x92": _newobj_ex,
    b"b": _build,
    b"g": lambda m: _get(m, _whole(m.line())),
    b"h": lambda m: _get(m, m.number("<B")),
    b"j": lambda m: _get(m, m.number("<I")),
    b"p": lambda m: _put(m, _whole(m.line())),
    b"q": lambda m: _put(m, m.number("<B")),
    b"r": lambda m: _put(m, m.number("<I")),
    b"\x94": lambda m: _put(m, len(m.memo)),
}
