"""A stability report as people and as machines read it: a table, and JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from handtrack.evaluation.bootstrap import Uncertain
from handtrack.evaluation.compare import Comparison
from handtrack.evaluation.report_columns import (
    MUST,
    fitting,
    mean_std,
    percent,
    short,
    that_fit,
    with_limits,
)
from handtrack.evaluation.results import Stability, StabilityReport
from handtrack.evaluation.tables import PaperRows, panoptic_rows

if TYPE_CHECKING:
    from rich.console import Console

MEANING = {
    "truth": "Against the truth: the error of the output.",
    "observed": (
        "Against the observed joints: how well the hand explains what it was given, noise"
        " included. This is not accuracy."
    ),
    "nothing": "Joints that come alone, or fitted to pictures: no errors in mm, but how they move.",
}

_ERRORS = (
    "Errors in mm (mean ± std over frames): PA-MPJPE after similarity alignment of each frame,"
    " MPJPE without. "
)
_MOTION = (
    "Jitter in m/s³ and acceleration in m/s²: output (input). Shakes: what parabolas through 11"
    " frames do not follow, of the palm and of the fingers' bends."
)


def _units(rows: list[Stability]) -> str:
    """What stands in the columns, errors only where there are any."""
    return (_ERRORS if any(row.against != "nothing" for row in rows) else "") + _MOTION


def to_json(report: StabilityReport | Comparison) -> str:
    """The report as one JSON object; what is not known is null.

    {"sequences": [{"name", "hand", "frames", "fitted", "predicted", "lost", "against",
    "pa_mpjpe_mm": {"mean", "std", "median", "p95", "max"}, "mpjpe_mm": {...}, "jitter_m_s3",
    "acceleration_m_s2", ...}], "overall": {...}}; of a comparison {"methods", "common",
    "differences", "notes"}. "paper" holds the paper's numbers of its Panoptic sequence.
    """
    if isinstance(report, Comparison):
        report_rows = next(iter(report.methods.values())).sequences
    else:
        report_rows = report.sequences
    out = report.to_dict()
    paper = panoptic_rows(report_rows)
    if paper is not None:
        out["paper"] = paper.to_dict()
    return json.dumps(out, indent=2, allow_nan=False)


def print_table(report: StabilityReport, console: Console | None = None) -> None:
    """Print one row per sequence, the pooled row if there are several, and what they mean.

    Columns that do not fit the console are left out, the least important first, and named.

    Args:
        report: the report.
        console: where to print; standard output by default.
    """
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    console = console or _console()
    several = len(report.sequences) > 1
    rows = [*report.sequences, report.overall] if several else list(report.sequences)
    columns, left_out = that_fit(rows, console.width)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1))
    for column in columns:
        left = column.heading in ("sequence", "hand", "against")
        table.add_column(
            column.heading,
            justify="left" if left else "right",
            no_wrap=column.heading != "sequence",
            overflow="fold",
            min_width=column.width(rows),
        )
    for row in rows:
        if several and row is report.overall:
            table.add_section()
        table.add_row(*(escape(column.cell(row)) for column in columns))
    console.print(table)
    for against in dict.fromkeys(r.against for r in rows):
        console.print(MEANING[against], style="dim")
    if any(r.input_pa_mpjpe_mm for r in rows):
        console.print("Input: the error of the observed joints to the same truth.", style="dim")
    console.print(_units(rows), style="dim")
    sure = _sure(report.overall)
    if sure:
        console.print(sure, style="dim")
    if left_out:
        console.print(f"Left out for lack of width: {', '.join(left_out)}.", style="dim")
    for row in rows:
        for note in row.notes:
            console.print(f"{escape(row.name)}: {escape(note)}", style="yellow")
    _print_paper(panoptic_rows(report.sequences), [("this run", report.overall)], console)


def print_comparison(comparison: Comparison, console: Console | None = None) -> None:
    """Print methods beside each other, sequence by sequence and on their common frames.

    Args:
        comparison: of two or more methods.
        console: where to print; standard output by default.
    """
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    console = console or _console()
    methods = comparison.methods
    first = next(iter(methods.values()))
    if len(first.sequences) > 1:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title="PA-MPJPE, each on its own frames")
        for heading in ("sequence", *methods):
            table.add_column(escape(heading), justify="left" if heading == "sequence" else "right")
        for row in first.sequences:
            cells = [escape(row.name)]
            for report in methods.values():
                same = [r for r in report.sequences if (r.name, r.hand) == (row.name, row.hand)]
                cells.append(mean_std(same[0].pa_mpjpe_mm) if same else "-")
            table.add_row(*cells)
        console.print(table)
    table = Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        title=f"{comparison.frames:,} frames that all methods have, 95 % intervals in brackets",
    )
    columns, left_out = fitting(
        _common_columns(comparison),
        lambda c: (c[0], c[1], max(map(len, (c[0], *c[2])))),
        console.width,
    )
    for column in columns:
        table.add_column(
            column[0], justify="left" if column[0] == "method" else "right", no_wrap=True
        )
    for i in range(len(methods)):
        table.add_row(*(escape(cells[i]) for _, _, cells in columns))
    console.print(table)
    for difference in comparison.differences:
        style = "bold" if difference.verdict else "dim"
        console.print(escape(difference.sentence), style=style)
    console.print(MEANING[first.overall.against], style="dim")
    blocks = sorted({d.block for d in comparison.differences})
    lengths = f"{blocks[0]}" if len(blocks) == 1 else f"{blocks[0]} to {blocks[-1]}"
    console.print(
        "mm; jitter in m/s³; AUC of PCK 0-50 mm after alignment. Differences are paired: all"
        f" methods resampled by the same blocks of {lengths} frames.",
        style="dim",
    )
    if left_out:
        console.print(f"Left out for lack of width: {', '.join(left_out)}.", style="dim")
    for name, row in comparison.common.items():
        found = row.intervals.get("pa_mpjpe_mm")
        if found is not None and found.few:
            console.print(escape(f"{name}: no interval of PA-MPJPE: {found.few}"), style="dim")
    for note in comparison.notes:
        console.print(escape(note), style="yellow")
    for name, report in methods.items():
        for row in report.sequences:
            for note in row.notes:
                console.print(f"{escape(name)}: {escape(row.name)}: {escape(note)}", style="yellow")
    _print_paper(panoptic_rows(first.sequences), list(comparison.common.items()), console)


_Cells = tuple[str, int, list[str]]
"""A column of the comparison: heading, importance, one cell for each method."""


def _common_columns(comparison: Comparison) -> list[_Cells]:
    rows = list(comparison.common.values())
    sure = [row.intervals.get("pa_mpjpe_mm") for row in rows]
    shaky = [row.intervals.get("jitter_m_s3") for row in rows]
    own = [report.overall for report in comparison.methods.values()]

    def with_range(values: list[float], of: list[Uncertain | None]) -> list[str]:
        return [short(v) + with_limits(u) for v, u in zip(values, of, strict=True)]

    means = [r.pa_mpjpe_mm.mean for r in rows]
    stds = [r.pa_mpjpe_mm.std for r in rows]
    jitters = [r.jitter_m_s3 for r in rows]
    auc = [f"{r.pa_auc:.3f}" if np.isfinite(r.pa_auc) else "-" for r in rows]
    return [
        ("method", MUST, list(comparison.common)),
        ("lost", 6, [percent(r.lost, r.frames) for r in own]),
        ("PA-MPJPE", MUST, with_range(means, [i.mean if i else None for i in sure])),
        ("std", MUST, with_range(stds, [i.std if i else None for i in sure])),
        ("median", 1, [short(r.pa_mpjpe_mm.median) for r in rows]),
        ("p95", 3, [short(r.pa_mpjpe_mm.p95) for r in rows]),
        ("max", 2, [short(r.pa_mpjpe_mm.max) for r in rows]),
        ("MPJPE", 4, [short(r.mpjpe_mm.mean) for r in rows]),
        ("AUC", 1, auc),
        ("jitter", 5, with_range(jitters, [i.mean if i else None for i in shaky])),
    ]


def _console() -> Console:
    from rich.console import Console

    console = Console(highlight=False)
    if console.is_terminal:
        return console
    return Console(highlight=False, width=160)  # a file or a pipe has no width to keep to


def _print_paper(
    paper: PaperRows | None, ours: list[tuple[str, Stability]], console: Console
) -> None:
    """The paper's rows above ours."""
    if paper is None:
        return
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title="Beside the paper: PA-MPJPE, mm")
    for heading in ("", "mean", "std"):
        table.add_column(heading, justify="right" if heading else "left")
    for row in paper.published:
        table.add_row(row.name, f"{row.mean_mm:.4f}", f"{row.std_mm:.4f}")
    for name, own in ours:
        spread = own.pa_mpjpe_mm
        table.add_row(escape(name), f"{spread.mean:.4f}", f"{spread.std:.4f}", style="bold")
    console.print(table)
    console.print(paper.caution, style="dim")


def _sure(row: Stability) -> str:
    """How sure the overall error is."""
    found = row.intervals.get("pa_mpjpe_mm")
    if found is None:
        return ""
    if found.few:
        return f"Overall PA-MPJPE {short(found.mean.value)} without an interval: {found.few}."
    return (
        f"Overall PA-MPJPE {short(found.mean.value)}{with_limits(found.mean)}, std"
        f" {short(found.std.value)}{with_limits(found.std)}: 95 % intervals, block bootstrap of"
        f" {found.block} frames."
    )
