"""Tracks, and stretches of them, to the messages of an MCAP file.

What the files hold is said in `handtrack/mcap/handtrack.proto`.
"""

from __future__ import annotations

import heapq
import json
import os
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from handtrack import __version__
from handtrack.errors import SettingsError
from handtrack.files.long_arrays import blocks
from handtrack.files.whole import whole_file
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.mcap import foxglove
from handtrack.mcap.foxglove import PartSkinEncoder, robot_description
from handtrack.mcap.frames import Frames, Rows, Times
from handtrack.mcap.hand import Event, Head, encode_event, encode_hand, hand_topics, text
from handtrack.mcap.hands import METADATA
from handtrack.mcap.schema import HAND_SCHEMAS, ROS2_DEFINITIONS, descriptor_set
from handtrack.mcap.state import state_rows
from handtrack.mcap.stream import McapStream
from handtrack.recording.settings import MeshChoice, RecordingSettings
from handtrack.recording.summary import SUMMARY, HandSummary, summary_record
from handtrack.tracking.track import Part, Track, log_lines, tracks_of

FORMAT_VERSION = "2"
BATCH = 128
"""Frames encoded at a time: bounds the memory that meshes take."""
CHUNK_BYTES = 224 * 1024
"""A chunk ends with the frame that fills it: mostly at 256 KiB."""

Source = tuple[int, Iterator[Frames]]
"""A hand's number, and messages of it in order of time."""


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
        foxglove_mesh: write the skin as `foxglove.SceneUpdate` in every frame (about 125 kB
            each), where else its pieces, which are stiff, are written once.
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
    tracks = tracks_of(tracks)
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
    writer.add([s for hand, track in zip(hands, tracks, strict=True) for s in hand.messages(track)])
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
        begin = max(first_ns - self.offset, 0)
        self.stream.message(hand.channel["model"], begin, 0, data)
        drawn = robot_description(topic, head.model)
        self.stream.message(hand.channel["robot_description"], begin, 0, drawn)
        return hand

    def _record(self, name: str, values: dict[str, str]) -> None:
        self._metadata[name] = values
        self.stream.metadata(name, values)

    def register(self, topic: str, schema: str) -> int:
        """The channel of a new topic."""
        ros2 = ROS2_DEFINITIONS.get(schema)
        if schema not in self._schemas:
            data = ros2.encode() if ros2 else descriptor_set(schema)
            encoding = "ros2msg" if ros2 else "protobuf"
            self._schemas[schema] = self.stream.schema(schema, encoding, data)
        return self.stream.channel(topic, "cdr" if ros2 else "protobuf", self._schemas[schema])

    def add(self, sources: Sequence[Source]) -> None:
        """Write messages of sources that are each in order of time: by time, where times are equal
        by hand, and then in the order of the sources."""
        queue: list[tuple[int, int, int, int, Frames]] = []
        rest = [frames for _, frames in sources]

        def put(frames: Frames | None, begin: int, hand: int, source: int) -> None:
            if frames is not None and begin == len(frames):
                frames, begin = None, 0
            frames = next(rest[source], None) if frames is None else frames
            if frames is not None:
                heapq.heappush(queue, (frames.times[begin], hand, source, begin, frames))

        for source, (hand, _) in enumerate(sources):
            put(None, 0, hand, source)
        while queue:
            _, hand, source, begin, frames = heapq.heappop(queue)
            end = len(frames)
            if queue:
                # all that comes before the first of the other sources
                time, *other = queue[0][:3]
                before = bisect_right if [hand, source] < other else bisect_left
                end = before(frames.times, time, begin + 1, end)
            self.stream.frames(frames, begin, end)
            put(frames, end, hand, source)

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
        # of a licensed hand a file holds posed skins, not the one at rest
        pieces = skin and not scene and not head.model.licensed
        wanted = {"mesh": skin, "skin": scene or pieces}
        self.channel = {
            name: writer.register(f"/{topic}/{name}", schema)
            for name, schema in HAND_SCHEMAS.items()
            if wanted.get(name, True)
        }
        self._model = head.model
        self._transforms = foxglove.TransformEncoder(topic, head.model)
        self._scene = foxglove.SceneEncoder(topic, head.faces, head.n_vertices) if scene else None
        self._pieces = PartSkinEncoder(topic, head.model) if pieces else None
        self.summary = HandSummary(head)
        self._frames = self._events = self._lines = 0
        self._before = ("fitted", "")
        self._last_ns: int | None = None

    def messages(self, part: Part) -> list[Source]:
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
        sources = (
            self._happened(part.events),
            self._log(lines),
            self._skin(part, self._frames),
            self._states(part, self._frames),
        )
        self._frames += len(part)
        if len(part):
            self._last_ns = int(times[-1])
            self._before = (str(part.status[-1]), str(part.reason[-1]))
        return [(self._index, source) for source in sources]

    def _happened(self, events: Sequence[Event]) -> Iterator[Frames]:
        first, self._events = self._events, self._events + len(events)
        order = sorted(range(len(events)), key=lambda i: events[i].time_ns)
        data = [encode_event(events[i]) for i in order]
        times = [self._log_time(events[i].time_ns) for i in order]
        yield from self._said("event", times, [first + i for i in order], data)

    def _log(self, lines: Sequence[Event]) -> Iterator[Frames]:
        first, self._lines = self._lines, self._lines + len(lines)
        times = [self._log_time(line.time_ns) for line in lines]
        data = [
            foxglove.log_message(time, line.level, line.text, self._topic)
            for time, line in zip(times, lines, strict=True)
        ]
        yield from self._said("log", times, range(first, self._lines), data)

    def _skin(self, part: Part, first: int) -> Iterator[Frames]:
        """The skin's pieces, where the hand comes or goes."""
        if self._pieces is not None and len(part):
            posed = (part.angles, part.quaternion, part.translation)
            there = np.logical_and.reduce([np.isfinite(values).all(1) for values in posed])
            times = [self._log_time(time) for time in part.time_ns.tolist()]
            said = self._pieces.messages(times, there.tolist())
            numbers = [first + i for i in said]
            yield from self._said("skin", [times[i] for i in said], numbers, list(said.values()))

    def _log_time(self, time_ns: int) -> int:
        # what is said of a time before the first stands at the first
        return max(time_ns - self._offset, 0)

    def _said(
        self, name: str, times: list[int], numbers: Sequence[int], data: list[bytes]
    ) -> Iterator[Frames]:
        """Messages of one channel, if there are any."""
        if data:
            columns = {self.channel[name]: Rows.of(data)}
            yield Frames(np.array(times, np.uint64), np.array(numbers, np.uint64), columns)

    def _states(self, part: Part, first: int) -> Iterator[Frames]:
        for frames in blocks(len(part), BATCH):
            start = frames.start
            # modulo 2^64, so right for every pair of int64
            times = part.time_ns[frames].astype(np.uint64) - np.uint64(self._offset % 2**64)
            columns = {
                "state": state_rows(part, frames, self._model),
                "observed": foxglove.cloud_rows(times, part.observed[frames]),
                "fitted": foxglove.cloud_rows(times, part.fitted_joints[frames]),
                "transforms": self._transforms.rows(times, part, frames),
                "joint_states": foxglove.joint_state_rows(times, part.angles[frames]),
            }
            if "mesh" in self.channel:
                columns |= self._skins(times, part, first, start)
            by_channel = {self.channel[name]: rows for name, rows in columns.items()}
            numbers = np.arange(first + start, first + start + len(times), dtype=np.uint64)
            yield Frames(times, numbers, by_channel)

    def _skins(self, times: Times, part: Part, first: int, start: int) -> dict[str, Rows]:
        """The skin's messages of a batch; none for frames without."""
        picked = np.arange(-(first + start) % self._mesh.every, len(times), self._mesh.every)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            vertices = self._vertices(part, picked + start)
            if self._mesh.quantised:
                vertices = self._mesh.rounded(vertices)
            made = {"mesh": foxglove.cloud_rows(times[picked], vertices)}
            if self._scene is not None:
                made["skin"] = self._scene.rows(times[picked], vertices)
        return {name: rows.among(len(times), picked) for name, rows in made.items()}

    def _vertices(self, part: Part, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, V, 3) skin of some frames, as recorded or as the model has it."""
        if isinstance(part, Track):
            return part.vertices(frames)
        rotation = quaternion_to_matrix(part.quaternion[frames])
        return self._model.vertices(part.angles[frames], rotation, part.translation[frames])
