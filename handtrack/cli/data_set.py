"""Reports of whole data sets, for `handtrack stability`."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from handtrack.errors import SettingsError
from handtrack.files.whole import whole_file

if TYPE_CHECKING:
    from handtrack.batching.data_set import Report
    from handtrack.batching.sums import Sure
    from handtrack.batching.two_runs import Comparison

_FAILED = 10
_LOG_WIDTH = 190
"""Characters of a line where nobody sees how wide it is."""


def report_data_sets(
    places: dict[str, str],
    by: Sequence[str],
    worst: int,
    html: Path | None,
    csv: Path | None,
    as_json: bool,
) -> None:
    """Print the report of a data set, or the comparison of two, and write what is asked for.

    Args:
        places: name -> results; the name is "" where there is one.
        by: columns to report by.
        worst: how many of the worst clips to name.
        html, csv: files to write, or None.
        as_json: print JSON instead.

    Raises:
        SettingsError: there are more than two, or a column is unknown.
        InputError: there are no results.
    """
    from handtrack.batching.data_set import report
    from handtrack.batching.page import page
    from handtrack.batching.two_runs import Comparison, compare_runs

    if len(places) > 2:
        raise SettingsError(f"{len(places)} data sets, expected one, or two to compare")
    reports = [report(place, by, worst) for place in places.values()]
    found: Report | Comparison = reports[0]
    if len(reports) == 2:
        first, second = places
        found = compare_runs((first, second), (reports[0], reports[1]))
    if as_json:
        click.echo(json.dumps(found.to_dict(), indent=2, allow_nan=False))
    elif isinstance(found, Comparison):
        _say_comparison(found)
    else:
        _say(found)
    written: list[tuple[Path | None, Callable[[Report | Comparison], str]]] = []
    written += [(html, page), (csv, _as_csv)]
    for path, write in written:
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as part:
                part.write_text(write(found), encoding="utf-8")
            click.echo(f"wrote {path}", err=as_json)


def _say(report: Report) -> None:
    from handtrack.batching.page import AGAINST

    of, results = report.overall, report.results
    _print_groups("", {"all": of})
    for column, groups in report.groups.items():
        _print_groups(column, groups)
    for name in sorted(set(results.table["against"].to_pylist())):
        click.echo(AGAINST.get(name, ""))
    if report.worst:
        unit = "mm" if report.worst_by.endswith("_mm") else "m/s^3"
        click.echo(f"\nworst clips, by {report.worst_by} [{unit}]:")
    for bad in report.worst:
        click.echo(f"  {bad.value:8.2f}  {bad.clip} ({bad.hand})  {bad.command}")
    if results.failed:
        click.echo(f"\n{len(results.failed):,} clips failed:")
        for path, error in results.failed[:_FAILED]:
            click.echo(f"  {error if error.startswith(path) else f'{path}: {error}'}")
        if len(results.failed) > _FAILED:
            click.echo(f"  and {len(results.failed) - _FAILED:,} more")
    for note in results.notes:
        click.echo(f"note: {note}")


def _say_comparison(of: Comparison) -> None:
    from handtrack.batching.page import sentences

    _print_groups(f"{of.clips:,} clips of both", dict(zip(of.names, of.common, strict=True)))
    for text, _ in sentences(of):
        click.echo(text)
    for note in of.notes:
        click.echo(f"note: {note}")


def _print_groups(column: str, groups: Mapping[str, Sure]) -> None:
    from rich.console import Console
    from rich.table import Table

    from handtrack.batching.page import TITLES, shown

    console = Console()
    if not console.is_terminal:
        console = Console(width=_LOG_WIDTH)
    names = ["pa_mpjpe_mm", "pa_mpjpe_std_mm", "jitter_m_s3", "lost_percent"]
    if console.width >= _LOG_WIDTH:
        names = list(TITLES)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column(column, no_wrap=True)
    for title in ("clips", "frames"):
        table.add_column(title, justify="right")
    for name in names:
        title, unit = TITLES[name]
        table.add_column(f"{title} {unit}", justify="right")
    for value, group in groups.items():
        cells = [shown(group.values[name]) for name in names]
        table.add_row(value, f"{group.clips:,}", f"{group.frames:,}", *cells)
    console.print(table)


def _as_csv(of: Report | Comparison) -> str:
    import csv
    import io

    from handtrack.batching.sums import MEASURES
    from handtrack.batching.two_runs import Comparison

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [f"{name}{end}" for name in MEASURES for end in ("", ".low", ".high")]
    writer.writerow(["run", "by", "value", "clips", "frames", "subjects", *columns])
    runs = (
        {"": of} if not isinstance(of, Comparison) else dict(zip(of.names, of.reports, strict=True))
    )
    for run, report in runs.items():
        groups = {"": {"all": report.overall}, **report.groups}
        for column, values in groups.items():
            for value, group in values.items():
                cells: list[float | None] = []
                for name in MEASURES:
                    cells += group.values[name].to_dict().values()
                writer.writerow(
                    [run, column, value, group.clips, group.frames, group.subjects, *cells]
                )
    return text.getvalue()
