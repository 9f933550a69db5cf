"""Messages of fixed size, encoded many at a time as rows of bytes.

Most of a recording is arrays whose size never changes, so a message is a template with holes.
The holes of all frames are filled by NumPy, a few copies a batch instead of a Python object
for every number.
"""

from __future__ import annotations

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
