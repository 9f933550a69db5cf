"""Tracks, and stretches of them, to the messages of an MCAP file.

What the files hold is said in `handtrack/mcap/handtrack.proto`.
"""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from handtrack import __version__
from handtrack.errors import SettingsError
from handtrack.files.whole import whole_file
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.mcap import foxglove
from handtrack.mcap.hand import Event, Head, encode_event, encode_hand, hand_topics, text
from handtrack.mcap.hands import METADATA
from handtrack.mcap.schema import JOINT_STATE_NAME, JOINT_STATE_ROS2, descriptor_set
from handtrack.mcap.state import encode_states
from handtrack.mcap.stream import McapStream
from handtrack.recording.settings import MeshChoice, RecordingSettings
from handtrack.recording.summary import SUMMARY, HandSummary, summary_record
from handtrack.tracking.events import log_lines
from handtrack.tracking.track import Part, Track

FORMAT_VERSION = "2"
BATCH = 128
"""Frames encoded at a time: bounds the memory that meshes take."""
CHUNK_BYTES = 224 * 1024
"""A chunk ends with the frame that fills it: mostly at 256 KiB."""

# subtopic -> schema
_TOPICS = {
    "model": "handtrack.Hand",
    "state": "handtrack.State",
    "event": "handtrack.Event",
    "observed": "foxglove.PointCloud",
    "fitted": "foxglove.PointCloud",
    "mesh": "foxglove.PointCloud",
    "skin": "foxglove.SceneUpdate",
    "transforms": "foxglove.FrameTransforms",
    "joint_states": JOINT_STATE_NAME,
    "log": "foxglove.Log",
}

Message = tuple[int, int, int, int, bytes]
"""log time, hand, sequence number, channel, data"""


def write_mcap(
    tracks: Track | Sequence[Track],
    path: str | Path,
    *,
    mesh: str | bool | MeshChoice = "full",
    compression: str = "lz4",
    foxglove_mesh: bool = False,
    recording: RecordingSettings | None = None,
) -> Path:
    """Write tracks (hands, people) of one recording to an MCAP file.

    The file takes its name only once it is complete, see `whole_file`; an existing one is
    replaced.

    Args:
        tracks: one track or several; they may have different times.
        path: the file to write.
        mesh: the skin's vertices, for viewers: "full" (float32; about 28 kB a frame),
            "quantised" (0.12 mm), "every N", "quantised,every N" or "none" (see `MeshChoice`).
            Reading back doesn't need them, unless the model is licensed.
        compression: "lz4", "zstd" or "none".
        foxglove_mesh: write the skin as `foxglove.SceneUpdate` too (about 125 kB a frame).
        recording: those three as a whole, in their place.

    Returns:
        The path written.

    Raises:
        InputError: the folder is missing, or the path is a folder.
        SettingsError: there is no track, a track's time does not increase, its settings are
            not plain JSON, or mesh or compression are unknown.
        HandtrackError: writing failed (a full disk, no permission).
    """
    contents = RecordingSettings.of(mesh, compression, foxglove_mesh, recording)
    tracks = [tracks] if isinstance(tracks, Track) else list(tracks)
    if not tracks:
        raise SettingsError("there is no track to write")
    path = Path(path)
    with whole_file(path) as part, part.open("wb") as stream:
        _write(stream, tracks, contents)
        stream.flush()
        os.fsync(stream.fileno())
    return path


def _write(stream: IO[bytes], tracks: Sequence[Track], contents: RecordingSettings) -> None:
    """Write a whole MCAP file to a stream, messages of all tracks in order of time.

    Raises:
        SettingsError: settings are not JSON, or a track's time does not increase.
    """
    starts = [int(t.time_ns[0]) for t in tracks if len(t)]
    first = min([*starts, *(e.time_ns for t in tracks for e in t.events)], default=0)
    writer = RecordingWriter(stream, [(t.name, t.hand) for t in tracks], first, contents)
    hands = [writer.hand(i, track.head, first) for i, track in enumerate(tracks)]
    writer.add([m for hand, track in zip(hands, tracks, strict=True) for m in hand.messages(track)])
    for hand, track in zip(hands, tracks, strict=True):
        hand.summary.add(track)
    writer.finish()


class RecordingWriter:
    """The messages of several hands, to one stream.

    Args:
        stream: where to write.
        hands: (name, side) of all hands that there may be.
        first_ns: earliest time in the recording [ns]; MCAP's times cannot be negative.
        contents: what goes in.
    """

    def __init__(
        self,
        stream: IO[bytes],
        hands: Sequence[tuple[str, str]],
        first_ns: int,
        contents: RecordingSettings,
    ) -> None:
        self.stream = McapStream(stream, contents.compression, CHUNK_BYTES)
        self.contents, self.offset = contents, min(first_ns, 0)
        self.topics = hand_topics(hands)
        self._schemas: dict[str, int] = {}
        self._names = dict(zip(self.topics, (text(name) for name, _ in hands), strict=True))
        self._hands: dict[str, HandWriter] = {}
        values = {
            "format_version": FORMAT_VERSION,
            "version": __version__,
            "time_offset_ns": str(self.offset),
            "hands": json.dumps(self._names),
            "mesh": str(contents.mesh),
        }
        self._metadata: dict[str, dict[str, str]] = {}
        self._record(METADATA, values)

    def hand(self, index: int, head: Head, first_ns: int) -> HandWriter:
        """Begin a hand with what does not change of it.

        Raises:
            SettingsError: its settings are not plain JSON values.
        """
        data = encode_hand(head)
        topic = self.topics[index]
        values = {
            "name": text(head.name),
            "hand": head.hand,
            "model": text(head.model.name),
            "limits": text(head.model.limits.name),
            "settings": json.dumps(dict(head.settings)),
            "version": text(head.version),
        }
        self._record(f"{METADATA}/{topic}", values)
        hand = HandWriter(self, index, topic, head)
        self._hands[topic] = hand
        self.stream.message(hand.channel["model"], max(first_ns - self.offset, 0), 0, data)
        return hand

    def _record(self, name: str, values: dict[str, str]) -> None:
        self._metadata[name] = values
        self.stream.metadata(name, values)

    def register(self, topic: str, schema: str) -> int:
        """The channel of a new topic."""
        ros2 = schema == JOINT_STATE_NAME
        if schema not in self._schemas:
            data = JOINT_STATE_ROS2.encode() if ros2 else descriptor_set(schema)
            encoding = "ros2msg" if ros2 else "protobuf"
            self._schemas[schema] = self.stream.schema(schema, encoding, data)
        return self.stream.channel(topic, "cdr" if ros2 else "protobuf", self._schemas[schema])

    def add(self, sources: Sequence[Iterator[Message]]) -> None:
        """Write messages, from sources that are each in order of time."""
        for time, _, sequence, channel, data in heapq.merge(*sources, key=lambda m: m[:2]):
            self.stream.message(channel, time, sequence & 0xFFFFFFFF, data)

    def finish(self) -> None:
        """Write what is left, the summary and the index."""
        self.stream.flush()
        hands = {topic: hand.summary.values() for topic, hand in self._hands.items()}
        sizes = {
            f"/{topic}/{name}": self.stream.bytes[channel]
            for topic, hand in self._hands.items()
            for name, channel in hand.channel.items()
        }
        self.stream.metadata(SUMMARY, summary_record(hands, sizes, self._metadata))
        self.stream.finish()


class HandWriter:
    """The channels of one hand, and its messages as they come, stretch by stretch."""

    def __init__(self, writer: RecordingWriter, index: int, topic: str, head: Head) -> None:
        self._index, self._topic, self._offset = index, topic, writer.offset
        self._mesh = writer.contents.mesh
        skin = bool(self._mesh.every) and head.n_vertices > 0
        scene = skin and writer.contents.foxglove_mesh
        wanted = {"mesh": skin, "skin": scene}
        self.channel = {
            name: writer.register(f"/{topic}/{name}", schema)
            for name, schema in _TOPICS.items()
            if wanted.get(name, True)
        }
        self._model = head.model
        self._transforms = foxglove.TransformEncoder(topic, head.model)
        self._scene = foxglove.SceneEncoder(topic, head.faces, head.n_vertices) if scene else None
        self.summary = HandSummary(head)
        self._frames = self._events = self._lines = 0
        self._before = ("fitted", "")
        self._last_ns: int | None = None

    def messages(self, part: Part) -> Sequence[Iterator[Message]]:
        """All of the next frames, each source in order of time.

        Raises:
            SettingsError: time does not increase, or is before the recording's first.
        """
        times = part.time_ns
        back = bool((times[1:] <= times[:-1]).any())
        if len(part) and self._last_ns is not None:
            back |= int(times[0]) <= self._last_ns
        if back:
            raise SettingsError(f"time of {part.name} does not increase")
        if len(part) and int(times[0]) < self._offset:
            raise SettingsError(
                f"time of {part.name} is negative and before the recording's first: give start_ns"
            )
        lines = log_lines(part, self._before)
        sources = (self._happened(part.events), self._log(lines), self._states(part, self._frames))
        self._frames += len(part)
        if len(part):
            self._last_ns = int(times[-1])
            self._before = (str(part.status[-1]), str(part.reason[-1]))
        return sources

    def _log_time(self, time_ns: int) -> int:
        # what is said of a time before the first stands at the first
        return max(time_ns - self._offset, 0)

    def _happened(self, events: Sequence[Event]) -> Iterator[Message]:
        first, self._events = self._events, self._events + len(events)
        return (
            (
                self._log_time(event.time_ns),
                self._index,
                first + i,
                self.channel["event"],
                encode_event(event),
            )
            for i, event in sorted(enumerate(events), key=lambda pair: pair[1].time_ns)
        )

    def _log(self, lines: Sequence[Event]) -> Iterator[Message]:
        first, self._lines = self._lines, self._lines + len(lines)
        for i, line in enumerate(lines, first):
            time = self._log_time(line.time_ns)
            data = foxglove.log_message(time, line.level, line.text, self._topic)
            yield time, self._index, i, self.channel["log"], data

    def _states(self, part: Part, first: int) -> Iterator[Message]:
        for start in range(0, len(part), BATCH):
            frames = slice(start, start + BATCH)
            # modulo 2^64, so right for every pair of int64
            times = part.time_ns[frames].astype(np.uint64) - np.uint64(self._offset % 2**64)
            columns: dict[str, Sequence[bytes | None]] = {
                "state": encode_states(part, frames, self._model),
                "observed": foxglove.cloud_messages(times, part.observed[frames]),
                "fitted": foxglove.cloud_messages(times, part.fitted_joints[frames]),
                "transforms": self._transforms.messages(times, part, frames),
                "joint_states": foxglove.joint_state_messages(times, part.angles[frames]),
            }
            if "mesh" in self.channel:
                columns |= self._skins(times, part, first, start)
            channels = [self.channel[name] for name in columns]
            for i, (time, *row) in enumerate(
                zip(times.tolist(), *columns.values(), strict=True), first + start
            ):
                for channel, data in zip(channels, row, strict=True):
                    if data is not None:
                        yield time, self._index, i, channel, data

    def _skins(
        self, times: foxglove.Times, part: Part, first: int, start: int
    ) -> dict[str, list[bytes | None]]:
        """The skin's messages of a batch; None for frames without."""
        picked = np.arange(-(first + start) % self._mesh.every, len(times), self._mesh.every)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            vertices = self._mesh.rounded(self._vertices(part, picked + start))
            made = {"mesh": foxglove.cloud_messages(times[picked], vertices)}
            if self._scene is not None:
                made["skin"] = self._scene.messages(times[picked], vertices)
        out: dict[str, list[bytes | None]] = {}
        for name, messages in made.items():
            out[name] = [None] * len(times)
            for i, data in zip(picked.tolist(), messages, strict=True):
                out[name][i] = data
        return out

    def _vertices(self, part: Part, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, V, 3) skin of some frames, as recorded or as the model has it."""
        if isinstance(part, Track):
            return part.vertices(frames)
        rotation = quaternion_to_matrix(part.quaternion[frames])
        return self._model.vertices(part.angles[frames], rotation, part.translation[frames])
