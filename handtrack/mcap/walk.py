"""The records of an MCAP file from its beginning, as far as they are whole.

mcap has a reader that needs no index too; but where a file breaks it raises an error, and what
was read is lost with it. This one gives every whole record up to the break, says at which byte
that is, goes on from there when the file has grown, and trusts nothing whose checksum or size
differs. Parsing of single records, but for chunks and messages, is mcap's.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

from handtrack.errors import InputError

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

NOT_MCAP = "not an MCAP file; `handtrack track` makes recordings"
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


MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_TIMES = struct.Struct("<QQ")
_ENTRIES = struct.Struct("<HI")  # of an index of messages: channel, bytes of entries
_SKIPPED = (1, 9)  # the header, attachments
_PRIVATE = 128
"""Records of such opcodes are for others; of those below all are known."""


def opened(path: Path) -> IO[bytes]:
    """A file open for reading.

    Raises:
        InputError: there is none, or it can't be read.
    """
    try:
        return path.open("rb")
    except FileNotFoundError as error:
        raise InputError("there is no such file", path) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path) from error


class Found(NamedTuple):
    """A message.

    Attributes:
        channel: id of its channel.
        sequence: its number.
        time: log time [ns].
        data: its content.
    """

    channel: int
    sequence: int
    time: int
    data: bytes


@dataclass
class Walk:
    """What was met so far in one file.

    Attributes:
        path: the file.
        metadata: metadata records by name.
        channels: channels by id.
        schemas: names of schemas by id.
        definitions: schemas by id.
        cut: where and how the file ends too early; empty for a complete file.
        done: whether the end of the data was met.
        chunks: how many were read.
        compression: of the last one.
        position: byte up to which it was read.
    """

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, str] = field(default_factory=dict)
    definitions: dict[int, Schema] = field(default_factory=dict)
    cut: str = ""
    done: bool = False
    chunks: int = 0
    compression: str = ""
    position: int = 0
    _crc: int = 0

    def messages(
        self,
        wanted: Callable[[Channel], bool],
        places: Iterable[Place] | None = None,
        stream: IO[bytes] | None = None,
    ) -> Iterator[Found]:
        """Messages of the channels that are wanted, in the file's order.

        Of a file that was cut, a second call goes on from there, if it has grown since.

        Args:
            wanted: by the channel; `schema_of` tells its schema's name.
            places: of the chunks to read, by `McapIndex`; all by default.
            stream: the file, if it is open already.

        Yields:
            messages; with `metadata`, `channels` and `schemas` filled as far as the file was
            read.

        Raises:
            InputError: it can't be read, is no MCAP file, or is damaged.
        """
        file = opened(self.path) if stream is None else nullcontext(stream)
        with self.telling(), file as source:
            records = self._records(source) if places is None else self._at(source, places)
            for opcode, content in records:
                yield from self._record(opcode, content, wanted)

    def _at(self, stream: IO[bytes], places: Iterable[Place]) -> Iterator[tuple[int, bytes]]:
        from mcap.opcode import Opcode

        for place in places:
            self.position = place.offset
            stream.seek(place.offset)
            record = stream.read(place.length)
            opcode, size = RECORD.unpack_from(record)
            times = _TIMES.unpack_from(record, RECORD.size)
            found = (opcode, size + RECORD.size, len(record), *times)
            if found != (Opcode.CHUNK, place.length, place.length, place.first, place.last):
                raise ValueError("there is not the chunk that the index names")
            yield opcode, record[RECORD.size :]

    @contextmanager
    def telling(self, what: str = "") -> Iterator[None]:
        """What damaged files raise, as InputError that says `what`, or else where."""
        import zstandard
        from mcap.exceptions import McapError

        expected = (
            McapError,
            zstandard.ZstdError,
            struct.error,
            ValueError,  # checksums, and text that is not UTF-8
            RuntimeError,  # lz4
            IndexError,
            OverflowError,
            MemoryError,
        )
        try:
            yield
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError(f"cannot be read: {reason}", self.path) from error
        except InputError:
            raise
        except expected as error:
            where = what or f"damaged at byte {self.position}"
            raise InputError(f"{where}: {error}", self.path) from error

    def _records(self, stream: IO[bytes]) -> Iterator[tuple[int, bytes]]:
        """(opcode, content) of every whole record up to the end of the data."""
        from mcap.opcode import Opcode

        size = stream.seek(0, 2)
        stream.seek(self.position)
        if not self.position:
            start = stream.read(len(MAGIC))
            if start != MAGIC:
                raise InputError(NOT_MCAP if size else "the file is empty", self.path)
            self._crc, self.position = zlib.crc32(start), len(MAGIC)
        while self.position < size:
            head = stream.read(RECORD.size)
            if len(head) < RECORD.size:
                break
            opcode, length = RECORD.unpack(head)
            if length > size - self.position - RECORD.size:
                break
            content = stream.read(length)
            if opcode == Opcode.DATA_END:
                (expected,) = struct.unpack("<I", content)
                if expected not in (0, self._crc):
                    raise ValueError("the checksum of the data differs")
                self.done, self.cut = True, ""
                return
            if opcode == Opcode.MESSAGE and self.chunks:
                # what has no checksum, after what has one, is a piece of something else
                raise ValueError("a message is outside of the chunks")
            yield opcode, content
            self._crc = zlib.crc32(content, zlib.crc32(head, self._crc))
            self.position += RECORD.size + length
        self.cut = f"it ends in the middle of its data, after byte {self.position}"

    def _record(
        self, opcode: int, content: bytes, wanted: Callable[[Channel], bool]
    ) -> Iterator[Found]:
        from mcap.data_stream import ReadDataStream
        from mcap.opcode import Opcode
        from mcap.records import Channel, Metadata, Schema

        if opcode == Opcode.CHUNK:
            chunk = open_chunk(content)
            self.chunks, self.compression = self.chunks + 1, chunk.compression
            yield from self._inside(chunk, wanted)
        elif opcode == Opcode.MESSAGE:
            channel, sequence, time, _ = _MESSAGE.unpack_from(content)
            if wanted(self._channel(channel)):
                yield Found(channel, sequence, time, content[_MESSAGE.size :])
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(content)))
            self.schemas[schema.id], self.definitions[schema.id] = schema.name, schema
        elif opcode == Opcode.CHANNEL:
            record = Channel.read(ReadDataStream(BytesIO(content)))
            self.channels[record.id] = record
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(ReadDataStream(BytesIO(content)))
            self.metadata[metadata.name] = metadata.metadata
        elif opcode == Opcode.MESSAGE_INDEX:
            if _ENTRIES.unpack_from(content)[1] != len(content) - _ENTRIES.size:
                raise ValueError("an index of messages is not as long as it says")
        elif opcode < _PRIVATE and opcode not in _SKIPPED:
            raise ValueError(f"a record of kind {opcode} does not belong there")

    def _inside(self, chunk: Chunk, wanted: Callable[[Channel], bool]) -> Iterator[Found]:
        """Messages in the records of a chunk; whether a channel's are wanted is asked once."""
        from mcap.opcode import Opcode

        data, (first, last) = chunk.data, chunk[:2]
        message, position = int(Opcode.MESSAGE), 0
        asked: dict[int, bool] = {}
        while position < len(data):
            opcode, length = RECORD.unpack_from(data, position)
            position += RECORD.size
            end = position + length
            if end > len(data):
                raise ValueError("a record is longer than its chunk")
            # most are messages
            if opcode != message:
                yield from self._record(opcode, data[position:end], wanted)
                asked.clear()
            else:
                channel, sequence, time, _ = _MESSAGE.unpack_from(data, position)
                if channel not in asked:
                    asked[channel] = wanted(self._channel(channel))
                if asked[channel]:
                    if length < _MESSAGE.size:
                        raise ValueError("a message is shorter than its head")
                    if not first <= time <= last:
                        raise ValueError("a message is not of the time that its chunk says")
                    yield Found(channel, sequence, time, data[position + _MESSAGE.size : end])
            position = end

    def schema_of(self, channel: Channel) -> str:
        """Name of a channel's schema; empty if it has none."""
        return self.schemas.get(channel.schema_id, "")

    def _channel(self, number: int) -> Channel:
        if number not in self.channels:
            raise ValueError(f"a message of channel {number}, which is not defined")
        return self.channels[number]
