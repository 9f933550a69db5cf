"""The work of `track`: each input is read, fitted, recorded and shown in its turn."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.config import used_config
from handtrack.cli.live_view import Live
from handtrack.cli.models import Models
from handtrack.cli.one_camera import say_of_picture
from handtrack.cli.options import is_default
from handtrack.cli.outputs import Job, recorder
from handtrack.cli.pictures import for_viewer
from handtrack.cli.progress import Progress, Times
from handtrack.cli.sources import Item, Skipped
from handtrack.errors import HandtrackError, NoHandError, SettingsError

if TYPE_CHECKING:
    from handtrack import McapRecorder, Sequence, Track
    from handtrack.cli.inputs import Reading
    from handtrack.hand.skeleton import Hand
    from handtrack.mcap.state import Stretch
    from handtrack.recording.settings import RecordingSettings
    from handtrack.tracking.settings import TrackSettings


@dataclass
class Made:
    """What came of the jobs.

    Attributes:
        tracks: in order.
        files: that were written.
        notes: what the user should know of inputs: doubts, hands that were left out.
        repairs: hands that were put back.
        skipped: inputs of which nothing came.
    """

    tracks: list[Track] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    repairs: list[str] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)


class Stretches:
    """Records the stretches of a track, from the first on that a hand is seen in.

    So a hand that is never seen leaves nothing. `told` stands among its settings.

    Attributes:
        seconds: time spent with recording [s].
    """

    def __init__(self, recorder: McapRecorder, hand: int, told: dict[str, Any]) -> None:
        self._recorder, self._hand, self._more = recorder, hand, told
        self._waiting: list[Stretch] = []
        self._seen = False
        self.seconds = 0.0

    def __call__(self, part: Stretch) -> None:
        start = time.perf_counter()
        self._seen = self._seen or bool((part.status != "lost").any())
        self._waiting.append(part)
        if self._seen:
            for waiting in self._waiting:
                self._recorder.add(self._told(waiting), self._hand)
            self._waiting = []
        self.seconds += time.perf_counter() - start

    def _told(self, part: Stretch) -> Stretch:
        """A stretch whose settings hold what else is to be told."""
        if not self._more:
            return part
        settings = {**part.head.settings, **self._more}
        return replace(part, head=replace(part.head, settings=settings))


@dataclass
class Work:
    """How each job is done.

    Attributes:
        reading, models, settings, recording: as the options say.
        show: where hands are shown while they are tracked.
        repair: put hands back that were exchanged.
        quiet, silent: print no warnings; print nothing.
        alone: whether there is one input, whose failure is the command's.
        times: what took the time; of fitting, what recording and showing took is not part.
        said: what was said once of all hands.
    """

    reading: Reading
    models: Models
    settings: TrackSettings
    recording: RecordingSettings
    show: Live
    repair: bool
    quiet: bool
    silent: bool
    alone: bool
    times: Times = field(default_factory=Times)
    said: set[str] = field(default_factory=set)

    def run(self, job: Job, progress: Progress, made: Made) -> None:
        """Track all that goes into one recording.

        Raises:
            HandtrackError: nothing came of the only input.
        """
        sequences = self._read(job, made)
        if not sequences:
            return
        settings = self.settings
        if not all(item.in_motion for item in job.items) and is_default("gate"):
            # from one picture to the next anything may change
            settings = settings.but(gate=False, coast_s=0.0)
        tracks: list[Track] = []
        with self.times.during("writing"), recorder(job.mcap, sequences, self.recording) as record:
            for i, sequence in enumerate(sequences):
                config = used_config()
                told: dict[str, Any] = {"config": config} if config else {}
                stretches = Stretches(record, i, told)
                shown = self.show.seconds
                try:
                    with self.times.during("fitting"):
                        track = self._track(sequence, settings, stretches, progress)
                    tracks.append(replace(track, settings={**track.settings, **told}))
                    if sequence.picture is not None and not self.silent:
                        say_of_picture(track, self.models.file is not None, self.said)
                except HandtrackError as error:
                    # a hand that is hardly seen must not take the others with it
                    last = not tracks and i == len(sequences) - 1
                    if (last and self.alone) or record.closed:
                        raise
                    made.notes.append(f"{sequence.name}: left out: {error}")
                self.times.move(stretches.seconds, "fitting", "writing")
                self.times.move(self.show.seconds - shown, "fitting", "showing")
                progress.next(len(sequence))
            if not tracks:
                record.stop()
        if not tracks:
            return
        if job.rrd is not None:
            with self.times.during("writing"):
                self._write_rrd(job.rrd, tracks, job.items, progress)
        made.tracks += tracks
        made.files += job.files

    def _read(self, job: Job, made: Made) -> list[Sequence]:
        """The sequences of a job, hands put back; what fails is skipped."""
        import handtrack as ht

        found: list[Sequence] = []
        for item in job.items:
            try:
                with self.times.during("detecting" if item.unread else "reading"):
                    sequences = item.read(self.reading, self.silent)
                    if self.repair and item.in_motion:
                        sequences = ht.repair_identity(sequences)
            except HandtrackError as error:
                if isinstance(error, NoHandError) and self.alone:
                    self._write_empty(job, item)
                if self.alone:
                    raise
                # a picture that lies in a folder may be of anything
                nothing = isinstance(error, NoHandError | SettingsError)
                bad = item.folder is None or not nothing
                made.skipped.append(Skipped.of(item.source, error, bad))
                continue
            found += sequences
        repairs = [f"{s.name}: {remark.text}" for s in found for remark in s.remarks]
        for repair in repairs if not self.quiet else ():
            click.echo(f"repaired: {repair}", err=True)
        made.repairs += repairs
        return found

    def _write_empty(self, job: Job, item: Item) -> None:
        """Pictures without a hand give a recording that is complete, and empty."""
        from handtrack import McapRecorder

        job.mcap.parent.mkdir(parents=True, exist_ok=True)
        hands: list[tuple[str, Hand]] = [(item.source.stem, "right")]
        source = str(item.source)
        McapRecorder(job.mcap, hands=hands, source=source, recording=self.recording).close()

    def _track(
        self,
        sequence: Sequence,
        settings: TrackSettings,
        stretches: Stretches,
        progress: Progress,
    ) -> Track:
        import handtrack as ht

        start = time.perf_counter()
        model, how = self.models.subject(sequence, settings.calibration.method)

        def done(frames: int) -> None:
            if frames == 0:  # the hand is known
                self.times.move(time.perf_counter() - start, "fitting", "calibrating")
            progress.frames(frames)

        track = ht.track(
            sequence,
            model,
            settings=settings.but(calibrate=how),
            progress=done,
            on_part=self.show.parts(sequence, stretches),
        )
        if (track.status == "lost").all():
            raise HandtrackError(f"{track.source}: no frame could be fitted: {track.reason[0]}")
        return track

    def _write_rrd(
        self, path: Path, tracks: list[Track], items: list[Item], progress: Progress
    ) -> None:
        import handtrack as ht

        progress.says(f"writing {path}")
        path.parent.mkdir(parents=True, exist_ok=True)
        # pictures of several inputs would be on one clock
        pictures = items[0].pictures if len(items) == 1 else []
        shown = for_viewer(tracks, pictures)
        ht.log_rerun(tracks, save=path, mesh=bool(self.recording.mesh.every), pictures=shown)
        progress.says("tracking")
