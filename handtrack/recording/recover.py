"""A clean recording of what can be read of a broken one."""

from __future__ import annotations

from pathlib import Path
from typing import IO, NamedTuple

from handtrack.errors import InputError
from handtrack.files.whole import whole_file
from handtrack.mcap.hands import HandDecoder, Hands
from handtrack.mcap.stream import McapStream
from handtrack.mcap.walk import Walk
from handtrack.recording.summary import SUMMARY, HandSummary, summary_record
from handtrack.recording.write import CHUNK_BYTES

_TAKEN = 4096
"""Frames that wait for the summary."""


class Recovered(NamedTuple):
    """What was recovered.

    Attributes:
        path: the new file.
        frames: frames of all hands.
        seconds: from the first frame to the last [s].
        note: what was wrong with the old file; empty if nothing was.
        lost_bytes: of the old file, from where it broke.
    """

    path: Path
    frames: int
    seconds: float
    note: str
    lost_bytes: int


def recover(source: str | Path, target: str | Path) -> Recovered:
    """Write a complete recording with every message of a broken one up to where it broke.

    Messages of all topics are copied as they are, in bounded memory.

    Args:
        source: the broken recording; it stays as it is.
        target: the file to write.

    Returns:
        How much was kept, and what was wrong.

    Raises:
        InputError: the source can't be read, is no recording, or no frame of it is whole; the
            target's folder is missing, or the target is the source.
        HandtrackError: writing failed.
    """
    source, target = Path(source), Path(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise InputError("is the file to recover: give the new one another name", target)
    walk = Walk(source)
    copy = _Copy(walk)
    with whole_file(target) as part, part.open("wb") as stream:
        try:
            copy.run(stream)
            note = walk.cut
        except InputError as error:
            if not copy.begun:
                raise
            # what was read until there is right: chunks have checksums
            note = str(error).removeprefix(f"{source}: ")
        seconds = copy.finish()
    lost = source.stat().st_size - walk.position if note else 0
    return Recovered(target, copy.frames, seconds, note, lost)


class _Copy:
    """Copies messages and metadata, and sums up the hands anew."""

    def __init__(self, walk: Walk) -> None:
        self._walk, self._hands = walk, Hands(walk)
        self._channels: dict[int, int] = {}
        self._schemas: dict[int, int] = {}
        self._metadata: set[str] = {SUMMARY}
        self._summaries: dict[str, HandSummary] = {}
        self._first, self._last = 2**64, 0
        self.frames, self.begun = 0, False

    def run(self, stream: IO[bytes]) -> None:
        """Copy up to the end, or to where the file is broken.

        Raises:
            InputError: the file is broken there.
        """
        probe = Walk(self._walk.path)
        next(probe.messages(lambda channel: True), None)
        self._writer = McapStream(stream, probe.compression or "none", CHUNK_BYTES)
        for found in self._walk.messages(lambda channel: True):
            self.begun = True
            self._copy_metadata()
            channel = self._channel(found.channel)
            self._hands.add(found)
            self._writer.message(channel, found.time, found.sequence, found.data)
            for hand in self._hands.all:
                if hand.here >= _TAKEN:
                    self._sum_up(hand)
        self._copy_metadata()

    def _copy_metadata(self) -> None:
        for name in [name for name in self._walk.metadata if name not in self._metadata]:
            self._writer.metadata(name, self._walk.metadata[name])
            self._metadata.add(name)

    def _channel(self, number: int) -> int:
        if number not in self._channels:
            channel = self._walk.channels[number]
            schema = self._walk.definitions[channel.schema_id]
            if schema.id not in self._schemas:
                new = self._writer.schema(schema.name, schema.encoding, schema.data)
                self._schemas[schema.id] = new
            self._channels[number] = self._writer.channel(
                channel.topic, channel.message_encoding, self._schemas[schema.id]
            )
        return self._channels[number]

    def _sum_up(self, hand: HandDecoder) -> None:
        part = hand.take()
        summary = self._summaries.setdefault(hand.topic.strip("/"), HandSummary(part.head))
        summary.add(part)
        self.frames += len(part)
        if len(part):
            self._first = min(self._first, int(part.time_ns[0]))
            self._last = max(self._last, int(part.time_ns[-1]))

    def finish(self) -> float:
        """Complete the new file.

        Returns:
            From the first frame to the last [s].

        Raises:
            InputError: it is no recording, or no frame is whole.
        """
        self._hands.check()
        for hand in self._hands.all:
            self._sum_up(hand)
        if not self.frames:
            raise InputError(
                f"{self._walk.cut or 'it is damaged'}, no frame is whole", self._walk.path
            )
        self._writer.flush()
        sizes = {
            self._walk.channels[old].topic: self._writer.bytes[new]
            for old, new in self._channels.items()
        }
        hands = {topic: summary.values() for topic, summary in self._summaries.items()}
        copied = {n: values for n, values in self._walk.metadata.items() if n != SUMMARY}
        self._writer.metadata(SUMMARY, summary_record(hands, sizes, copied))
        self._writer.finish()
        return (self._last - self._first) * 1e-9
