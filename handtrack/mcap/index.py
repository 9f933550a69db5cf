"""What the end of an MCAP file says of it: read in a few milliseconds, whatever its size."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.mcap.walk import MAGIC, NOT_MCAP, RECORD, Place, Walk, opened

if TYPE_CHECKING:
    from mcap.records import Channel, Statistics

_FOOTER = struct.Struct("<BQQQI")
_CHUNK = struct.Struct("<QQQQI")  # first and last time, offset, length, bytes of the map


@dataclass
class McapIndex:
    """The summary of a complete MCAP file.

    Attributes:
        path: the file.
        size: its bytes.
        channels, schemas: channels and names of schemas by id.
        counts: messages of every channel.
        chunks: (n, 4) uint64: first and last log time [ns], offset and length of each chunk.
        compression: of the chunks: "lz4", "zstd" or "none".
        metadata: records by name.
        begins: where the data after each metadata record begins, by its name.
    """

    path: Path
    size: int
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, str] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    chunks: NDArray[np.uint64] = field(default_factory=lambda: np.empty((0, 4), np.uint64))
    compression: str = "none"
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    begins: dict[str, int] = field(default_factory=dict)

    def walk(self) -> Walk:
        """A walk that knows the channels already, to read chunks anywhere in the file."""
        return Walk(self.path, dict(self.metadata), dict(self.channels), dict(self.schemas))

    def between(self, start: int, end: int) -> list[Place]:
        """The chunks with messages of log times start..end, both included."""
        first, last = self.chunks[:, 0], self.chunks[:, 1]
        picked = (last >= np.uint64(start)) & (first <= np.uint64(end))
        return [self._place(i) for i in np.flatnonzero(picked).tolist()]

    def _place(self, i: int) -> Place:
        first, last, offset, length = self.chunks[i].tolist()
        return Place(offset, length, first, last)

    def at(self, begin: int) -> Place:
        """The first chunk at or after a byte.

        Raises:
            ValueError: there is none.
        """
        place = int(np.searchsorted(self.chunks[:, 2], np.uint64(begin)))
        if place == len(self.chunks):
            raise ValueError(f"no chunk after byte {begin}")
        return self._place(place)


def read_index(path: Path) -> McapIndex | None:
    """The index of a file; None if it has none, as a file whose writer was stopped.

    Raises:
        InputError: it can't be read, is no MCAP file, or its index is damaged.
    """
    with opened(path) as stream, Walk(path).telling("its index is damaged"):
        size = stream.seek(0, 2)
        stream.seek(0)
        if stream.read(len(MAGIC)) != MAGIC:
            raise InputError(NOT_MCAP if size else "the file is empty", path)
        end = _FOOTER.size + len(MAGIC)
        if size < len(MAGIC) + end:
            return None
        stream.seek(-end, 2)
        footer = stream.read(end)
        opcode, length, start, _, checksum = _FOOTER.unpack_from(footer)
        if footer[-len(MAGIC) :] != MAGIC or (opcode, length) != (2, 20):
            return None
        if not checksum:
            # nothing vouches for the index, if there is one: another program's file
            return None
        if not len(MAGIC) <= start <= size - end:
            raise ValueError("it starts outside of the file")
        stream.seek(start)
        data = stream.read(size - end - start)
        if zlib.crc32(footer[: _FOOTER.size - 4], zlib.crc32(data)) != checksum:
            raise ValueError("its checksum differs")
        return _parsed(McapIndex(path, size), data, stream)


def _parsed(index: McapIndex, data: bytes, stream: IO[bytes]) -> McapIndex:
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Metadata, MetadataIndex, Schema, Statistics

    chunks: list[tuple[int, ...]] = []
    compression, chunk_index, count = "", int(Opcode.CHUNK_INDEX), None
    for opcode, at, length in _records(data):
        if opcode == chunk_index:
            *chunk, channels = _CHUNK.unpack_from(data, at)
            chunks.append(tuple(chunk))
            if not compression:
                # after the map and the length of the indexes
                name = at + _CHUNK.size + channels + 8
                (size,) = struct.unpack_from("<I", data, name)
                compression = data[name + 4 : name + 4 + size].decode() or "none"
            continue
        content = data[at : at + length]
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(content)))
            index.schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(content)))
            index.channels[channel.id] = channel
        elif opcode == Opcode.STATISTICS:
            statistics: Statistics = Statistics.read(ReadDataStream(BytesIO(content)))
            index.counts, count = dict(statistics.channel_message_counts), statistics.chunk_count
        elif opcode == Opcode.METADATA_INDEX:
            where = MetadataIndex.read(ReadDataStream(BytesIO(content)))
            stream.seek(where.offset)
            record = stream.read(where.length)[RECORD.size :]
            found = Metadata.read(ReadDataStream(BytesIO(record)))
            index.metadata[found.name] = found.metadata
            index.begins[found.name] = where.offset + where.length
    chunks.sort(key=lambda chunk: chunk[2])
    index.chunks = np.array(chunks, np.uint64).reshape(-1, 4)
    begins, lengths = index.chunks[:, 2], index.chunks[:, 3]
    ends = np.concatenate([[np.uint64(len(MAGIC))], begins + lengths])
    in_file = (lengths < index.size).all() and (begins < index.size).all()
    if count not in (None, len(chunks)) or not in_file or (begins < ends[:-1]).any():
        raise ValueError("the chunks that it names are not those of the file")
    index.compression = compression or "none"
    return index


def _records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, place and length of every record."""
    position = 0
    while position < len(data):
        opcode, length = RECORD.unpack_from(data, position)
        position += RECORD.size
        if length > len(data) - position:
            raise ValueError("a record is longer than the index")
        yield opcode, position, length
        position += length
