"""A whole data set, from its manifest to its table."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

from handtrack.batching.clip import Clip
from handtrack.batching.cluster import engine
from handtrack.batching.engine import Died, Engine, EngineError
from handtrack.batching.journal import compact, compacted_as_far_as_possible, earlier
from handtrack.batching.lock import only_run
from handtrack.batching.manifest import clips_of, clips_of_table
from handtrack.batching.outputs import FRAMES, RECORDINGS, keep_settings
from handtrack.batching.plan import Plan, Planned, Portions, parts_of, plan, task_of
from handtrack.batching.pool import Found, Pool, find_hands, known, pools
from handtrack.batching.progress import Progress
from handtrack.batching.rows import FAILED, row_without
from handtrack.batching.settings import BatchSettings
from handtrack.batching.store import Store, StoreError
from handtrack.batching.warm import warm_up
from handtrack.batching.work import Done, Task, do_task, write_journal
from handtrack.errors import HandtrackError
from handtrack.tracking.settings import TrackSettings

if TYPE_CHECKING:
    import pyarrow


_FEW = 8
"""Clips of workers that died that are tried one after another; more of them first side by side."""
GO_ON = "what is done is kept, the same command goes on from there"


class Outcome(NamedTuple):
    """What came of a run.

    Attributes:
        table: of all clips asked for.
        tracked, skipped: clips that were gone through, failed ones too, and that had been before.
        frames: of those tracked.
        seconds: that it took.
        failed: (path, why) of clips that failed, now or before.
        notes: what the user should know.
    """

    table: pyarrow.Table
    tracked: int
    skipped: int
    frames: int
    seconds: float
    failed: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]


class Where(NamedTuple):
    """What runs the work: see `handtrack.batching.cluster.engine`."""

    client: Any = None
    scheduler: str | None = None
    workers: int | None = None
    processes: bool = True


def batch(
    manifest: str | PathLike[str] | Sequence[Any] | pyarrow.Table,
    out: str | PathLike[str],
    client: Any = None,
    settings: BatchSettings | TrackSettings | Mapping[str, Any] | None = None,
    *,
    subject: str | None = None,
    columns: Sequence[str] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    progress: Progress | None = None,
) -> pyarrow.Table:
    """Track a whole data set; what has been done by the same settings is not done again.

    Args:
        manifest: folders, files, archives, globs or URLs, or a manifest: a .csv or .parquet
            file, a table, or one mapping for each clip, with `path` and perhaps `name`, `hand`,
            `subject`, `fps`, `unit`, `order`, `start`, `end` [s] and `truth`.
        out: folder or URL of the results: `clips.parquet`, `settings.json`, `recordings/`,
            `hands/`, `frames/`.
        client: of Dask's; by default a cluster of this machine's cores is made for the call.
        settings: how each clip is tracked, or `BatchSettings` that say too what is written.
        subject: regular expression that finds the subject in a path.
        columns: the manifest's columns that are the user's own, for reports by them.
        workers: processes of this machine, one for each core by default.
        scheduler: address of a scheduler to be used instead.
        retry_failed: try clips again whose own fault it was.
        progress: told how far it is.

    Returns:
        A row for each clip and hand, see `handtrack.batching.rows`; a clip that failed is a row
        with its `error`.

    Raises:
        InputError: the manifest is not as expected, or names what is not there.
        SettingsError: a setting cannot be used, no scheduler answers, another run is writing to
            `out`, or a worker has another version.
        HandtrackError: the results cannot be written, or the scheduler is gone; what was done
            is kept.
    """
    clips = clips_from(manifest, subject, columns)
    where = Where(client, scheduler, workers)
    done = run(clips, str(out), BatchSettings.of(settings), where, retry_failed, progress)
    return done.table


def clips_from(
    manifest: str | PathLike[str] | Sequence[Any] | pyarrow.Table,
    subject: str | None = None,
    columns: Sequence[str] = (),
) -> list[Clip]:
    """The clips of a manifest in any of its forms; arguments and errors as `batch`."""
    if isinstance(manifest, str | PathLike):
        return clips_of([str(manifest)], subject, columns)
    if hasattr(manifest, "to_pylist"):
        return clips_of_table(manifest, subject, columns)
    rows: Iterable[Any] = manifest.to_dict("records") if hasattr(manifest, "to_dict") else manifest
    rows = list(rows)
    if rows and isinstance(rows[0], Mapping):
        return clips_of_table(rows, subject, columns)
    return clips_of([str(place) for place in rows], subject, columns)


def run(
    clips: Sequence[Clip],
    out: str,
    settings: BatchSettings,
    where: Where = Where(),  # noqa: B008
    again: bool = False,
    progress: Progress | None = None,
) -> Outcome:
    """Track the clips; arguments and errors as `batch`."""
    start = time.monotonic()
    watch = progress or Progress()
    store = Store(out)
    store.make()
    with only_run(store):
        store.sweep()
        compact(store)
        keep_settings(store, settings)
        state, complete = _Run(store, settings, watch), False
        try:
            with ExitStack() as stack:
                state.track(clips, where, again, stack)
            complete = True
        except EngineError as error:
            raise EngineError(f"{error}; {GO_ON}") from error
        except StoreError as error:
            raise StoreError(f"{error}; {GO_ON}") from error
        finally:
            if not complete:
                compacted_as_far_as_possible(store)
        table = compact(store)
    return state.outcome(clips, table, time.monotonic() - start)


def preview(clips: Sequence[Clip], out: str, settings: BatchSettings, again: bool) -> Plan:
    """What `run` would do, as far as it is known before subjects' hands are found.

    Clips of a subject whose hand is still to be found are all to be done.
    """
    store = Store(out)
    if not store.exists():
        return Plan([Planned(clip, "", {}) for clip in clips], 0, [])
    state = _Run(store, settings, Progress())
    state.known_hands(clips)
    return state.plan(clips, again)


class _Run:
    def __init__(self, store: Store, settings: BatchSettings, watch: Progress) -> None:
        self._store, self._settings, self._watch = store, settings, watch
        self._subjects: dict[str, Found] = {}
        self._frames = self._tracked = self._skipped = 0
        self._failed: list[tuple[str, str]] = []
        self._notes: list[str] = []

    def known_hands(self, clips: Sequence[Clip]) -> list[Pool]:
        """Take the subjects' hands that are there; the pools of the others."""
        if not self._settings.pool:
            return []
        missing = []
        for pool in pools(clips, self._settings):
            found = known(self._store, pool)
            if found is None:
                missing.append(pool)
            else:
                self._subjects[pool.subject] = found
        return missing

    def plan(self, clips: Sequence[Clip], again: bool) -> Plan:
        from handtrack.batching.journal import read_table

        table = read_table(self._store)
        errors: dict[str, str] = {}
        if table is not None:
            pairs = zip(table["clip"].to_pylist(), table["error"].to_pylist(), strict=True)
            errors = {clip: error for clip, error in pairs if error}
        there = None
        if self._settings.recordings or self._settings.frames:
            there = {n for f in (RECORDINGS, FRAMES) for n in self._store.names(f)}
        return plan(clips, self._settings, self._subjects, earlier(table), there, errors, again)

    def track(self, clips: Sequence[Clip], where: Where, again: bool, stack: ExitStack) -> None:
        """Both stages."""
        missing = self.known_hands(clips)
        made: Engine | None = None
        if missing:
            made = self._engine(where, stack)
            self._find(made, missing)
        for found in self._subjects.values():
            self._notes += found.notes
        planned = self.plan(clips, again)
        self._skipped = planned.done
        self._failed += planned.failed
        if planned.todo:
            self._track(made or self._engine(where, stack), planned.todo)

    def _engine(self, where: Where, stack: ExitStack) -> Engine:
        self._watch.prepare("starting workers")
        processes = where.processes and not self._store.place.startswith("memory://")
        made = stack.enter_context(engine(where.client, where.scheduler, where.workers, processes))
        self._watch.dashboard = made.dashboard
        self._watch.prepare("loading machine code (compiled once on each machine, about 60 s)")
        made.warm_up(warm_up, self._settings, tick=self._watch.show)
        return made

    def _find(self, made: Engine, missing: list[Pool]) -> None:
        self._watch.begin("subjects' hands", len(missing))
        suspects = self._find_once(made, missing)
        waiting = self._find_once(made, suspects, most=1)
        for pool in waiting:
            self._notes.append(
                f"no pooled hand of {pool.subject}: a worker died twice on its clips"
            )

    def _find_once(self, made: Engine, some: list[Pool], most: int | None = None) -> list[Pool]:
        """Find the hands of some subjects; those that a worker died of."""
        waiting, died = list(reversed(some)), []
        results = made.results(
            find_hands,
            lambda: waiting.pop() if waiting else None,
            (self._store.place, self._settings),
            most,
            self._watch.show,
        )
        for pool, found in results:
            if isinstance(found, Died):
                died.append(pool)
                continue
            self._subjects[pool.subject] = found
            self._watch.add(1, 0, 0)
        return died

    def _track(self, made: Engine, todo: list[Planned]) -> None:
        self._watch.begin("clips", len(todo))
        portions = Portions(todo, made.workers)
        arguments = (self._store.place, self._settings)
        suspects: list[Planned] = []
        show = self._watch.show
        for task, done in made.results(do_task, portions.next, arguments, None, show):
            if isinstance(done, Died):
                suspects += parts_of(task)
            else:
                portions.took(done.clips, done.seconds)
                self._done(done)
        if not suspects:
            return
        self._watch.says(f"a worker died: {len(suspects)} clips are tried once more")
        if len(suspects) > _FEW:
            suspects = self._once_more(made, suspects, max(1, made.workers // 2))
        for planned in self._once_more(made, suspects, 1):
            self._gave_up(task_of([planned]))

    def _once_more(self, made: Engine, suspects: list[Planned], most: int) -> list[Planned]:
        """Clips that were at a worker that died, each by itself; those that it dies of again."""
        waiting = deque(suspects)
        died: list[Planned] = []
        results = made.results(
            do_task,
            lambda: task_of([waiting.popleft()]) if waiting else None,
            (self._store.place, self._settings),
            most,
            self._watch.show,
        )
        for task, done in results:
            if isinstance(done, Died):
                died += parts_of(task)
            else:
                self._done(done)
        return died

    def _done(self, done: Done) -> None:
        self._tracked += done.clips
        self._frames += done.frames
        self._failed += done.failed
        self._watch.add(done.clips, done.frames, len(done.failed))

    def _gave_up(self, task: Task) -> None:
        """A clip that took its worker with it, twice."""
        said = "the worker died twice on it (killed, out of memory or crashed)"
        rows = []
        for clip, digest in zip(task.clips, task.digests, strict=True):
            of_settings, _, of_task = digest.partition("-")
            extra: dict[str, Any] = {"settings_digest": of_settings, "task_digest": of_task}
            extra |= {"finished": time.time()}
            rows.append(row_without(clip, FAILED, said, "worker", extra))
        name = write_journal(self._store, rows)
        failed = tuple((clip.path, said) for clip in task.clips)
        self._done(Done(len(rows), 0, failed, 0.0, name))

    def outcome(
        self, clips: Sequence[Clip], table: pyarrow.Table | None, seconds: float
    ) -> Outcome:
        """What came of it."""
        import pyarrow as pa
        import pyarrow.compute as pc

        if table is None:
            raise HandtrackError(f"{self._store.place}: nothing was tracked")
        mine = pa.array([clip.name for clip in clips], pa.string())
        table = table.filter(pc.is_in(table["clip"], mine))
        return Outcome(
            table,
            self._tracked,
            self._skipped,
            self._frames,
            seconds,
            tuple(self._failed),
            tuple(self._notes),
        )


__all__ = ["EngineError", "Outcome", "Where", "batch", "clips_from", "preview", "run"]
