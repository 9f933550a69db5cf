"""Recordings written as they happen."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.files.growing import PartFile
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
from handtrack.recording.mesh_choice import MeshChoice
from handtrack.recording.write import CHUNK_BYTES, Choices, HandWriter, RecordingWriter
from handtrack.tracking.track import Event, Track
from handtrack.tracking.tracker import TrackedFrame, track_of_frames

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
        start_ns: int | None = None,
    ) -> None:
        """Args:
        path: the file to write.
        model: the hand that is tracked, or several hands. None if only whole stretches of
            tracks are recorded (`add`); then `hands` says which.
        names: of the hands; "hand" by default.
        hands: (name, side) of all hands, where there is no model.
        settings, source, subject: as in Track, the same for all hands.
        mesh, compression, foxglove_mesh: as in `write_mcap`.
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
        self._choices = Choices(MeshChoice.of(mesh), foxglove_mesh, compression)
        sides = list(hands) or [(n, m.hand) for n, m in zip(names, models, strict=True)]
        about = {"settings": dict(settings or {}), "source": source, "subject": subject}
        self._waiting = [
            _Waiting(models[i] if models else None, name, about)
            for i, (name, _) in enumerate(sides)
        ]
        self._hands, self._start_ns = sides, start_ns
        self._file = PartFile(Path(path))
        self._writer: RecordingWriter | None = None
        self._writers: dict[int, HandWriter] = {}
        self._since = time.monotonic()
        self._open, self._writing = True, False

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
            InputError: truth has another shape, or is missing.
            SettingsError: time does not increase, or the recorder is closed.
            HandtrackError: writing failed (a full disk).
        """
        self._check_open()
        self._waiting[hand].add(frame, frame_index, truth)
        waits = self._waiting[hand]
        late = frame.time_ns - waits.frames[0].time_ns >= KEPT_NS * 0.9
        if late or len(waits.frames) * self._frame_bytes(hand) >= CHUNK_BYTES:
            self._write_waiting(hand)
        if (time.monotonic() - self._since) * 1e9 >= KEPT_NS * 0.9:
            self.flush()

    def event(self, event: Event, hand: int = 0) -> None:
        """Record that something happened; it is written with the hand's next frame."""
        self._check_open()
        self._waiting[hand].events.append(event)

    def add(self, part: Track, hand: int = 0) -> None:
        """Record the next frames of a hand: a track, or a stretch of one.

        Raises:
            SettingsError: time does not increase, or the recorder is closed.
            HandtrackError: writing failed (a full disk).
        """
        self._check_open()
        with self._telling():
            writer, file = self._begun(part), self._file
            if hand not in self._writers:
                first = int(part.time_ns[0]) if len(part) else 0
                self._writers[hand] = writer.hand(hand, part, first)
            messages = self._writers[hand].messages(part)
            self._writers[hand].summary.add(part)
            writer.add(messages)
            writer.stream.flush()
            file.sync_soon()

    def flush(self) -> None:
        """Write all that waits, so that it can be read."""
        self._check_open()
        for hand in range(len(self._waiting)):
            self._write_waiting(hand)
        self._since = time.monotonic()

    def close(self) -> Path:
        """Complete the file and give it its name; does nothing if that was done.

        Returns:
            The file.

        Raises:
            HandtrackError: writing failed (a full disk); the part stays.
        """
        if self._open:
            self.flush()
            with self._telling():
                self._begun(None).finish()
                self._file.complete()
            self._open = False
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

    def _check_open(self) -> None:
        if not self._open:
            raise SettingsError(f"{self.path}: the recording is closed")

    def _write_waiting(self, hand: int) -> None:
        waits = self._waiting[hand]
        if waits.frames and waits.model is not None:
            self.add(waits.take(waits.model), hand)

    def _frame_bytes(self, hand: int) -> int:
        model, mesh = self._waiting[hand].model, self._choices.mesh
        if model is None or not mesh.every:
            return _STATE_BYTES
        each = _VERTEX_BYTES + _SCENE_BYTES * self._choices.foxglove_mesh
        return _STATE_BYTES + each * len(model.rest_vertices) // mesh.every

    def _begun(self, head: Track | None) -> RecordingWriter:
        if self._writer is None:
            first = self._start_ns
            if first is None:
                first = int(head.time_ns[0]) if head is not None and len(head) else 0
            self._writer = RecordingWriter(self._file.stream, self._hands, first, self._choices)
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
            failed = f"{self.path}: cannot be written: {error.strerror or error}"
            if not self.frames:
                self._file.remove()
                raise HandtrackError(failed) from error
            self._file.close()
            raise HandtrackError(
                f"{failed}; {self.part} holds the {self._kept} until then,"
                " 'handtrack recover' makes a recording of it"
            ) from error
        self._writing = False


class _Waiting:
    """Frames of a hand that are not written yet, and what does not change of it."""

    def __init__(self, model: HandModel | None, name: str, about: Mapping[str, Any]) -> None:
        self.model, self._name, self._about = model, name, about
        self.frames: list[TrackedFrame] = []
        self.events: list[Event] = []
        self._indexes: list[int] = []
        self._truth: list[Any] = []
        self._next = 0
        self._last_ns: int | None = None
        self._has_truth: bool | None = None

    def add(self, frame: TrackedFrame, index: int | None, truth: ArrayLike | None) -> None:
        if self.model is None:
            raise SettingsError("frames need a hand model: give it to the recorder")
        if self._last_ns is not None and frame.time_ns <= self._last_ns:
            raise SettingsError(f"time of {self._name} does not increase")
        if self._has_truth not in (None, truth is not None):
            raise InputError("true joints are given with all frames of a hand, or with none")
        if truth is not None:
            joints = np.array(truth, np.float64)
            if joints.shape != (N_JOINTS, 3):
                raise InputError(f"truth has shape {joints.shape}, expected (21, 3)")
            self._truth.append(joints)
        self._has_truth = truth is not None
        self.frames.append(frame)
        self._last_ns = frame.time_ns
        self._indexes.append(self._next if index is None else index)
        self._next = self._indexes[-1] + 1

    def take(self, model: HandModel) -> Track:
        """The frames as a track; none is left."""
        part = track_of_frames(
            self.frames,
            model,
            self._about["settings"],
            name=self._name,
            frame_index=self._indexes,
            truth=np.array(self._truth) if self._has_truth else None,
            source=self._about["source"],
            subject=self._about["subject"],
            events=self.events,
        )
        self.frames, self.events, self._indexes, self._truth = [], [], [], []
        return part
