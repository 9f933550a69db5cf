"""Protobuf messages of one layout, read at once.

The library reads the first; where its own numbers lie in it is found by the wire's rules
(protobuf.dev/programming-guides/encoding), and what is found there must be what the library says.
"""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.readers.message_rows import Rows

_VARINT, _EIGHT, _LENGTH, _FOUR = 0, 1, 2, 5
_LONGEST = 10  # bytes of a varint
_DEEPEST = 16


@lru_cache(8)
def class_of(name: str, schema: bytes) -> Any:
    """The class of a message, by the schema that its file holds.

    Raises:
        ValueError, TypeError, KeyError: the schema is damaged.
    """
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message import DecodeError
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    try:
        files = FileDescriptorSet.FromString(schema).file
    except DecodeError as error:
        raise ValueError(f"its schema is damaged: {error}") from None
    for file in files:
        pool.AddSerializedFile(file.SerializeToString())
    return GetMessageClass(pool.FindMessageTypeByName(name))


def parsed(data: bytes, made: Any) -> Any:
    """A message of a class, by the library.

    Raises:
        ValueError: it is none.
    """
    from google.protobuf.message import DecodeError

    message = made()
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        raise ValueError(str(error)) from None
    return message


def fields_of(rows: Rows, made: Any) -> Any:
    """The fields of messages of one layout: numbers (n,), texts, messages and lists of them under
    their names, or what is left out as the library has it.

    Raises:
        ValueError: fields that are not read here.
    """
    return _Wire(rows).message(made.DESCRIPTOR, 0, len(rows.first), made(), 0)


class _Wire:
    """Walks through the first message."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows

    def message(self, descriptor: Any, at: int, end: int, empty: Any, depth: int) -> Any:
        """The fields of a message between two bytes."""
        if depth > _DEEPEST:
            raise ValueError("messages within messages")
        found: dict[str, Any] = {}
        while at < end:
            tag, at = self._tag(at, end)
            field = descriptor.fields_by_number.get(tag >> 3)
            if field is None:
                at = self._past(tag & 7, at, end)
                continue
            repeated = getattr(field, "is_repeated", None)
            repeated = field.label == field.LABEL_REPEATED if repeated is None else repeated
            value, at = self._value(field, tag & 7, at, end, depth)
            if repeated and field.type == field.TYPE_MESSAGE:
                found.setdefault(field.name, []).append(value)
            elif repeated or field.name in found:
                raise ValueError(f"{field.name} several times")
            else:
                found[field.name] = value
        for field in descriptor.fields:
            if field.name not in found:
                found[field.name] = getattr(empty, field.name)
        return SimpleNamespace(**found)

    def _value(self, field: Any, wire: int, at: int, end: int, depth: int) -> tuple[Any, int]:
        if wire == _LENGTH and field.type in (field.TYPE_MESSAGE, field.TYPE_STRING):
            size, at = self._tag(at, end)
            if size > end - at:
                raise ValueError("a length leads out of the message")
            if field.type == field.TYPE_STRING:
                return self._rows.first[at : at + size].decode(), at + size
            inner = field.message_type
            from google.protobuf.message_factory import GetMessageClass

            empty = GetMessageClass(inner)()
            return self.message(inner, at, at + size, empty, depth + 1), at + size
        if wire == _EIGHT and field.type == field.TYPE_DOUBLE:
            return self._rows.numbers(at, "<f8")[:, 0], at + 8
        if wire == _FOUR and field.type == field.TYPE_FLOAT:
            return self._rows.numbers(at, "<f4")[:, 0].astype(np.float64), at + 4
        if wire == _VARINT and field.type in (field.TYPE_INT64, field.TYPE_INT32):
            value, at = self._varint(at, end)
            return (value if field.type == field.TYPE_INT64 else value.astype(np.int32)), at
        raise ValueError(f"{field.name} is of a kind that is not read here")

    def _tag(self, at: int, end: int) -> tuple[int, int]:
        """A varint that is the same in all."""
        value, last = 0, self._last(at, end)
        for i in range(at, last):
            value |= (self._rows.first[i] & 0x7F) << 7 * (i - at)
        return value, last

    def _varint(self, at: int, end: int) -> tuple[NDArray[np.int64], int]:
        """(n,) varints of as many bytes as in the first."""
        last = self._last(at, end)
        value = np.zeros(len(self._rows), np.uint64)
        for i, byte in enumerate(self._rows.free(at, last, 0x7F).T):
            value |= (byte & 0x7F).astype(np.uint64) << np.uint64(7 * i)
        return value.view(np.int64), last

    def _last(self, at: int, end: int) -> int:
        """The byte behind a varint."""
        for i in range(at, min(end, at + _LONGEST)):
            if self._rows.first[i] < 0x80:
                return i + 1
        raise ValueError("a number without an end")

    def _past(self, wire: int, at: int, end: int) -> int:
        """The byte behind a field that nobody asks for."""
        if wire == _VARINT:
            last = self._last(at, end)
        elif wire == _LENGTH:
            size, at = self._tag(at, end)
            last = at + size
        elif wire in (_EIGHT, _FOUR):
            last = at + (8 if wire == _EIGHT else 4)
        else:
            raise ValueError("a group")
        if last > end:
            raise ValueError("a field leads out of the message")
        return last
