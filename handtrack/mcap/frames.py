"""Messages of many frames at once: as rows of bytes, and as the stretch of a chunk they make.

Most of a recording is arrays whose size never changes, so a message is a template with holes, a
`Layout`. A frame has five messages and more. What a chunk holds of some hundred frames is made here
by a few copies of NumPy, and where each message stands in it is known without looking at any of
them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5


class Layout:
    """A message as constant bytes and named slots of fixed size; methods add to its end.

    A name may be given to several slots: all get the same bytes.
    """

    def __init__(self, data: bytes = b"") -> None:
        self._template = bytearray(data)
        self._slots: list[tuple[str, int, int]] = []  # name, offset, size

    @property
    def size(self) -> int:
        """Bytes of a message."""
        return len(self._template)

    def constant(self, data: bytes) -> Layout:
        self._template += data
        return self

    def slot(self, name: str, size: int) -> Layout:
        self._slots.append((name, len(self._template), size))
        self._template += bytes(size)
        return self

    def append(self, other: Layout) -> Layout:
        start = len(self._template)
        self._slots += [(name, start + offset, size) for name, offset, size in other._slots]
        self._template += other._template
        return self

    # protobuf fields

    def field(self, number: int, content: Layout | bytes) -> Layout:
        """A length-delimited field: bytes, a string, packed numbers or a message."""
        content = Layout(content) if isinstance(content, bytes) else content
        return self.constant(tag(number, _BYTES) + varint(content.size)).append(content)

    def fields(self, number: int, rows: NDArray[np.uint8]) -> Layout:
        """`field` for each row (n, k) of bytes."""
        head = tag(number, _BYTES) + varint(rows.shape[1])
        heads = np.broadcast_to(np.frombuffer(head, np.uint8), (len(rows), len(head)))
        return self.constant(np.concatenate([heads, rows], 1).tobytes())

    def varint(self, number: int, value: int) -> Layout:
        return self.constant(tag(number, _VARINT) + varint(value))

    def fixed32(self, number: int, value: int) -> Layout:
        return self.constant(tag(number, _FIXED32) + value.to_bytes(4, "little"))

    def number(self, number: int, name: str) -> Layout:
        """A slot for one double or sfixed64."""
        return self.constant(tag(number, _FIXED64)).slot(name, 8)

    def numbers(self, number: int, name: str, count: int, size: int = 8) -> Layout:
        """A slot for packed numbers of `size` bytes."""
        return self.field(number, Layout().slot(name, count * size))

    def timestamp(self, number: int) -> Layout:
        """A google.protobuf.Timestamp; `timestamps` makes its slots' values."""
        seconds_and_nanos = Layout().constant(tag(1, _VARINT)).slot("seconds", 5)
        seconds_and_nanos.constant(tag(2, _VARINT)).slot("nanos", 5)
        return self.field(number, seconds_and_nanos)

    def rows(self, n: int, **values: NDArray[np.generic]) -> NDArray[np.uint8]:
        """The messages of n frames, one a row.

        Args:
            n: how many.
            values: for every slot name an array of n rows of exactly its bytes, in
                little-endian order.
        """
        out = np.empty((n, self.size), np.uint8)
        out[:] = np.frombuffer(self._template, np.uint8)
        if n == 0:
            return out
        as_bytes = {
            name: np.ascontiguousarray(value).reshape(n, -1).view(np.uint8)
            for name, value in values.items()
        }
        for name, offset, size in self._slots:
            out[:, offset : offset + size] = as_bytes[name]
        return out


def tag(number: int, wire_type: int) -> bytes:
    """What stands before a field of protobuf: its number, and how its value is written."""
    return varint(number << 3 | wire_type)


def varint(value: int) -> bytes:
    """A number, not negative, as protobuf writes it: seven bits a byte, the lowest first."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def timestamps(time_ns: NDArray[np.uint64]) -> dict[str, NDArray[np.uint8]]:
    """What `Layout.timestamp` needs to hold times [ns] that are not negative."""
    billion = np.uint64(1_000_000_000)
    return {"seconds": _wide(time_ns // billion), "nanos": _wide(time_ns % billion)}


def _wide(values: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Varints (n, 5) of numbers below 2^35, padded to five bytes, which protobuf allows."""
    shifts = np.arange(0, 35, 7, dtype=np.uint64)
    groups = (values[:, None] >> shifts) & np.uint64(0x7F)
    groups[:, :4] |= np.uint64(0x80)
    return groups.astype(np.uint8)


Bytes = NDArray[np.uint8]
Times = NDArray[np.uint64]

HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("time", "<u8"),
        ("published", "<u8"),
    ]
)
"""What stands before a message's data in a file: MCAP's record of a message."""
MESSAGE = 5
"""Its opcode."""
_SAID = HEAD.itemsize - 9
"""Bytes of the head that its length counts."""


class Rows(NamedTuple):
    """Messages of one kind, one a frame: the beginning of a row, and what follows it.

    Attributes:
        rows: (n, most) bytes.
        sizes: (n,) how many of each row are the message's; -1: the frame has none.
        tails: what follows in each, or empty if nothing follows in any.
    """

    rows: Bytes
    sizes: NDArray[np.int64]
    tails: Sequence[bytes] = ()

    @staticmethod
    def of(messages: Sequence[bytes]) -> Rows:
        """Messages of any length."""
        n = len(messages)
        return Rows(np.empty((n, 0), np.uint8), np.zeros(n, np.int64), messages)

    @staticmethod
    def whole(rows: Bytes, there: NDArray[np.bool_] | None = None) -> Rows:
        """Messages of one length; none where they are not there."""
        sizes = np.full(len(rows), rows.shape[1], np.int64)
        return Rows(rows, sizes if there is None else np.where(there, sizes, -1))

    def among(self, n: int, frames: NDArray[np.int64]) -> Rows:
        """As messages of those of n frames, in order, with none for the others."""
        if len(frames) == n:
            return self
        rows, sizes = np.empty((n, self.rows.shape[1]), np.uint8), np.full(n, -1, np.int64)
        rows[frames], sizes[frames] = self.rows, self.sizes
        tails = [b""] * n if self.tails else []
        for i, tail in zip(frames.tolist(), self.tails, strict=False):
            tails[i] = tail
        return Rows(rows, sizes, tails)

    def messages(self) -> list[bytes | None]:
        """They one by one."""
        tails = self.tails or [b""] * len(self.rows)
        return [
            None if size < 0 else row[:size].tobytes() + tail
            for row, size, tail in zip(self.rows, self.sizes.tolist(), tails, strict=True)
        ]


class Column(NamedTuple):
    """Where the messages of a channel are.

    Attributes:
        channel: its id.
        entries: (n, 2) time [ns] and offset of every frame's in the stretch.
        there: (n,) which frames have one; None for all.
        before: (n + 1) bytes of the messages of all frames before each.
    """

    channel: int
    entries: NDArray[np.uint64]
    there: NDArray[np.bool_] | None
    before: list[int]


class Frames:
    """Messages of frames, in order of time: those of a frame one after another.

    Attributes:
        times: of each frame [ns].
        data: all records of messages, as they stand in a chunk.
        starts: (n + 1) where each frame begins in it; the last is its end.
        places: of each channel's messages.

    Args:
        times: (n,) log times [ns], none before the one before it.
        numbers: (n,) sequence numbers, written modulo 2^32.
        columns: the messages by channel, in the order in which they stand.
    """

    def __init__(
        self, times: Times, numbers: NDArray[np.uint64], columns: Mapping[int, Rows]
    ) -> None:
        n = len(times)
        numbers = numbers & np.uint64(0xFFFFFFFF)
        self.times: list[int] = times.tolist()
        usual = [_usual(column) for column in columns.values()]
        width = sum(
            HEAD.itemsize + column.rows.shape[1] + len(tail)
            for column, tail in zip(columns.values(), usual, strict=True)
        )
        whole = np.empty((n, width), np.uint8)
        plain, at = np.ones(n, np.bool_), 0
        begin = np.zeros(n, np.int64)
        parts: list[tuple[int, Rows]] = []
        found: list[tuple[int, NDArray[np.int64], NDArray[np.int64]]] = []
        for (channel, column), tail in zip(columns.items(), usual, strict=True):
            parts.append((at, column))
            sizes = column.sizes
            if column.tails:
                there = sizes >= 0
                sizes = sizes + np.where(there, [len(text) for text in column.tails], 0)
                plain &= np.array([text == tail for text in column.tails], np.bool_)
            plain &= column.sizes == column.rows.shape[1]
            at = _fill(whole, at, column.rows, tail, _heads(channel, times, numbers, sizes))
            found.append((channel, begin, sizes))
            begin = begin + np.where(sizes >= 0, HEAD.itemsize + sizes, 0)
        starts = np.concatenate([[0], np.cumsum(begin)])
        self.starts: list[int] = starts.tolist()
        self.data = _joined(whole, plain, parts)
        self.places = [
            _place(channel, times, starts[:-1] + offset, sizes) for channel, offset, sizes in found
        ]

    def __len__(self) -> int:
        return len(self.times)


def _usual(column: Rows) -> bytes:
    """What follows the rows in most frames."""
    return Counter(column.tails).most_common(1)[0][0] if column.tails else b""


def _heads(
    channel: int, times: Times, numbers: NDArray[np.uint64], sizes: NDArray[np.int64]
) -> Bytes:
    heads = np.empty(len(times), HEAD)
    heads["opcode"], heads["channel"] = MESSAGE, channel
    heads["length"], heads["sequence"] = _SAID + sizes, numbers
    heads["time"] = heads["published"] = times
    return heads.view(np.uint8).reshape(len(times), HEAD.itemsize)


def _fill(whole: Bytes, at: int, rows: Bytes, tail: bytes, heads: Bytes) -> int:
    """Put a channel's messages in their columns; returns where the next one's are."""
    for part in (heads, rows, np.frombuffer(tail, np.uint8)):
        end = at + part.shape[-1]
        whole[:, at:end] = part
        at = end
    return at


def _joined(whole: Bytes, plain: NDArray[np.bool_], parts: Sequence[tuple[int, Rows]]) -> bytes:
    """The rows one after another; of frames that are not as most are, what they have instead."""
    if plain.all():
        return whole.tobytes()
    n, width = whole.shape
    flat = whole.reshape(-1).data
    pieces: list[bytes | memoryview] = []
    done = 0
    for t in np.flatnonzero(~plain).tolist():
        pieces.append(flat[done * width : t * width])
        done = t + 1
        for at, column in parts:
            size = int(column.sizes[t])
            if size >= 0:
                begin = t * width + at
                pieces.append(flat[begin : begin + HEAD.itemsize + size])
                if column.tails:
                    pieces.append(column.tails[t])
    pieces.append(flat[done * width : n * width])
    return b"".join(pieces)


def _place(
    channel: int, times: Times, offsets: NDArray[np.int64], sizes: NDArray[np.int64]
) -> Column:
    there = sizes >= 0
    before = np.concatenate([[0], np.cumsum(np.where(there, sizes, 0))]).tolist()
    entries = np.column_stack([times, offsets.astype(np.uint64)])
    return Column(channel, entries, None if there.all() else there, before)
