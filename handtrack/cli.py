"""The command line: arguments and printing only. Imports wait until a command needs them."""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack import __version__
from handtrack.cli_inputs import Reading, pairs, reading_options, recordings
from handtrack.cli_outputs import Job, check_target, jobs
from handtrack.cli_progress import Progress, compiling_said, progress_shown
from handtrack.errors import HandtrackError, InputError, ModelError, SettingsError

if TYPE_CHECKING:
    from handtrack import Track


def main() -> None:
    """Run the command line and exit: 0 done, 1 the job failed, 2 input or arguments are wrong."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status; what goes wrong is one line on stderr."""
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning  # type: ignore[assignment]
        try:
            return int(cli.main(arguments or ["--help"], "handtrack", standalone_mode=False) or 0)
        except click.ClickException as error:
            return _failed(error.format_message(), 2)
        except (InputError, SettingsError, ModelError) as error:
            return _failed(str(error), 2)
        except HandtrackError as error:
            return _failed(str(error), 1)
        except BrokenPipeError:
            # whoever read the output has seen enough; the interpreter's last flush must not fail
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
        except OSError as error:
            name = f"{error.filename}: " if error.filename else ""
            return _failed(f"{name}{error.strerror or error}", 1)
        except (click.Abort, KeyboardInterrupt):
            click.echo("stopped", err=True)
            return 1


def _failed(message: str, status: int) -> int:
    click.echo(f"error: {' '.join(message.split())}", err=True)
    return status


def _show_warning(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """What the library warns of, without the place in its code."""
    text = str(message) if category is UserWarning else f"{category.__name__}: {message}"
    click.echo(f"warning: {text}", err=True)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="handtrack")
def cli() -> None:
    """Track 3D hand joint sequences, replay them, and measure how steady they are."""


_json_option = click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
_no_mesh_option = click.option("--no-mesh", is_flag=True, help="Leave the skin out.")
_quiet_option = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")


@cli.command(short_help="Fit a hand to joint sequences and record it.")
@click.argument("input", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="MCAP file, or a folder.")
@click.option("--rrd", type=click.Path(path_type=Path), help="Rerun file, or a folder, as well.")
@click.option(
    "--limits",
    type=click.Choice(["anatomical", "li2021"]),
    default="anatomical",
    show_default=True,
    help="Joint limits: a wide anatomical set, or Table 1 of Li et al. 2021.",
)
@click.option(
    "--update",
    type=click.Choice(["exact", "li2021"]),
    default="exact",
    show_default=True,
    help="Block updates: the constrained minimiser, or the paper's.",
)
@click.option("--no-calibrate", is_flag=True, help="Only scale the hand, keep its proportions.")
@click.option(
    "--filter",
    "filter_",
    type=click.Choice(["none", "kalman"]),
    default="none",
    show_default=True,
    help="Steady the angles over time.",
)
@_no_mesh_option
@_json_option
@_quiet_option
@reading_options
def track(
    input: Path,
    output: Path | None,
    rrd: Path | None,
    limits: str,
    update: Any,
    no_calibrate: bool,
    filter_: str,
    no_mesh: bool,
    as_json: bool,
    quiet: bool,
    **reading: Any,
) -> None:
    """Fit a hand to every frame of a joint sequence and record the result.

    INPUT is a file or a folder: CMU Panoptic, .npz / .npy / .csv / .json / .jsonl, FPHA, Leap
    Motion, MCAP. Without -o the recording is recordings/NAME.mcap; of a folder with several
    unrelated files each gets its own, recordings/FOLDER/NAME.mcap. With -o FILE.mcap they
    share one.
    """
    import handtrack as ht

    sequences = Reading(**reading).load(input, quiet)
    work = jobs(sequences, input, output, rrd)
    settings = {"calibrate": not no_calibrate, "filter": filter_, "update": update}
    tracks: list[Track] = []
    left_out: list[str] = []
    seconds = 0.0
    written: list[Path] = []
    silent = quiet or as_json
    with (
        compiling_said(silent),
        progress_shown(sum(map(len, sequences)), silent) as progress,
    ):
        from handtrack.fitting.bcd import warm_up

        warm_up()
        if update != "exact":  # a solver that is loaded, or compiled, when it is asked for
            ht.fit(hand := ht.HandModel.default(), hand.rest_joints, update=update)
        for job in work:
            made = []
            for sequence in job.sequences:
                start = time.perf_counter()
                try:
                    model = ht.HandModel.default(sequence.hand, limits)
                    result = ht.track(sequence, model, progress=progress.frames, **settings)
                    _check_fitted(result)
                except HandtrackError as error:
                    # a hand that is hardly seen must not take the others with it
                    left_out.append(f"{sequence.name}: left out: {error}")
                    if len(left_out) == len(sequences):
                        raise
                else:
                    made.append(result)
                seconds += time.perf_counter() - start
                progress.next(len(sequence))
            if made:
                _write(made, job, not no_mesh, progress)
                tracks += made
                written += job.files
    for note in left_out if not quiet else ():
        click.echo(f"warning: {note}", err=True)

    frames = sum(map(len, tracks))
    report = ht.stability(tracks)
    if as_json:
        result_dict = report.to_dict() | {
            "outputs": [str(path) for path in written],
            "frames_per_second": frames / seconds,
            "warnings": [f"{s.name}: {note}" for s in sequences for note in s.notes] + left_out,
        }
        click.echo(json.dumps(result_dict, indent=2, allow_nan=False))
    elif not quiet:
        from handtrack.evaluation.report import print_table

        print_table(report)
        where = " and ".join(map(str, written))
        if len(work) > 1:
            folders = dict.fromkeys(str(path.parent) for path in written)
            where = f"{len(written)} files in {' and '.join(folders)}"
        click.echo(f"tracked {frames:,} frames at {frames / seconds:,.0f} frames/s -> {where}")


@cli.command(short_help="Show recordings in Rerun.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--save", type=click.Path(path_type=Path), help="Write a Rerun file instead.")
@click.option("--web", is_flag=True, help="Serve the browser viewer on 127.0.0.1.")
@click.option(
    "--port", type=click.IntRange(1, 65535), metavar="PORT", help="Port of the browser viewer."
)
@click.option("--no-open", is_flag=True, help="With --web, only print the address.")
@_no_mesh_option
@_quiet_option
def replay(
    files: tuple[Path, ...],
    save: Path | None,
    web: bool,
    port: int | None,
    no_open: bool,
    no_mesh: bool,
    quiet: bool,
) -> None:
    """Show recordings in Rerun: the hand, the observed joints, the angles and the errors.

    FILES are recordings written by `handtrack track`, or folders of them; several are shown in
    one world.
    """
    if save is not None:
        if web:
            raise SettingsError("--save writes a file and --web serves a page: choose one")
        check_target(save, ".rrd", "--save")
    if not web and (port is not None or no_open):
        raise SettingsError("--port and --no-open belong to --web")
    from handtrack.recording.replay import replay as show

    paths = recordings(files)
    if save is not None:
        save.parent.mkdir(parents=True, exist_ok=True)

    def say(address: str) -> None:
        click.echo(address if quiet else f"{address}\nCtrl-C stops the server.")

    show(paths, save=save, web=web, port=port, open_viewer=not no_open, mesh=not no_mesh, say=say)
    if save is not None and not quiet:
        click.echo(f"{', '.join(map(str, paths[:3]))}{' ...' * (len(paths) > 3)} -> {save}")


@cli.command(short_help="How accurate and how steady recordings are.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    help="True joints to measure against; FILES may then be joint sequences too.",
)
@_json_option
@reading_options
def stability(files: tuple[Path, ...], truth: Path | None, as_json: bool, **reading: Any) -> None:
    """How accurate and how steady recordings are: PA-MPJPE mean and std, jitter.

    FILES are recordings written by `handtrack track`, or folders of them. They are measured
    against the truth that they hold, else against the observed joints. With --truth any joint
    sequences can be measured; the options on units, order, hand and frames are for those.
    """
    import handtrack as ht
    from handtrack.evaluation.report import print_table, to_json

    given = Reading(**reading)
    if truth is not None:
        from handtrack.evaluation.stability import stability_of_pairs

        report = stability_of_pairs(pairs(files, truth, given))
    else:
        if given != Reading():
            raise SettingsError("--frames, --hand, --unit, --order and --fps need --truth here")
        found = [(f, t) for f in recordings(files) for t in ht.read_mcap(f)]
        count = Counter(t.name for _, t in found)
        # recordings of joints.npz and joints.npz are told apart by their files
        report = ht.stability(
            [replace(t, name=f"{f.stem} {t.name}") if count[t.name] > 1 else t for f, t in found]
        )
    if as_json:
        click.echo(to_json(report))
    else:
        print_table(report)


def _check_fitted(track: Track) -> None:
    """Refuse a track of which nothing is there.

    Raises:
        HandtrackError: every frame is lost.
    """
    if (track.status == "lost").all():
        raise HandtrackError(f"{track.source}: no frame could be fitted: {track.reason[0]}")


def _write(tracks: list[Track], job: Job, mesh: bool, progress: Progress) -> None:
    import handtrack as ht

    for path in job.files:
        progress.says(f"writing {path}")
        path.parent.mkdir(parents=True, exist_ok=True)
        if path == job.mcap:
            ht.write_mcap(tracks, path, mesh=mesh)
        else:
            ht.log_rerun(tracks, save=path, mesh=mesh)
    progress.says("tracking")
