"""handtrack batch."""

from __future__ import annotations

import json
import shutil
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.batching.progress import Progress, duration
from handtrack.cli.config import used_config
from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading
from handtrack.cli.models import hand_model_option, model_options, take_models
from handtrack.cli.options import (
    is_default,
    json_option,
    quiet_option,
    reading_options,
    recording_options,
    take_recording,
    take_tracking,
    tracking_options,
)
from handtrack.cli.pictures import no_picture_option
from handtrack.errors import HandtrackError, SettingsError

if TYPE_CHECKING:
    from handtrack.batching.clip import Clip
    from handtrack.batching.run import Outcome
    from handtrack.batching.settings import BatchSettings

_LOG_S = 60.0
"""In a log a line so often."""
_SCREEN_S = 0.2
_SHOWN = 10
"""Failures that are printed; the table has all."""


@click.command(cls=Command, short_help="Track a whole data set, on all cores or on a cluster.")
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT...")
@click.option("-o", "--output", required=True, metavar="OUT", help="Folder or URL of the results.")
@click.option(
    "--subject", metavar="REGEX", help="Where in a path the subject stands: the first group."
)
@click.option(
    "--no-pool",
    is_flag=True,
    help="Each clip calibrates itself, also of known subjects.",
)
@click.option(
    "--column", "own_columns", multiple=True, metavar="NAME", help="A column of your own to keep."
)
@click.option("--no-recordings", is_flag=True, help="Numbers only.")
@click.option("--frames", is_flag=True, help="A table of all frames too, in frames/.")
@click.option(
    "--export",
    "exports",
    multiple=True,
    metavar="csv|parquet|npz|mano",
    help="Write each clip in this form too; may be given several times.",
)
@click.option(
    "--workers", type=click.IntRange(1), metavar="N", help="Processes; one for each core."
)
@click.option(
    "--scheduler", metavar="ADDRESS", help="A Dask scheduler to use instead: tcp://HOST:PORT."
)
@click.option("--dry-run", is_flag=True, help="Say what would be done, and how much.")
@click.option(
    "--retry-failed", is_flag=True, help="Try clips again that failed by their own fault too."
)
@no_picture_option
@click.option("--no-repair", is_flag=True, help="Leave hands exchanged for a moment exchanged.")
@model_options
@hand_model_option
@tracking_options
@partial(recording_options, mesh="none")
@json_option
@quiet_option
@partial(reading_options, frames=False)
def batch(
    inputs: tuple[str, ...],
    output: str,
    subject: str | None,
    no_pool: bool,
    own_columns: tuple[str, ...],
    no_recordings: bool,
    frames: bool,
    exports: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
    dry_run: bool,
    retry_failed: bool,
    no_repair: bool,
    as_json: bool,
    quiet: bool,
    no_picture: bool,
    **options: Any,
) -> None:
    """Track a whole data set: every clip of many subjects, on all cores or on a cluster.

    INPUT is a folder, a glob, an archive, a file, a URL (s3://, gs://), or a manifest: a .csv or
    .parquet file with a column `path`, and perhaps name, hand, subject, fps, unit, order, start,
    end (seconds) and truth. OUT gets clips.parquet with a row for each clip and hand,
    settings.json, recordings/ and hands/ with each subject's hand, found in several of its clips.

    The same command goes on where a run was stopped, and does again what other settings or other
    files ask for. A clip that fails is a row with its error. `handtrack stability OUT` reports.
    """
    from handtrack.batching.run import GO_ON, Where, run
    from handtrack.batching.settings import BatchSettings

    (tracking, limits), recording = take_tracking(options), take_recording(options)
    tracking = tracking.but(picture=not no_picture)
    mano = {name: options[name] for name in ("mano", "mano_tips")}
    models = take_models(options, limits)
    if models.file is not None and is_default("calibrate"):
        tracking = tracking.but(calibrate="none")
    if scheduler is not None and workers is not None:
        raise SettingsError("--workers is for this machine's own, not for a --scheduler")
    found = tracking.calibration.by
    settings = BatchSettings(
        tracking,
        models,
        _reading(Reading(**options, **mano)),
        repair=not no_repair,
        pool=not no_pool and found != "none" and mano["mano"] is None,
        recordings=not no_recordings,
        recording=recording,
        frames=frames,
        exports=tuple(dict.fromkeys(kind for given in exports for kind in given.split(","))),
        config=used_config(),
    )
    from handtrack.batching.manifest import clips_of

    clips = clips_of(inputs, subject, own_columns)
    if dry_run:
        _say_plan(clips, output, settings, retry_failed, as_json)
        return
    watch = Progress() if quiet else _Shown()
    where = Where(None, scheduler, workers)
    try:
        outcome = run(clips, output, settings, where, retry_failed, watch)
    except (KeyboardInterrupt, SystemExit):
        if not quiet:
            watch.says(GO_ON)
        raise
    watch.end()
    _say(outcome, output, as_json, quiet)
    if outcome.failed:
        click.get_current_context().exit(1)


def _reading(reading: Reading) -> dict[str, Any]:
    """The options of `handtrack.load` that are not at their defaults."""
    given = reading._asdict() | {"hand": None if reading.hand == "auto" else reading.hand}
    del given["frames"]
    if reading.mano is None:
        del given["mano_tips"]
    return {
        name: str(value) if isinstance(value, Path) else value
        for name, value in given.items()
        if value is not None
    }


class _Shown(Progress):
    """Progress on stderr: one line that changes at a terminal, one a minute in a log."""

    _next = 0.0
    _stage = ""
    _width = 0

    def show(self) -> None:
        screen, now = sys.stderr.isatty(), time.monotonic()
        if self.doing != self._stage:
            self._stage = self.doing
            self._next = now if screen else now + _LOG_S
        if now < self._next:
            return
        self._next = now + (_SCREEN_S if screen else _LOG_S)
        if screen:
            line = self.line(shutil.get_terminal_size().columns - 1)
            click.echo(f"\r{line.ljust(self._width)}", nl=False, err=True)
            self._width = len(line)
        else:
            click.echo(self.line(), err=True)

    def begin(self, doing: str, clips: int) -> None:
        if self.dashboard and not self._stage.startswith(("subjects", "clips")):
            self.says(f"dashboard: {self.dashboard}")
        super().begin(doing, clips)

    def says(self, text: str) -> None:
        self.end()
        click.echo(text, err=True)

    def end(self) -> None:
        if self._width:
            click.echo(f"\r{' ' * self._width}\r", nl=False, err=True)
            self._width = 0


def _say_plan(
    clips: list[Clip], output: str, settings: BatchSettings, again: bool, as_json: bool
) -> None:
    from handtrack.batching.run import preview

    planned = preview(clips, output, settings, again)
    subjects = sorted({clip.subject for clip in clips if clip.subject})
    size = sum(planned_clip.clip.size for planned_clip in planned.todo)
    if as_json:
        said = {
            "clips": len(clips),
            "todo": [planned_clip.clip.path for planned_clip in planned.todo],
            "done": planned.done,
            "subjects": subjects,
            "bytes": size,
            "settings": settings.told(),
        }
        click.echo(json.dumps(said, indent=2))
        return
    click.echo(
        f"{len(clips):,} clips of {len(subjects) or 'unknown'} subjects: {len(planned.todo):,} to"
        f" track ({_bytes(size)}), {planned.done:,} done before -> {output}"
    )
    for planned_clip in planned.todo[:_SHOWN]:
        clip = planned_clip.clip
        whose = f" of {clip.subject}" if clip.subject else ""
        click.echo(f"  {clip.path}{whose} -> {clip.name}")
    if len(planned.todo) > _SHOWN:
        click.echo(f"  and {len(planned.todo) - _SHOWN:,} more")


def _bytes(size: int) -> str:
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.1f} {unit}"
    return f"{size} bytes"


def _say(outcome: Outcome, output: str, as_json: bool, quiet: bool) -> None:
    """Print what came of it.

    Raises:
        HandtrackError: no file holds joints of a hand.
    """
    from handtrack.batching.rows import PASSED

    rows = outcome.table.select(["clip", "state", "error"]).to_pylist()
    passed = {row["clip"]: row["error"] for row in rows if row["state"] == PASSED}
    if passed and all(row["state"] == PASSED for row in rows):
        others = f" (and {len(passed) - 1:,} more such files)" if len(passed) > 1 else ""
        raise HandtrackError(f"nothing could be tracked: {next(iter(passed.values()))}{others}")
    if as_json:
        said = {
            "output": output,
            "rows": outcome.table.num_rows,
            "tracked": outcome.tracked,
            "skipped": outcome.skipped,
            "passed_over": len(passed),
            "frames": outcome.frames,
            "seconds": outcome.seconds,
            "failed": [{"path": path, "error": error} for path, error in outcome.failed],
            "warnings": list(outcome.notes),
        }
        click.echo(json.dumps(said, indent=2, allow_nan=False))
        return
    for note in outcome.notes if not quiet else ():
        click.echo(f"warning: {note}", err=True)
    for path, error in outcome.failed[:_SHOWN]:
        text = error if error.startswith(path) else f"{path}: {error}"
        click.echo(f"failed: {text}", err=True)
    if len(outcome.failed) > _SHOWN:
        more = len(outcome.failed) - _SHOWN
        click.echo(f"failed: and {more:,} more, see `error` in {output}/clips.parquet", err=True)
    if quiet:
        return
    rate = outcome.frames / max(outcome.seconds, 1e-3)
    without = f" {len(passed):,} hold no hand joints," if passed else ""
    click.echo(
        f"read {outcome.tracked:,} clips ({outcome.frames:,} frames at {rate:,.0f} frames/s)"
        f" in {duration(outcome.seconds)}, {outcome.skipped:,} were done before,{without}"
        f" {len(outcome.failed):,} failed -> {output}"
    )
