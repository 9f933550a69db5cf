"""The command line: arguments and printing only. Imports wait until a command needs them."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack import __version__
from handtrack.errors import HandtrackError, InputError, SettingsError

if TYPE_CHECKING:
    from handtrack import Sequence, Track

RECORDINGS = Path("recordings")


def main() -> None:
    """Run the command line and exit: 0 done, 1 the job failed, 2 input or arguments are wrong."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status."""
    try:
        return int(cli.main(arguments, prog_name="handtrack", standalone_mode=False) or 0)
    except click.ClickException as error:
        error.show()
        return 2
    except HandtrackError as error:
        click.echo(f"error: {error}", err=True)
        return 2
    except OSError as error:
        click.echo(f"error: {error.filename or ''}: {error.strerror or error}", err=True)
        return 1
    except (click.Abort, KeyboardInterrupt):
        click.echo("stopped", err=True)
        return 1


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="handtrack")
def cli() -> None:
    """Track 3D hand joint sequences, replay them, and measure how steady they are."""


def _input_options(command: Any) -> Any:
    for option in (
        click.option("--fps", type=float, help="Frame rate, where the file has no times."),
        click.option("--order", metavar="NAME", help="Joint order, where the file does not say."),
        click.option("--unit", type=click.Choice(["m", "cm", "mm"]), help="Unit of the joints."),
        click.option(
            "--hand",
            type=click.Choice(["auto", "left", "right", "swap"]),
            default="auto",
            help="Which hand it is, or which to take of several; swap exchanges the labels.",
        ),
        click.option("--frames", metavar="A:B", help="Only source frames A to B, both included."),
    ):
        command = option(command)
    return command


@cli.command()
@click.argument("input", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="MCAP file to write.")
@click.option("--rrd", type=click.Path(path_type=Path), help="Rerun file to write as well.")
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
@click.option("--no-mesh", is_flag=True, help="Leave the skin out of the recording.")
@click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@_input_options
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
    frames: str | None,
    hand: str,
    unit: str | None,
    order: str | None,
    fps: float | None,
) -> int:
    """Fit a hand to every frame of a joint sequence and record the result.

    INPUT is a file or a folder: CMU Panoptic, .npz / .npy / .csv / .json / .jsonl, FPHA,
    Leap Motion, MCAP. Without -o the recording is recordings/NAME.mcap.
    """
    import handtrack as ht

    sequences = _load(input, hand, unit, order, fps, frames)
    output = output or RECORDINGS / f"{_stem(input)}.mcap"
    with _kernels_ready(quiet or as_json):
        from handtrack.fitting.bcd import warm_up

        warm_up()
    tracks: list[Track] = []
    start = time.perf_counter()
    with _progress(sum(map(len, sequences)), "tracking", quiet or as_json) as advance:
        for sequence in sequences:
            model = ht.HandModel.default(sequence.hand, limits)
            tracks.append(
                ht.track(
                    sequence,
                    model,
                    calibrate=not no_calibrate,
                    filter=filter_,
                    update=update,
                    progress=advance,
                )
            )
    seconds = time.perf_counter() - start
    output.parent.mkdir(parents=True, exist_ok=True)
    ht.write_mcap(tracks, output, mesh=not no_mesh)
    written = [output]
    if rrd is not None:
        rrd.parent.mkdir(parents=True, exist_ok=True)
        ht.log_rerun(tracks, save=rrd)
        written.append(rrd)

    report = ht.stability(tracks)
    rate = sum(map(len, tracks)) / seconds
    if as_json:
        result = report.to_dict() | {
            "outputs": [str(path) for path in written],
            "frames_per_second": rate,
            "warnings": [note for s in sequences for note in s.notes],
        }
        click.echo(json.dumps(result, indent=2))
    elif not quiet:
        _print_report(report)
        click.echo(
            f"tracked {sum(map(len, tracks))} frames at {rate:,.0f} frames/s"
            f" -> {' and '.join(map(str, written))}"
        )
    if all((t.status == "lost").all() for t in tracks):
        click.echo("error: no frame could be fitted", err=True)
        return 1
    return 0


@cli.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--save", type=click.Path(path_type=Path), help="Write a Rerun file instead.")
@click.option("--web", is_flag=True, help="Serve the browser viewer on 127.0.0.1.")
@click.option("--port", type=click.IntRange(1, 65535), help="Port of the browser viewer.")
def replay(file: Path, save: Path | None, web: bool, port: int | None) -> None:
    """Show a recording in Rerun: the hand, the observed joints, the angles and the errors."""
    from handtrack.recording.replay import replay as show

    show(file, save=save, web=web, port=port)


@cli.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    help="Joint sequence to measure against; FILES are then joint sequences or recordings.",
)
@click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
@_input_options
def stability(
    files: tuple[Path, ...],
    truth: Path | None,
    as_json: bool,
    frames: str | None,
    hand: str,
    unit: str | None,
    order: str | None,
    fps: float | None,
) -> None:
    """How accurate and how steady recordings are: PA-MPJPE mean and std, jitter.

    FILES are recordings written by `handtrack track`, or folders of them.
    """
    import handtrack as ht

    if truth is not None:
        from handtrack.evaluation.stability import stability_of_pairs

        true = _load(truth, hand, unit, order, fps, frames)
        estimates = [s for f in files for s in _load(f, hand, unit, order, fps, frames)]
        report = stability_of_pairs(_pairs(estimates, true, truth))
    else:
        report = ht.stability([t for f in _recordings(files) for t in ht.read_mcap(f)])
    if as_json:
        click.echo(json.dumps(report.to_dict(), indent=2))
    else:
        _print_report(report)


def _load(
    path: Path,
    hand: str,
    unit: str | None,
    order: str | None,
    fps: float | None,
    frames: str | None,
) -> list[Sequence]:
    import handtrack as ht

    sequences = ht.load(
        path,
        hand=None if hand == "auto" else hand,
        unit=unit,
        order=order,
        fps=fps,
        frames=_frame_range(frames),
    )
    for sequence in sequences:
        for note in sequence.notes:
            click.echo(f"warning: {sequence.name}: {note}", err=True)
    return sequences


def _frame_range(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    start, colon, stop = text.partition(":")
    try:
        a, b = int(start), int(stop)
    except ValueError:
        a, b = 0, -1
    if not colon or a > b:
        raise SettingsError(f"--frames {text} is no range, expected A:B, as in 20701:20800")
    return a, b


def _pairs(
    estimates: list[Sequence], truths: list[Sequence], path: Path
) -> list[tuple[Sequence, Sequence]]:
    """Every estimate with its truth: the only one, or the one of the same hand or name."""
    pairs = []
    for estimate in estimates:
        fitting = [t for t in truths if len(truths) == 1 or t.hand == estimate.hand]
        if len(fitting) > 1:
            fitting = [t for t in fitting if t.name == estimate.name]
        if len(fitting) != 1:
            raise InputError(
                f"{len(fitting)} sequences fit {estimate.name} ({estimate.hand}), expected one",
                path,
            )
        pairs.append((estimate, fitting[0]))
    return pairs


def _recordings(paths: tuple[Path, ...]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        inside = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise InputError("no .mcap recording in this folder", path)
        found += inside
    return found


def _stem(path: Path) -> str:
    """Name of the recording of an input: folders and archives lose their endings too."""
    name = path.resolve().name
    for ending in path.suffixes[::-1]:
        name = name.removesuffix(ending)
    # a Panoptic sequence is named by the folder around hdHand3d
    return path.resolve().parent.name if name == "hdHand3d" else name


def _print_report(report: Any) -> None:
    from handtrack.evaluation.report import print_table

    print_table(report)


@contextmanager
def _kernels_ready(quiet: bool) -> Iterator[None]:
    """Say so, on one line, when kernels are being compiled instead of loaded."""

    def say() -> None:
        click.echo("compiling the fitter, once on this machine (about 20 s) ...", err=True)

    timer = threading.Timer(2.0, say)
    if not quiet:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def _progress(total: int, what: str, quiet: bool) -> Iterator[Any]:
    """A progress bar for people at a terminal; a function that advances by one frame."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        done = 0

        def advance(frames: int) -> None:
            nonlocal done
            bar.update(task, completed=done + frames)

        yield advance
