"""Messages of many frames at once: as rows of bytes, and as the stretch of a chunk they make.

A frame has five messages and more. What a chunk holds of some hundred frames is made here by a few
copies of NumPy, and where each message stands in it is known without looking at any of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
