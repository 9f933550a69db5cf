"""A stability report as people and as machines read it: a table, and JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from handtrack.evaluation.results import Spread, Stability, StabilityReport

if TYPE_CHECKING:
    from rich.console import Console

_MEANING = {
    "truth": "Against the truth: the error of the output.",
    "observed": (
        "Against the observed joints: how well the hand explains what it was given, noise"
        " included. This is not accuracy."
    ),
}
_GAP = 3
"""Characters between two columns."""
_NAME = 20
"""Longer names may be folded."""


def to_json(report: StabilityReport) -> str:
    """The report as one JSON object; what is not known is null.

    {"sequences": [{"name", "hand", "frames", "fitted", "predicted", "lost", "against",
    "pa_mpjpe_mm": {"mean", "std", "median", "p95", "max"}, "mpjpe_mm": {...}, "jitter_m_s3",
    "acceleration_m_s2", ...}], "overall": {...}}
    """
    return json.dumps(report.to_dict(), indent=2, allow_nan=False)


def print_table(report: StabilityReport, console: Console | None = None) -> None:
    """Print one row per sequence, the pooled row if there are several, and what they mean.

    Columns that do not fit the console are left out, the least important first, and named.

    Args:
        report: the report.
        console: where to print; standard output by default.
    """
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    if console is None:
        console = Console(highlight=False)
        if not console.is_terminal:  # a file or a pipe has no width to keep to
            console = Console(highlight=False, width=160)
    several = len(report.sequences) > 1
    rows = [*report.sequences, report.overall] if several else list(report.sequences)
    columns, left_out = _that_fit(rows, console.width)
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
        console.print(_MEANING[against], style="dim")
    if any(r.input_pa_mpjpe_mm for r in rows):
        console.print("Input: the error of the observed joints to the same truth.", style="dim")
    console.print(
        "Errors in mm (mean ± std over frames): PA-MPJPE after similarity alignment of each frame,"
        " MPJPE without. Jitter in m/s³ and acceleration in m/s²: output (input).",
        style="dim",
    )
    if left_out:
        console.print(f"Left out for lack of width: {', '.join(left_out)}.", style="dim")
    for row in rows:
        for note in row.notes:
            console.print(f"{escape(row.name)}: {escape(note)}", style="yellow")


_MUST = 9


@dataclass(frozen=True)
class _Column:
    heading: str
    importance: int
    cell: Callable[[Stability], str]

    def width(self, rows: list[Stability]) -> int:
        longest = max(len(self.heading), *(len(self.cell(r)) for r in rows))
        return min(longest, _NAME) if self.heading == "sequence" else longest


def _that_fit(rows: list[Stability], width: int) -> tuple[list[_Column], list[str]]:
    """The columns for that width, and the headings of those left out."""
    columns = [c for c in _COLUMNS if any(c.cell(r) for r in rows)]
    if len({r.against for r in rows}) == 1:
        columns = [c for c in columns if c.heading != "against"]  # the caption says it

    def needed() -> int:
        return sum(column.width(rows) + _GAP for column in columns)

    left_out: list[str] = []
    while needed() > width:
        least = min(columns, key=lambda c: c.importance)
        if least.importance >= _MUST:
            break
        columns.remove(least)
        left_out.append(least.heading)
    return columns, left_out


def _percent(count: int, frames: int) -> str:
    if not count:
        return "0"
    share = 100 * count / frames
    return f"{share:.1f} %" if share >= 0.1 else "<0.1 %"


def _mean_std(spread: Spread | None) -> str:
    return "" if spread is None else f"{_short(spread.mean)} ± {_short(spread.std)}"


def _with_input(output: float, given: float) -> str:
    return f"{_short(output)} ({_short(given)})" if np.isfinite(given) else _short(output)


def _short(value: float) -> str:
    if not np.isfinite(value):
        return "-"
    return f"{value:.2f}" if abs(value) < 100 else f"{value:,.0f}"


_COLUMNS: tuple[_Column, ...] = (
    _Column("sequence", _MUST, lambda r: r.name),
    _Column("hand", 5, lambda r: r.hand),
    _Column("frames", _MUST, lambda r: f"{r.frames:,}"),
    _Column("predicted", 4, lambda r: _percent(r.predicted, r.frames)),
    _Column("lost", _MUST, lambda r: _percent(r.lost, r.frames)),
    _Column("against", _MUST, lambda r: r.against),
    _Column("PA-MPJPE", _MUST, lambda r: _mean_std(r.pa_mpjpe_mm)),
    _Column("p95", 2, lambda r: _short(r.pa_mpjpe_mm.p95)),
    _Column("max", 1, lambda r: _short(r.pa_mpjpe_mm.max)),
    _Column("input", 6, lambda r: _mean_std(r.input_pa_mpjpe_mm)),
    _Column("MPJPE", 7, lambda r: _short(r.mpjpe_mm.mean)),
    _Column("jitter", 8, lambda r: _with_input(r.jitter_m_s3, r.input_jitter_m_s3)),
    _Column(
        "acceleration", 3, lambda r: _with_input(r.acceleration_m_s2, r.input_acceleration_m_s2)
    ),
)
