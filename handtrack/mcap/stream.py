"""An MCAP file written as messages come, chunk by chunk.

The same files as `mcap.writer.Writer` makes, at a third of its cost a message: here a message
is one `struct.pack`, there some twenty calls. Every record but messages, chunks and their
indexes is written by mcap's own classes.
"""

from __future__ import annotations

import struct
import zlib
from bisect import bisect_left
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handtrack.mcap.frames import MESSAGE, Frames
from handtrack.mcap.walk import MAGIC

if TYPE_CHECKING:
    from mcap.records import McapRecord, MetadataIndex, SummaryOffset

CHUNK_NS = 1_000_000_000

_MESSAGE = struct.Struct("<BQHIQQ")  # as `frames.HEAD`
_CHUNK = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size, checksum
_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries


class McapStream:
    """Writes to a stream from its start; `finish` completes the file.

    A chunk is compressed and written once it holds `chunk_bytes` or `chunk_ns` of time, though
    not between messages of the same time; all that came before it can then be read, whatever
    happens to the writer. Chunks, the data as a whole and the index at the end have checksums.
    What is kept in memory grows by some 200 bytes a chunk.

    Args:
        stream: where to write; flushed after each chunk, not closed.
        compression: "lz4", "zstd" or "none".
        chunk_bytes: size of a chunk before compression.
        chunk_ns: how much time a chunk may span [ns].
    """

    def __init__(
        self, stream: IO[bytes], compression: str, chunk_bytes: int, chunk_ns: int = CHUNK_NS
    ) -> None:
        from mcap.records import Header

        self._stream, self._compression = stream, compression
        self._chunk_bytes, self._chunk_ns = chunk_bytes, chunk_ns
        self._position = self._crc = 0
        self._definitions: list[McapRecord] = []
        self._schemas = self._channels = 0
        self._chunks: list[bytes] = []
        self._span: tuple[int, int] | None = None
        self._metadata: list[MetadataIndex] = []
        self.counts: dict[int, int] = {}
        """Messages of each channel in the chunks that were written."""
        self.bytes: dict[int, int] = {}
        """Bytes of all messages of each channel, before compression."""
        self._parts: list[bytes | memoryview] = []
        self._size = 0
        self._entries: dict[int, list[tuple[int, int] | NDArray[np.uint64]]] = {}
        self._first = self._last = 0
        self._reach = (0, 0)
        self._put(MAGIC)
        self._put(_record(Header("", "handtrack")))

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Define a schema; returns its id."""
        from mcap.records import Schema

        self._schemas += 1
        self._define(Schema(id=self._schemas, data=data, encoding=encoding, name=name))
        return self._schemas

    def channel(self, topic: str, message_encoding: str, schema_id: int) -> int:
        """Define a channel; returns its id."""
        from mcap.records import Channel

        self._channels += 1
        self._define(
            Channel(
                id=self._channels,
                topic=topic,
                message_encoding=message_encoding,
                metadata={},
                schema_id=schema_id,
            )
        )
        self.counts[self._channels] = self.bytes[self._channels] = 0
        return self._channels

    def _define(self, record: McapRecord) -> None:
        self._definitions.append(record)
        self._add(_record(record))

    def metadata(self, name: str, values: dict[str, str]) -> None:
        from mcap.records import Metadata, MetadataIndex

        self.flush()
        data = _record(Metadata(name=name, metadata=values))
        self._metadata.append(MetadataIndex(offset=self._position, length=len(data), name=name))
        self._put(data)

    def message(self, channel: int, time: int, sequence: int, data: bytes) -> None:
        """Add a message with its log time [ns]."""
        self._at(time)
        self._reach = min(self._reach[0], time), max(self._reach[1], time)
        self._last = time
        self.bytes[channel] += len(data)
        self._entries.setdefault(channel, []).append((time, self._size))
        length = _MESSAGE.size - 9 + len(data)
        self._parts.append(_MESSAGE.pack(MESSAGE, length, channel, sequence, time, time))
        self._add(data)
        self._size += _MESSAGE.size

    def frames(self, frames: Frames, begin: int, end: int) -> None:
        """Add the messages of some frames, `begin` and those after it, before `end`."""
        times, starts = frames.times, frames.starts
        data = memoryview(frames.data)
        while begin < end:
            self._at(times[begin])
            # those that this chunk has room for
            room = starts[begin] + self._chunk_bytes - self._size
            stop = bisect_left(starts, room, begin + 1, end)
            stop = bisect_left(times, self._first + self._chunk_ns, begin + 1, stop)
            while stop < end and times[stop] == times[stop - 1]:
                stop += 1
            moved = np.array([0, self._size - starts[begin]], np.int64).astype(np.uint64)
            for channel, every, there, before in frames.places:
                entries = every[begin:stop]
                if there is not None:
                    entries = entries[there[begin:stop]]
                if len(entries):
                    self._entries.setdefault(channel, []).append(entries + moved)
                self.bytes[channel] += before[stop] - before[begin]
            self._add(data[starts[begin] : starts[stop]])
            self._last = times[stop - 1]
            self._reach = min(self._reach[0], times[begin]), max(self._reach[1], self._last)
            begin = stop

    def _at(self, time: int) -> None:
        """Begin a chunk before a message of that time, if the one that is open is full."""
        if time != self._last and self._entries:
            late = abs(time - self._first) >= self._chunk_ns
            if late or self._size >= self._chunk_bytes:
                self.flush()
        if not self._entries:
            self._first = time
            self._reach = (time, time)

    def _add(self, data: bytes | memoryview) -> None:
        self._parts.append(data)
        self._size += len(data)

    def flush(self) -> None:
        """Write the chunk that was begun, if it holds a message."""
        from mcap.records import ChunkIndex

        if not self._entries:
            return
        body = b"".join(self._parts)
        packed = _compress(body, self._compression)
        start, end = self._reach
        name = "" if self._compression == "none" else self._compression
        tail = struct.pack("<I", len(name)) + name.encode() + struct.pack("<Q", len(packed))
        length = _CHUNK.size - 9 + len(tail) + len(packed)
        head = _CHUNK.pack(6, length, start, end, len(body), zlib.crc32(body)) + tail
        chunk_at = self._position
        index_at, offsets = chunk_at + len(head) + len(packed), {}
        indexes = bytearray()
        counts = {}
        for channel, entries in self._entries.items():
            offsets[channel] = index_at + len(indexes)
            rows = np.concatenate([np.asarray(e, "<u8").reshape(-1, 2) for e in entries])
            counts[channel], data = len(rows), rows.tobytes()
            indexes += _INDEX.pack(7, 6 + len(data), channel, len(data)) + data
        self._put(head + packed + indexes)
        for channel, count in counts.items():
            self.counts[channel] += count
        self._stream.flush()
        index = ChunkIndex(
            message_start_time=start,
            message_end_time=end,
            chunk_start_offset=chunk_at,
            chunk_length=index_at - chunk_at,
            message_index_offsets=offsets,
            message_index_length=len(indexes),
            compression=name,
            compressed_size=len(packed),
            uncompressed_size=len(body),
        )
        self._chunks.append(_record(index))
        first, last = self._span or (start, end)
        self._span = min(first, start), max(last, end)
        self._parts, self._size, self._entries = [], 0, {}

    def finish(self) -> None:
        """Write what is left, and the index that lets readers find everything."""
        from mcap.opcode import Opcode
        from mcap.records import Channel, DataEnd, Schema, Statistics, SummaryOffset

        self.flush()
        self._put(_record(DataEnd(self._crc)))
        start = self._position
        start_time, end_time = self._span or (0, 0)
        statistics = Statistics(
            attachment_count=0,
            channel_count=self._channels,
            channel_message_counts=self.counts,
            chunk_count=len(self._chunks),
            message_count=sum(self.counts.values()),
            message_start_time=start_time,
            message_end_time=end_time,
            metadata_count=len(self._metadata),
            schema_count=self._schemas,
        )
        groups = (
            (Opcode.SCHEMA, [_record(r) for r in self._definitions if isinstance(r, Schema)]),
            (Opcode.CHANNEL, [_record(r) for r in self._definitions if isinstance(r, Channel)]),
            (Opcode.STATISTICS, [_record(statistics)]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.METADATA_INDEX, [_record(record) for record in self._metadata]),
        )
        summary = bytearray()
        offsets: list[SummaryOffset] = []
        for opcode, records in groups:
            data = b"".join(records)
            offsets.append(SummaryOffset(opcode, start + len(summary), len(data)))
            summary += data
        offsets_at = start + len(summary)
        summary += b"".join(_record(offset) for offset in offsets)
        self._put(bytes(summary))
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offsets_at)
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        self._put(footer + struct.pack("<I", checksum) + MAGIC)

    def _put(self, data: bytes) -> None:
        self._stream.write(data)
        self._crc = zlib.crc32(data, self._crc)
        self._position += len(data)


def _record(record: McapRecord) -> bytes:
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _compress(data: bytes, compression: str) -> bytes:
    if compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.compress(data))
    if compression == "zstd":
        import zstandard

        return zstandard.compress(data)
    return data
