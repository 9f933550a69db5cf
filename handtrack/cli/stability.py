"""handtrack stability."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading, Truths, estimates
from handtrack.cli.models import mano_options
from handtrack.cli.options import is_default, json_option, quiet_option, reading_options
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.errors import SettingsError
from handtrack.files.whole import whole_file

if TYPE_CHECKING:
    from handtrack.evaluation.results import StabilityReport
    from handtrack.evaluation.tables import Report


@click.command(
    cls=Command, short_help="How accurate and how steady recordings are; which of two is better."
)
@click.argument("files", nargs=-1, required=True, metavar="[NAME=]FILE...")
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    help="True joints to measure against: a file or a folder.",
)
@click.option(
    "--match",
    type=click.Choice(["auto", "frame", "time", "position"]),
    default="auto",
    help="What frames of estimate and truth belong together by; auto: numbers and times that both"
    " files give, else position where there are as many.",
)
@click.option("--compare", is_flag=True, help="Every FILE is a method of its own.")
@click.option("--csv", type=click.Path(path_type=Path), help="Write the table as .csv.")
@click.option("--latex", type=click.Path(path_type=Path), help="Write the table as .tex.")
@click.option("--html", type=click.Path(path_type=Path), help="Write a page with plots, .html.")
@click.option("--by", multiple=True, metavar="COLUMN", help="Of a data set: report by it, too.")
@click.option(
    "--worst",
    type=click.IntRange(0),
    default=10,
    show_default=True,
    help="Of a data set: how many of the worst clips to name.",
)
@overwrite_option
@mano_options
@json_option
@quiet_option
@reading_options
def stability(
    files: tuple[str, ...],
    truth: Path | None,
    match: str,
    compare: bool,
    csv: Path | None,
    latex: Path | None,
    html: Path | None,
    by: tuple[str, ...],
    worst: int,
    as_json: bool,
    quiet: bool,
    **reading: Any,
) -> None:
    """How accurate and how steady recordings are, and which of two methods is better.

    FILES are recordings written by `handtrack track`, joint sequences in any format that `track`
    reads, or folders of them. They are measured against --truth, else against the truth that
    they hold, else against the observed joints. With names (NAME=FILE, once or several times
    for each NAME) or --compare, methods are compared on the frames that all of them have.

    Of a folder that `handtrack batch` wrote the table is read: overall, by subject, by any
    column (--by), the worst clips, intervals by subjects and clips; of two the difference.

    \b
    PA-MPJPE   mean joint distance after the best similarity (det +1) of each frame, mm
    MPJPE      without alignment, mm
    std        over frames, divided by n: the steadiness of Li et al. 2021
    jitter     mean norm of the third time derivative, m/s^3
    shakes     what parabolas through 11 frames do not follow: the whole hand's (mm), and the
               fingers' bends (degrees); in brackets the input's
    AUC        of the PCK curve, 0-50 mm, after alignment (FreiHAND)
    [low, high]  95 % intervals by a circular block bootstrap, blocks as long as the errors are
               correlated; differences are paired: the same frames, the same blocks.
    Lost frames have no error: read the errors together with their share.
    """
    from handtrack.evaluation.report import print_comparison, print_table, to_json

    methods = _methods(files, compare)
    sets = _data_sets(methods)
    if sets:
        from handtrack.cli.data_set import report_data_sets

        unfit = [name for name in ("truth", "match", "latex", *reading) if not is_default(name)]
        if unfit:
            raise SettingsError(
                f"--{unfit[0].replace('_', '-')} is not for the table of a data set"
            )
        for path, suffix, option in ((csv, ".csv", "--csv"), (html, ".html", "--html")):
            if path is not None:
                check_target(path, suffix, option)
        report_data_sets(sets, by, worst, html, csv, as_json)
        return
    for option in ("by", "worst"):
        if not is_default(option):
            raise SettingsError(f"--{option} is for the results of handtrack batch")
    read = [path for paths in methods.values() for path in paths]
    read += [] if truth is None else [truth]
    targets = ((csv, ".csv", "--csv"), (latex, ".tex", "--latex"), (html, ".html", "--html"))
    for path, suffix, option in targets:
        if path is not None:
            check_target(path, suffix, option, read)
    given = Reading(**reading)
    truths = None if truth is None else Truths.load(truth, given)
    measured = {name: _measured(paths, truths, given, match) for name, paths in methods.items()}
    report: Report
    if len(measured) > 1:
        from handtrack.evaluation.compare import compare as compare_methods

        report = compare_methods(measured)
        if not (as_json or quiet):
            print_comparison(report)
    else:
        report = next(iter(measured.values()))
        if not (as_json or quiet):
            print_table(report)
    if as_json:
        click.echo(to_json(report))
    about = {name: tuple(map(str, paths)) for name, paths in methods.items()}
    for path, write in _files(csv, latex, html, about):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part:
            part.write_text(write(report), encoding="utf-8")
        if not quiet:
            click.echo(f"wrote {path}", err=as_json)


def _command() -> str:
    """What was typed, as far as it differs from what needs no typing."""
    context = click.get_current_context()
    options = [
        f"--{name.replace('_', '-')} {shlex.quote(str(value))}"
        for name, value in context.params.items()
        if name != "files" and not is_default(name) and not isinstance(value, bool | tuple)
    ]
    files = [shlex.quote(file) for file in context.params["files"]]
    return " ".join(["handtrack", "stability", *files, *options])


def _files(
    csv: Path | None,
    latex: Path | None,
    html: Path | None,
    measured: dict[str, tuple[str, ...]],
) -> list[tuple[Path, Callable[[Report], str]]]:
    """What is to be written, and how."""
    from handtrack.evaluation.html_report import About, to_html
    from handtrack.evaluation.tables import to_csv, to_latex

    date = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    about = About(date, measured, _command())
    wanted = ((csv, to_csv), (latex, to_latex), (html, partial(to_html, about=about)))
    return [(path, write) for path, write in wanted if path is not None]


def _data_sets(methods: dict[str, tuple[Path, ...]]) -> dict[str, str]:
    """The results of `handtrack batch` among what is to be measured; empty if there are none.

    Raises:
        SettingsError: recordings are given beside them, or several are of one name.
    """
    from handtrack.batching.data_set import is_data_set

    # Path makes one slash of the two in a URL
    places = {
        name: [
            str(path).replace(":/", "://", 1) if ":/" in str(path) else str(path) for path in paths
        ]
        for name, paths in methods.items()
    }
    found = [place for all_of in places.values() for place in all_of if is_data_set(place)]
    if not found:
        return {}
    if any(len(all_of) > 1 for all_of in places.values()) or len(found) < len(places):
        raise SettingsError(
            f"{found[0]} is a whole data set: give it alone, or NAME=OUT NAME=OUT to compare two"
        )
    return {name: all_of[0] for name, all_of in places.items()}


def _methods(files: tuple[str, ...], compare: bool) -> dict[str, tuple[Path, ...]]:
    """What belongs to which method; one without a name if nothing is compared.

    Raises:
        SettingsError: some have names and some have not, or two methods would share one.
    """
    split = [_name_and_path(file) for file in files]
    named = [name for name, _ in split if name]
    if named and len(named) < len(split):
        bare = next(path for name, path in split if not name)
        raise SettingsError(f"{bare} has no name, others have: give each as NAME=FILE")
    if not named and not compare:
        return {"": tuple(path for _, path in split)}
    if not named:
        stems = [path.stem or str(path) for _, path in split]
        if len(set(stems)) < len(stems):
            stems = [str(path) for _, path in split]
        if len(set(stems)) < len(stems):
            raise SettingsError(f"{stems[0]} is given twice, expected different methods")
        if len(stems) < 2:
            raise SettingsError(f"only one method, {stems[0]}: --compare needs two or more")
        return {name: (path,) for name, (_, path) in zip(stems, split, strict=True)}
    out: dict[str, tuple[Path, ...]] = {}
    for name, path in split:
        out[name] = (*out.get(name, ()), path)
    if len(out) < 2:
        raise SettingsError(f"only one method, {named[0]}: give two or more to compare")
    return out


def _name_and_path(file: str) -> tuple[str, Path]:
    name, equals, path = file.partition("=")
    if not equals or not name or Path(file).exists():
        return "", Path(file)
    return name, Path(path)


def _measured(
    paths: tuple[Path, ...], truths: Truths | None, reading: Reading, match: str
) -> StabilityReport:
    import handtrack as ht

    found = estimates(paths, reading)
    if truths is not None:
        from handtrack.evaluation.stability import stability_of_pairs

        return stability_of_pairs([(e, truths.of(e)) for _, e in found], match)
    if not any(isinstance(e, ht.Sequence) for _, e in found) and (
        reading.unit or reading.order or reading.fps or reading.mirror
    ):
        raise SettingsError(
            "--unit, --order, --fps and --mirror are for joint files; recordings say these"
            " themselves"
        )
    count = Counter(e.name for _, e in found)
    # recordings of joints.npz and joints.npz are told apart by their files
    return ht.stability(
        [replace(e, name=f"{f.stem} {e.name}") if count[e.name] > 1 else e for f, e in found]
    )
