"""Messages of one layout, read at once.

Messages of a topic are mostly alike: the same lengths and texts, other numbers. Where each number
lies is found in the first; where all other bytes are the same in other messages, theirs lie there
too.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from collections.abc import Sequence as Items
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
T = TypeVar("T")

MALFORMED = (ValueError, TypeError, KeyError, IndexError, OverflowError, struct.error)
"""What reading something else than a message raises."""
_WORD = 8
_MOST_ALONE = 1024


class NoMessageError(ValueError):
    """What is no message.

    Attributes:
        number: which of those that were given.
    """

    def __init__(self, number: int, why: str) -> None:
        super().__init__(why)
        self.number = number


class Rows:
    """Messages of one size: lengths and texts are read in the first, numbers in all.

    Attributes:
        first: the first message.

    Args:
        data: (n, size and some more) their bytes.
        size: of each.
    """

    def __init__(self, data: Bytes, size: int) -> None:
        self._data = data
        self.first = data[0, :size].tobytes()
        self._fixed = np.full(data.shape[1], 0xFF, np.uint8)

    def __len__(self) -> int:
        return len(self._data)

    def numbers(self, at: int, kind: str, count: int = 1) -> NDArray[Any]:
        """(n, count) numbers of a NumPy type that lie at a byte.

        Raises:
            ValueError: the messages end before.
        """
        end = at + np.dtype(kind).itemsize * count
        self.free(at, end)
        if not count:
            return np.empty((len(self), 0), kind)
        return np.ascontiguousarray(self._data[:, at:end]).view(kind)

    def free(self, start: int, end: int, bits: int = 0xFF) -> Bytes:
        """(n, end - start) bytes, of which these bits may differ."""
        if not 0 <= start <= end <= len(self.first):
            raise ValueError("it is cut short")
        self._fixed[start:end] &= 0xFF ^ bits
        return self._data[:, start:end]

    def fix(self) -> None:
        """No byte may differ."""
        self._fixed[:] = 0xFF

    def alike(self, data: Bytes) -> NDArray[np.bool_]:
        """(m,) whether messages have the layout that was read in the first."""
        fixed, words = self._fixed.view(np.uint64), data.view(np.uint64)
        return np.asarray(~((words ^ self._data[:1].view(np.uint64)) & fixed).any(1))


def by_layout(messages: Items[bytes], read: Callable[[Rows], T]) -> Iterator[tuple[Ints, T]]:
    """Messages in groups of one layout.

    Args:
        messages: of one kind.
        read: what is in some of one layout, their first axis.

    Yields:
        numbers of messages in rising order, and what is in them.

    Raises:
        NoMessageError: one cannot be read.
    """
    sizes: dict[int, list[int]] = {}
    for i, message in enumerate(messages):
        sizes.setdefault(len(message), []).append(i)
    for size, numbers in sizes.items():
        more = bytes(-size % _WORD or (0 if size else _WORD))
        joined = more.join([*(messages[i] for i in numbers), b""])
        data = np.frombuffer(joined, np.uint8).reshape(len(numbers), -1)
        yield from _layouts(np.array(numbers), data, size, read)


def _layouts(
    at: Ints, data: Bytes, size: int, read: Callable[[Rows], T]
) -> Iterator[tuple[Ints, T]]:
    """The same of messages of one size; where none is like another, more and more one by one."""
    alone = 0
    while len(at):
        first = Rows(data[:1], size)
        found = _one(first, int(at[0]), read)
        same = first.alike(data)
        if same.sum() > 1:
            alone = 0
            yield from _several(at[same], data[same], size, read)
            at, data = at[~same], data[~same]
            continue
        yield at[:1], found
        alone = min(2 * alone + 1, _MOST_ALONE)
        for i in range(1, min(alone, len(at))):
            yield at[i : i + 1], _one(Rows(data[i : i + 1], size), int(at[i]), read)
        at, data = at[alone:], data[alone:]


def _several(
    at: Ints, data: Bytes, size: int, read: Callable[[Rows], T]
) -> Iterator[tuple[Ints, T]]:
    try:
        found = read(Rows(data, size))
    except MALFORMED:  # which of them it is
        for i, number in enumerate(at.tolist()):
            yield at[i : i + 1], _one(Rows(data[i : i + 1], size), number, read)
    else:
        yield at, found


def _one(rows: Rows, number: int, read: Callable[[Rows], T]) -> T:
    try:
        return read(rows)
    except MALFORMED as error:
        raise NoMessageError(number, str(error)) from None
