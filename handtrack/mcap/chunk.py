"""A chunk of an MCAP file: opened only if all that it says of itself is so."""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

MOST_BYTES = 1 << 30
"""A chunk that claims more is not opened; ours hold a quarter of a mebibyte."""

_HEAD = struct.Struct("<QQQII")  # first and last time, size, checksum, length of the next
_SIZE = struct.Struct("<Q")
_WINDOW = 1 << 27  # what zstd needs at most, as its own program does


class Place(NamedTuple):
    """Where an index says that a chunk is.

    Attributes:
        offset, length: of its record [bytes].
        first, last: log times of its messages [ns].
    """

    offset: int
    length: int
    first: int
    last: int


class Chunk(NamedTuple):
    """An opened chunk.

    Attributes:
        first, last: log times of its messages [ns].
        compression: "lz4", "zstd" or "" for none.
        data: the records in it.
    """

    first: int
    last: int
    compression: str
    data: bytes


def open_chunk(content: bytes) -> Chunk:
    """The content of a chunk record.

    Raises:
        ValueError: sizes or the checksum differ, or the compression is unknown.
        struct.error: it is too short.
        zstandard.ZstdError, RuntimeError: it cannot be decompressed.
    """
    first, last, size, checksum, length = _HEAD.unpack_from(content)
    at = _HEAD.size + length
    compression = content[_HEAD.size : at].decode()
    (packed,) = _SIZE.unpack_from(content, at)
    body = content[at + _SIZE.size :]
    if packed != len(body):
        raise ValueError(f"a chunk of {len(body)} bytes says that it has {packed}")
    if size > MOST_BYTES:
        raise ValueError(f"a chunk of {size} bytes, expected {MOST_BYTES} at most")
    data = _decompressed(body, compression, size)
    if len(data) != size:
        raise ValueError(f"a chunk holds {len(data)} bytes, expected {size}")
    if checksum not in (0, zlib.crc32(data)):
        raise ValueError("the checksum of a chunk differs")
    return Chunk(first, last, compression, data)


def _decompressed(body: bytes, compression: str, size: int) -> bytes:
    """At most a byte more than so many, whatever the body would give."""
    if not compression:
        return body
    if compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(body, max_length=size + 1))
    if compression == "zstd":
        import zstandard

        with zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(body) as reader:
            return reader.read(size + 1)
    raise ValueError(f"compression {compression[:20]!r} is unknown")
