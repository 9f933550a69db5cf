"""Tracks to the messages of an MCAP file, in order of time."""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator, Sequence
from typing import IO

import numpy as np

from handtrack.errors import SettingsError
from handtrack.recording import encode
from handtrack.recording.log_lines import log_lines
from handtrack.recording.mcap_stream import McapStream
from handtrack.recording.schema import JOINT_STATE_NAME, JOINT_STATE_ROS2, descriptor_set
from handtrack.recording.topics import hand_topics
from handtrack.tracking.track import Track

FORMAT_VERSION = "1"
METADATA = "handtrack"
BATCH = 256
"""Frames encoded at a time: bounds the memory that meshes take."""
CHUNK_BYTES = 256 * 1024
COMPRESSIONS = ("lz4", "zstd", "none")

# subtopic -> schema; those of None need no schema of protobuf
_TOPICS = {
    "model": "handtrack.Hand",
    "state": "handtrack.State",
    "event": "handtrack.Event",
    "observed": "foxglove.PointCloud",
    "fitted": "foxglove.PointCloud",
    "mesh": "foxglove.PointCloud",
    "transforms": "foxglove.FrameTransforms",
    "joint_states": JOINT_STATE_NAME,
    "log": "foxglove.Log",
}

Message = tuple[int, int, int, int, bytes]
"""log time, hand, sequence number, channel, data"""


def write_messages(
    stream: IO[bytes], tracks: Sequence[Track], *, mesh: bool, compression: str
) -> None:
    """Write a whole MCAP file to a stream.

    Raises:
        SettingsError: compression is unknown, settings are not JSON, or a track's time does
            not increase.
    """
    if compression not in COMPRESSIONS:
        raise SettingsError(
            f"compression {compression!r} is unknown, expected one of {', '.join(COMPRESSIONS)}"
        )
    for track in tracks:
        if (track.time_ns[1:] <= track.time_ns[:-1]).any():
            raise SettingsError(f"time of {track.name} does not increase")
    starts = [int(t.time_ns[0]) for t in tracks if len(t)]
    first = min([*starts, *(e.time_ns for t in tracks for e in t.events)], default=0)
    # MCAP's times cannot be negative
    offset = min(first, 0)
    models = [encode.hand_message(track) for track in tracks]
    writer = McapStream(stream, compression, CHUNK_BYTES)
    topics = hand_topics((t.name, t.hand) for t in tracks)
    writer.metadata(METADATA, _metadata(tracks, topics, offset))
    schemas: dict[str, int] = {}
    hands = [
        _HandWriter(writer, schemas, i, topic, track, offset, mesh and _has_skin(track))
        for i, (topic, track) in enumerate(zip(topics, tracks, strict=True))
    ]
    for hand, model in zip(hands, models, strict=True):
        hand.write_model(first - offset, model)
    sources = [source for hand in hands for source in hand.sources()]
    for time, _, sequence, channel, data in heapq.merge(*sources, key=lambda m: m[:2]):
        writer.message(channel, time, sequence & 0xFFFFFFFF, data)
    writer.finish()


def _has_skin(track: Track) -> bool:
    return len(track.model.rest_vertices) > 0


def _metadata(tracks: Sequence[Track], topics: list[str], offset: int) -> dict[str, str]:
    def by_hand(values: Iterator[object]) -> str:
        return json.dumps(dict(zip(topics, values, strict=True)))

    return {
        "format_version": FORMAT_VERSION,
        "version": encode.text(", ".join(sorted({t.version for t in tracks}))),
        "time_offset_ns": str(offset),
        "hands": by_hand(t.name for t in tracks),
        "models": by_hand(t.model.name for t in tracks),
        "limits": by_hand(t.model.limits.name for t in tracks),
        "settings": by_hand(dict(t.settings) for t in tracks),
    }


class _HandWriter:
    """The channels of one hand, and its messages as they come."""

    def __init__(
        self,
        writer: McapStream,
        schemas: dict[str, int],
        index: int,
        topic: str,
        track: Track,
        offset: int,
        mesh: bool,
    ) -> None:
        self._writer, self._index, self._topic = writer, index, topic
        self._track, self._offset, self._mesh = track, offset, mesh
        self._channel = {
            name: self._register(schemas, f"/{topic}/{name}", schema)
            for name, schema in _TOPICS.items()
            if mesh or name != "mesh"
        }

    def _register(self, schemas: dict[str, int], topic: str, schema: str) -> int:
        ros2 = schema == JOINT_STATE_NAME
        if schema not in schemas:
            data = JOINT_STATE_ROS2.encode() if ros2 else descriptor_set(schema)
            encoding = "ros2msg" if ros2 else "protobuf"
            schemas[schema] = self._writer.schema(schema, encoding, data)
        message_encoding = "cdr" if ros2 else "protobuf"
        return self._writer.channel(topic, message_encoding, schemas[schema])

    def write_model(self, time: int, data: bytes) -> None:
        self._writer.message(self._channel["model"], time, 0, data)

    def sources(self) -> Sequence[Iterator[Message]]:
        """Everything but the model, each source in order of time."""
        return self._events(), self._lines(), self._frames()

    def _events(self) -> Iterator[Message]:
        numbered = enumerate(self._track.events)
        for i, event in sorted(numbered, key=lambda pair: pair[1].time_ns):
            time = event.time_ns - self._offset
            yield time, self._index, i, self._channel["event"], encode.event_message(event)

    def _lines(self) -> Iterator[Message]:
        for i, line in enumerate(log_lines(self._track)):
            time = line.time_ns - self._offset
            data = encode.log_message(time, line.level, line.text, self._topic)
            yield time, self._index, i, self._channel["log"], data

    def _frames(self) -> Iterator[Message]:
        track = self._track
        transforms = encode.TransformEncoder(self._topic, track.model)
        for start in range(0, len(track), BATCH):
            frames = slice(start, start + BATCH)
            # modulo 2^64, so right for every pair of int64
            times = track.time_ns[frames].astype(np.uint64) - np.uint64(self._offset % 2**64)
            columns: dict[str, Sequence[bytes | None]] = {
                "state": encode.state_messages(track, frames),
                "observed": encode.cloud_messages(times, track.observed[frames]),
                "fitted": encode.cloud_messages(times, track.fitted_joints[frames]),
                "transforms": transforms.messages(times, track, frames),
                "joint_states": encode.joint_state_messages(times, track.angles[frames]),
            }
            if self._mesh:
                with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                    columns["mesh"] = encode.cloud_messages(times, track.vertices(frames))
            channels = [self._channel[name] for name in columns]
            for i, (time, *row) in enumerate(
                zip(times.tolist(), *columns.values(), strict=True), start
            ):
                for channel, data in zip(channels, row, strict=True):
                    if data is not None:
                        yield time, self._index, i, channel, data
