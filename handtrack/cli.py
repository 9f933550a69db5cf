"""The command line: arguments and printing only. Imports wait until a command needs them."""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from handtrack import __version__
from handtrack.errors import HandtrackError, InputError, ModelError, SettingsError

if TYPE_CHECKING:
    from handtrack import Sequence, Track

RECORDINGS = Path("recordings")
COMPILING = "compiling the fitter, once on this machine (about 20 s) ..."

_Command = TypeVar("_Command", bound=Callable[..., Any])


def main() -> None:
    """Run the command line and exit: 0 done, 1 the job failed, 2 input or arguments are wrong."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status; what goes wrong is one line on stderr."""
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
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


class _Input(NamedTuple):
    """How to read joint sequences, as the options say."""

    hand: str
    unit: str | None
    order: str | None
    fps: float | None
    frames: str | None

    def load(self, path: Path, quiet: bool = False) -> list[Sequence]:
        """The sequences of a file or folder; what the user should know of them is printed."""
        import handtrack as ht

        sequences = ht.load(
            path,
            hand=None if self.hand == "auto" else self.hand,
            unit=self.unit,
            order=self.order,
            fps=self.fps,
            frames=_frame_range(self.frames),
        )
        for sequence in sequences if not quiet else ():
            for note in sequence.notes:
                click.echo(f"warning: {sequence.name}: {note}", err=True)
        return sequences


def _input_options(command: _Command) -> _Command:
    for option in (
        click.option("--fps", type=float, help="Frame rate, where the file has no times."),
        click.option("--order", metavar="NAME", help="Joint order, where the file does not say."),
        click.option("--unit", type=click.Choice(["m", "cm", "mm"]), help="Unit of the joints."),
        click.option(
            "--hand",
            type=click.Choice(["auto", "left", "right", "swap"]),
            default="auto",
            help="Which hand it is, or which to take of two; swap exchanges the labels.",
        ),
        click.option("--frames", metavar="A:B", help="Only source frames A to B, both included."),
    ):
        command = option(command)
    return command


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
    **reading: Any,
) -> int:
    """Fit a hand to every frame of a joint sequence and record the result.

    INPUT is a file or a folder: CMU Panoptic, .npz / .npy / .csv / .json / .jsonl, FPHA, Leap
    Motion, MCAP. Without -o the recording is recordings/NAME.mcap; of a folder with several
    unrelated files each gets its own, recordings/FOLDER/NAME.mcap. With -o FILE.mcap they
    share one.
    """
    import handtrack as ht

    sequences = _Input(**reading).load(input, quiet)
    jobs = _jobs(sequences, input, output, rrd)
    tracks: list[Track] = []
    skipped: list[str] = []
    seconds = 0.0
    with (
        _compiling_said(quiet or as_json),
        _progress(sum(map(len, sequences)), quiet or as_json) as progress,
    ):
        from handtrack.fitting.bcd import warm_up

        warm_up()
        for job in jobs:
            made = []
            for sequence in job.sequences:
                start = time.perf_counter()
                try:
                    result = ht.track(
                        sequence,
                        ht.HandModel.default(sequence.hand, limits),
                        calibrate=not no_calibrate,
                        filter=filter_,
                        update=update,
                        progress=progress.frames,
                    )
                except InputError as error:
                    if len(sequences) == 1:
                        raise
                    skipped.append(f"{sequence.name}: left out: {error}")
                else:
                    made.append(result)
                seconds += time.perf_counter() - start
                progress.next(len(sequence))
            if made:
                _write(made, job, not no_mesh, progress)
                tracks += made
    for note in skipped if not quiet else ():
        click.echo(f"warning: {note}", err=True)
    if not tracks:
        raise InputError("no sequence could be tracked", input)

    written = [p for job in jobs for p in (job.mcap, job.rrd) if p is not None and p.exists()]
    frames = sum(map(len, tracks))
    report = ht.stability(tracks)
    if as_json:
        result_dict = report.to_dict() | {
            "outputs": [str(path) for path in written],
            "frames_per_second": frames / seconds,
            "warnings": [f"{s.name}: {note}" for s in sequences for note in s.notes] + skipped,
        }
        click.echo(json.dumps(result_dict, indent=2, allow_nan=False))
    elif not quiet:
        _print_report(report)
        where = " and ".join(map(str, written)) if len(jobs) == 1 else _listed(jobs)
        click.echo(f"tracked {frames:,} frames at {frames / seconds:,.0f} frames/s -> {where}")
    if all((t.status == "lost").all() for t in tracks):
        return _failed(f"{input}: no frame could be fitted", 1)
    return 0


@cli.command(short_help="Show recordings in Rerun.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--save", type=click.Path(path_type=Path), help="Write a Rerun file instead.")
@click.option("--web", is_flag=True, help="Serve the browser viewer on 127.0.0.1.")
@click.option("--port", type=click.IntRange(1, 65535), help="Port of the browser viewer.")
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
        _check_target(save, ".rrd", "--save")
    if not web and (port is not None or no_open):
        raise SettingsError("--port and --no-open belong to --web")
    from handtrack.recording.replay import replay as show

    paths = _recordings(files)
    if save is not None:
        save.parent.mkdir(parents=True, exist_ok=True)
    say = click.echo
    if web:

        def say(address: str) -> None:
            click.echo(f"{address}\nCtrl-C stops the server." if not quiet else address)

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
@_input_options
def stability(
    files: tuple[Path, ...], truth: Path | None, as_json: bool, **reading: Any
) -> None:
    """How accurate and how steady recordings are: PA-MPJPE mean and std, jitter.

    FILES are recordings written by `handtrack track`, or folders of them. They are measured
    against the truth that they hold, else against the observed joints. With --truth any joint
    sequences can be measured; the options on units, order, hand and frames are for those.
    """
    import handtrack as ht
    from handtrack.evaluation.report import to_json

    given = _Input(**reading)
    if truth is not None:
        from handtrack.evaluation.stability import stability_of_pairs

        # a file that holds both is asked for its truth
        true = [s if s.truth is None else replace(s, joints=s.truth) for s in given.load(truth)]
        estimates = [s for f in files for s in _estimates(f, given)]
        report = stability_of_pairs(_pairs(estimates, true, truth))
    else:
        if given != _Input("auto", None, None, None, None):
            raise SettingsError("--frames, --hand, --unit, --order and --fps need --truth here")
        found = [(f, t) for f in _recordings(files) for t in ht.read_mcap(f)]
        count = Counter(t.name for _, t in found)
        # recordings of joints.npz and joints.npz are told apart by their files
        report = ht.stability(
            [replace(t, name=f"{f.stem} {t.name}") if count[t.name] > 1 else t for f, t in found]
        )
    if as_json:
        click.echo(to_json(report))
    else:
        _print_report(report)


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


class _Job(NamedTuple):
    """The sequences that go into one recording, and where it goes."""

    sequences: list[Sequence]
    mcap: Path
    rrd: Path | None


def _jobs(
    sequences: list[Sequence], input: Path, output: Path | None, rrd: Path | None
) -> list[_Job]:
    """One recording for each source file; one for all where the output is one file."""
    groups: dict[str, list[Sequence]] = {}
    together = any(path is not None and not _is_folder(path) for path in (output, rrd))
    for sequence in sequences:
        groups.setdefault("" if together else sequence.source, []).append(sequence)
    if output is None:
        several = len(groups) > 1
        output = RECORDINGS / input.resolve().name if several else RECORDINGS
    names = _names([Path(group[0].source) if not together else input for group in groups.values()])
    jobs = []
    for name, group in zip(names, groups.values(), strict=True):
        mcap = output / f"{name}.mcap" if _is_folder(output) else output
        file = rrd / f"{name}.rrd" if rrd is not None and _is_folder(rrd) else rrd
        _check_target(mcap, ".mcap", "-o")
        if file is not None:
            _check_target(file, ".rrd", "--rrd")
        if any(mcap.resolve() == Path(s.source).resolve() for s in group):
            raise SettingsError(f"{mcap} is the input: give the new recording a name with -o")
        jobs.append(_Job(group, mcap, file))
    return jobs


def _is_folder(path: Path) -> bool:
    return path.is_dir() or not path.suffix


def _names(sources: list[Path]) -> list[str]:
    """Names of recordings: those of the sources without endings, with folders where needed."""
    from handtrack.sequences.readers.raw import stem

    resolved = [source.resolve() for source in sources]
    # a Panoptic sequence is named by the folder around hdHand3d
    resolved = [path.parent if path.name == "hdHand3d" else path for path in resolved]
    names = [path.name if path.is_dir() else stem(path) for path in resolved]
    for longer in (lambda p: f"{p.parent.name}-{stem(p)}", lambda p: f"{p.parent.name}-{p.name}"):
        count = Counter(names)
        names = [longer(p) if count[n] > 1 else n for p, n in zip(resolved, names, strict=True)]
    count = Counter()
    for i, name in enumerate(names):
        count[name] += 1
        if count[name] > 1:
            names[i] = f"{name}-{count[name]}"
    return names


def _check_target(path: Path, suffix: str, option: str) -> None:
    """Refuse what cannot be written, before the work begins."""
    if path.is_dir():
        raise SettingsError(f"{path} is a folder, expected the name of a file to write")
    if path.suffix != suffix:
        raise SettingsError(f"{option} {path}: expected a name that ends in {suffix}")
    above = next(p for p in path.absolute().parents if p.exists())
    if not above.is_dir():
        raise SettingsError(f"{path} cannot be written: {above} is no folder")
    if not os.access(above, os.W_OK):
        raise SettingsError(f"{path} cannot be written: no permission to write to {above}")


def _write(tracks: list[Track], job: _Job, mesh: bool, progress: _Progress) -> None:
    import handtrack as ht

    for path in (job.mcap, job.rrd):
        if path is not None:
            progress.says(f"writing {path}")
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix == ".mcap":
                ht.write_mcap(tracks, path, mesh=mesh)
            else:
                ht.log_rerun(tracks, save=path, mesh=mesh)
    progress.says("tracking")


def _listed(jobs: list[_Job]) -> str:
    folders = dict.fromkeys(p.parent for job in jobs for p in (job.mcap, job.rrd) if p is not None)
    return f"{len(jobs)} recordings in {' and '.join(map(str, folders))}"


def _recordings(paths: tuple[Path, ...]) -> list[Path]:
    """The recordings that are named, or in the folders that are named."""
    found: list[Path] = []
    for path in paths:
        inside = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise InputError("no .mcap recording in this folder", path)
        found += inside
    return found


def _estimates(path: Path, given: _Input) -> list[Sequence]:
    """The joints to measure against a truth: a recording's output, or a joint sequence."""
    import handtrack as ht

    if not _is_recording(path):
        return given.load(path)
    frames = _frame_range(given.frames)
    estimates = [
        ht.Sequence(
            time_ns=t.time_ns,
            joints=t.filtered_joints,
            hand=t.hand,
            frame_index=t.frame_index,
            name=t.name,
            source=str(path),
        )
        for t in ht.read_mcap(path)
        if given.hand in ("auto", t.hand)
    ]
    return estimates if frames is None else [s.frames(*frames) for s in estimates]


def _is_recording(path: Path) -> bool:
    """Whether it is one of ours, and not another MCAP file with joints."""
    from handtrack.recording.mcap_walk import Walk
    from handtrack.recording.mcap_write import METADATA

    if path.suffix != ".mcap" or not path.is_file():
        return False
    walk = Walk(path)
    next(walk.messages(lambda schema: True), None)
    return METADATA in walk.metadata


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


def _print_report(report: Any) -> None:
    from handtrack.evaluation.report import print_table

    print_table(report)


@contextmanager
def _compiling_said(quiet: bool) -> Iterator[None]:
    """Say so, once and on one line, when code is really being compiled."""
    if quiet:
        yield
        return
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        said = False

        def on_start(self, event: Any) -> None:
            if not self.said:
                self.said = True
                click.echo(COMPILING, err=True)

        def on_end(self, event: Any) -> None: ...

    listener = Listener()
    event.register("numba:run_pass", listener)
    try:
        yield
    finally:
        event.unregister("numba:run_pass", listener)


class _Progress:
    """Where the work is, for a bar; this one shows nothing."""

    def frames(self, done: int) -> None:
        """So many frames of this sequence are done."""

    def next(self, frames: int) -> None:
        """A sequence of so many frames is done."""

    def says(self, what: str) -> None:
        """What is going on."""


class _Bar(_Progress):
    """A progress bar on stderr."""

    def __init__(self, bar: Any, total: int) -> None:
        self._bar, self._before = bar, 0
        self._task = bar.add_task("tracking", total=total)

    def frames(self, done: int) -> None:
        self._bar.update(self._task, completed=self._before + done)

    def next(self, frames: int) -> None:
        self._before += frames
        self.frames(0)

    def says(self, what: str) -> None:
        self._bar.update(self._task, description=what)


@contextmanager
def _progress(total: int, quiet: bool) -> Iterator[_Progress]:
    """A bar for people at a terminal."""
    if quiet or not sys.stderr.isatty():
        yield _Progress()
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        yield _Bar(bar, total)
