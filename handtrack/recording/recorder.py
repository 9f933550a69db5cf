"""Recordings written as they happen."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from numpy.typing import ArrayLike

from handtrack.errors import HandtrackError, SettingsError
from handtrack.files.whole import PartFile
from handtrack.hand.model import HandModel
from handtrack.mcap.hand import Event, Head
from handtrack.recording.hand_slot import FrameBuffer, Slot, no_frames
from handtrack.recording.settings import MeshChoice, RecordingSettings
from handtrack.recording.write import CHUNK_BYTES, HandWriter, RecordingWriter
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.track import Part

KEPT_NS = 1_000_000_000
"""So much time may at most wait in memory, recorded or real [ns]."""
_STATE_BYTES, _VERTEX_BYTES, _SCENE_BYTES = 3600, 12, 53


class McapRecorder:
    """An MCAP file that is written while frames come, in bounded memory.

    Until it is complete the file is named NAME.part; `close` gives it its name. Whatever stops
    the writer, all but the last second can be read: `read_mcap` reads a part, `handtrack
    recover` makes a recording of it. A part can also be read while it grows.

        with McapRecorder("run.mcap", tracker.model, settings=tracker.settings) as recorder:
            for joints, time_ns in frames:
                recorder.write(tracker.step(joints, time_ns))

    A frame takes about 0.06 ms, with its skin 0.25 ms; on a busy machine NumPy's threads can make
    that ten times as long, which OPENBLAS_NUM_THREADS=1 prevents.

    If the block is left by an error the part is kept, with a warning that names it, unless it
    holds no frame.
    """

    def __init__(
        self,
        path: str | Path,
        model: HandModel | Sequence[HandModel] | None = None,
        *,
        names: Sequence[str] = (),
        hands: Sequence[tuple[str, str]] = (),
        settings: Mapping[str, Any] | None = None,
        source: str = "",
        subject: str = "",
        mesh: str | bool | MeshChoice = "full",
        compression: str = "lz4",
        foxglove_mesh: bool = False,
        recording: RecordingSettings | None = None,
        start_ns: int | None = None,
    ) -> None:
        """Args:
        path: the file to write.
        model: the hand that is tracked, or several hands. None if only whole stretches of
            tracks are recorded (`add`); then `hands` says which.
        names: of the hands; "hand" by default.
        hands: (name, side) of all hands, where there is no model.
        settings, source, subject: as in Track, the same for all hands.
        mesh, compression, foxglove_mesh, recording: as in `write_mcap`.
        start_ns: earliest time of all hands [ns]; needed only if times are negative and not
            those of the first frame that is given.

        Raises:
            InputError: the folder is missing, or the path is a folder.
            SettingsError: a setting makes no sense.
            HandtrackError: the file cannot be made.
        """
        models = [model] if isinstance(model, HandModel) else list(model or ())
        if bool(models) == bool(hands):
            raise SettingsError("a recorder needs hand models, or the hands' names and sides")
        names = list(names) or ["hand"] * len(models)
        if models and len(names) != len(models):
            raise SettingsError(f"{len(names)} names for {len(models)} hands")
        self._contents = RecordingSettings.of(mesh, compression, foxglove_mesh, recording)
        sides = list(hands) or [(n, m.hand) for n, m in zip(names, models, strict=True)]
        made = dict(settings or {})
        self._buffers = [
            FrameBuffer(Head.of(model, name, made, source=source, subject=subject))
            for name, model in zip(names, models, strict=bool(models))
        ]
        self._events: list[list[Event]] = [[] for _ in sides]
        self._hands, self._start_ns = sides, start_ns
        self._file = PartFile(Path(path))
        self._writer: RecordingWriter | None = None
        self._writers: dict[int, HandWriter] = {}
        self._since = time.monotonic()
        self._open, self._writing, self._failed = True, False, ""
        self._slots = [Slot(*side, sides) for side in sides]

    @property
    def path(self) -> Path:
        """Where the recording is in the end."""
        return self._file.path

    @property
    def part(self) -> Path:
        """Where it is until then."""
        return self._file.part

    @property
    def frames(self) -> int:
        """How many frames of all hands the file holds by now."""
        if self._writer is None:
            return 0
        counts = self._writer.stream.counts
        return sum(counts[writer.channel["state"]] for writer in self._writers.values())

    @property
    def closed(self) -> bool:
        """Whether nothing more can be recorded: after `close`, `stop` or a full disk."""
        return not self._open

    def write(
        self,
        frame: TrackedFrame,
        hand: int = 0,
        *,
        frame_index: int | None = None,
        truth: ArrayLike | None = None,
    ) -> None:
        """Record the next frame of a hand.

        Args:
            frame: what the tracker made of it.
            hand: which of the models it belongs to.
            frame_index: its number in the source; counted from 0 by default.
            truth: (21, 3) true joints [m]; with all frames of a hand or with none.

        Raises:
            InputError: the frame is of another hand, or truth has another shape or is missing.
            SettingsError: time does not increase, or the recorder is closed.
            HandtrackError: writing failed (a full disk).
        """
        self._check_open(hand)
        if not self._buffers:
            raise SettingsError("frames need a hand model: give it to the recorder")
        buffer = self._buffers[hand]
        buffer.add(frame, frame_index, truth)
        late = buffer.span_ns >= KEPT_NS * 0.9
        if late or len(buffer) * self._frame_bytes(buffer.model) >= CHUNK_BYTES:
            self._write_waiting(hand)
        if (time.monotonic() - self._since) * 1e9 >= KEPT_NS * 0.9:
            self.flush()

    def event(self, event: Event, hand: int = 0) -> None:
        """Record that something happened; it is written with the hand's next frame, or at last.

        Of a hand that never has a frame nothing is written.
        """
        self._check_open(hand)
        self._events[hand].append(event)

    def add(self, part: Part, hand: int = 0) -> None:
        """Record the next frames of a hand: a track, or a stretch of one.

        Raises:
            InputError: it is of another hand than those before it, or than the recorder's.
            SettingsError: time does not increase, or the recorder is closed.
            HandtrackError: writing failed (a full disk).
        """
        self._check_open(hand)
        self._slots[hand].check(part)
        with self._telling():
            writer, file = self._begun(part), self._file
            if hand not in self._writers:
                first = int(part.time_ns[0]) if len(part) else 0
                self._writers[hand] = writer.hand(hand, part.head, first)
            self._slots[hand].take(part)
            messages = self._writers[hand].messages(part)
            self._writers[hand].summary.add(part)
            writer.add(messages)
            writer.stream.flush()
            file.sync_soon()

    def flush(self) -> None:
        """Write all that waits, so that it can be read."""
        self._check_open()
        for hand in range(len(self._buffers)):
            self._write_waiting(hand)
        self._since = time.monotonic()

    def close(self) -> Path:
        """Complete the file and give it its name; does nothing if that was done.

        Returns:
            The file.

        Raises:
            HandtrackError: writing failed (a full disk), now or before, or something else has
                written the file meanwhile; the part stays.
        """
        if self._open:
            self.flush()
            self._last_events()
            with self._telling():
                self._begun(None).finish()
                # nothing more can come, whatever becomes of the name
                self._open = False
                self._file.complete()
        elif self._failed:
            raise HandtrackError(self._failed)
        return self.path

    def stop(self) -> None:
        """Leave the file as it is, under the name of a part; without a frame, delete it."""
        if not self._open:
            return
        if not self._writing:
            with suppress(HandtrackError):
                self.flush()
        self._open = False
        if self.frames:
            self._file.close()
            warnings.warn(
                f"{self.part} holds the {self._kept} that came;"
                " 'handtrack recover' makes a recording of it",
                stacklevel=2,
            )
        else:
            self._file.remove()

    def __enter__(self) -> McapRecorder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            try:
                self.close()
            finally:
                self.stop()
        else:
            self.stop()

    @property
    def _kept(self) -> str:
        return f"{self.frames:,} frame{'s' * (self.frames != 1)}"

    def _check_open(self, hand: int = 0) -> None:
        if not self._open:
            raise SettingsError(f"{self.path}: the recording is closed")
        if not 0 <= hand < len(self._slots):
            raise SettingsError(f"{self.path}: hand {hand} of {len(self._slots)}, from 0 on")

    def _last_events(self) -> None:
        """What was said of hands after their last frames."""
        for hand, (events, slot) in enumerate(zip(self._events, self._slots, strict=True)):
            if events and slot.head is not None:
                self.add(no_frames(slot.head, events), hand)
                self._events[hand] = []

    def _write_waiting(self, hand: int) -> None:
        if len(self._buffers[hand]):
            events, self._events[hand] = self._events[hand], []
            self.add(self._buffers[hand].take(events), hand)

    def _frame_bytes(self, model: HandModel) -> int:
        every = self._contents.mesh.every
        if not every:
            return _STATE_BYTES
        each = _VERTEX_BYTES + _SCENE_BYTES * self._contents.foxglove_mesh
        return _STATE_BYTES + each * len(model.rest_vertices) // every

    def _begun(self, part: Part | None) -> RecordingWriter:
        if self._writer is None:
            first = self._start_ns
            if first is None:
                first = int(part.time_ns[0]) if part is not None and len(part) else 0
            self._writer = RecordingWriter(self._file.stream, self._hands, first, self._contents)
        return self._writer

    @contextmanager
    def _telling(self) -> Iterator[None]:
        """What the disk says, as our error; nothing is written after one."""
        self._writing = True
        try:
            yield
        except HandtrackError:
            self._writing = False
            raise
        except OSError as error:
            self._open = False
            self._failed = f"{self.path}: cannot be written: {error.strerror or error}"
            if not self.frames:
                self._file.remove()
                raise HandtrackError(self._failed) from error
            self._file.close()
            self._failed += (
                f"; {self.part} holds the {self._kept} until then,"
                " 'handtrack recover' makes a recording of it"
            )
            raise HandtrackError(self._failed) from error
        self._writing = False
