"""Opening MCAP files, and telling whose they are."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from handtrack.errors import InputError
from handtrack.sequences.readers.raw import NotJointsError, Raw


@dataclass
class Message:
    """A message with what is needed to decode it.

    Attributes:
        topic: where it was sent.
        encoding: "json", "protobuf", ...
        schema_name, schema: the schema's name and text; empty where there is none.
        log_time: [ns].
        data: the message.
    """

    topic: str
    encoding: str
    schema_name: str
    schema: bytes
    log_time: int
    data: bytes


@dataclass
class McapFile:
    """What was read of a file.

    Attributes:
        messages: those that may be joints, in the order of their log times.
        metadata: its metadata records.
        topics: all topics with their encodings, for people.
    """

    messages: list[Message]
    metadata: dict[str, dict[str, str]]
    topics: list[str]


def read_mcap(path: Path) -> list[Raw]:
    """The sequences of an MCAP file: handtrack's own, or JSON joint messages.

    Raises:
        NotJointsError: no topic that is understood.
        InputError: damaged or cut short, or a message that does not fit.
    """
    from handtrack.sequences.readers import mcap_json, mcap_own

    file = _read(path, {mcap_own.STATE, mcap_own.HAND})
    if "handtrack" in file.metadata or any(m.schema_name == mcap_own.STATE for m in file.messages):
        return mcap_own.read(file, path)
    if file.messages:
        return mcap_json.read(file, path)
    if not file.topics:
        raise InputError("no messages in it", path)
    raise NotJointsError(f"no joint messages in it, topics are {', '.join(file.topics[:6])}", path)


def _read(path: Path, schemas: set[str]) -> McapFile:
    """Only messages of those schemas and JSON ones: recordings hold meshes and pictures too."""
    from mcap.reader import make_reader

    with _damage(path), path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        wanted: list[str] | None = None
        if summary is not None and summary.statistics is not None:
            names = {i: schema.name for i, schema in summary.schemas.items()}
            wanted = [
                c.topic
                for c in summary.channels.values()
                if c.message_encoding == "json" or names.get(c.schema_id) in schemas
            ]
        messages: list[Message] = []
        topics: dict[str, None] = {}
        counted = 0
        if summary is not None:
            topics |= {f"{c.topic} ({c.message_encoding})": None for c in summary.channels.values()}
        for schema, channel, message in reader.iter_messages(topics=wanted):
            counted += 1
            name = "" if schema is None else schema.name
            topics[f"{channel.topic} ({channel.message_encoding})"] = None
            if channel.message_encoding == "json" or name in schemas:
                data = b"" if schema is None else schema.data
                encoding, time = channel.message_encoding, message.log_time
                messages.append(Message(channel.topic, encoding, name, data, time, message.data))
        metadata = {m.name: dict(m.metadata) for m in reader.iter_metadata()}
        if wanted is not None and summary is not None and summary.statistics is not None:
            counts = summary.statistics.channel_message_counts
            stated = sum(counts.get(i, 0) for i, c in summary.channels.items() if c.topic in wanted)
            if stated != counted:
                raise InputError(
                    f"the MCAP file is damaged: {counted} messages, {stated} were written", path
                )
    return McapFile(messages, metadata, list(topics))


@contextmanager
def _damage(path: Path) -> Iterator[None]:
    """What the mcap package and its decompressors raise for damaged files, as InputError."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    try:
        yield
    except (
        McapError,
        ZstdError,
        ValueError,  # CRCs and texts that are not UTF-8
        RuntimeError,  # lz4
        KeyError,
        IndexError,
        EOFError,
        OSError,
        OverflowError,
        MemoryError,
        struct.error,
        zlib.error,
    ) as error:
        detail = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"the MCAP file is damaged or cut short ({type(error).__name__}: {detail[:100]});"
            " 'handtrack recover' makes a whole one of a recording of handtrack",
            path,
        ) from None
