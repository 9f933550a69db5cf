"""Columns of printed reports: what stands in their cells, and which of them fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from handtrack.evaluation.bootstrap import Uncertain
from handtrack.evaluation.results import Spread, Stability

Kind = TypeVar("Kind")
MUST = 9
"""Importance of what is never left out."""
_GAP = 3
"""Characters between two columns."""
_NAME = 20
"""Longer names may be folded."""


def with_limits(of: Uncertain | None) -> str:
    """An interval in brackets; nothing where there is none."""
    if of is None or not np.isfinite(of.low):
        return ""
    return f" [{short(of.low)}, {short(of.high)}]"


def fitting(
    columns: list[Kind], about: Callable[[Kind], tuple[str, int, int]], width: int
) -> tuple[list[Kind], list[str]]:
    """The columns that fit a width, and the headings of those left out, least important first.

    Args:
        columns: all of them.
        about: heading, importance and width of one.
        width: of all.
    """
    left, left_out = [(*about(c), c) for c in columns], []
    while sum(c[2] + _GAP for c in left) > width:
        least = min(left, key=lambda c: c[1])
        if least[1] >= MUST:
            break
        left.remove(least)
        left_out.append(least[0])
    return [c[3] for c in left], left_out


@dataclass(frozen=True)
class Column:
    """A column of the table of sequences: heading, importance, text of a row's cell."""

    heading: str
    importance: int
    cell: Callable[[Stability], str]

    def width(self, rows: list[Stability]) -> int:
        """Characters of its widest cell."""
        longest = max(len(self.heading), *(len(self.cell(r)) for r in rows))
        return min(longest, _NAME) if self.heading == "sequence" else longest


def that_fit(rows: list[Stability], width: int) -> tuple[list[Column], list[str]]:
    """The columns for that width, and the headings of those left out."""
    columns = [c for c in _COLUMNS if any(c.cell(r).strip("-") for r in rows)]
    if len({r.against for r in rows}) == 1:
        columns = [c for c in columns if c.heading != "against"]  # the caption says it
    return fitting(columns, lambda c: (c.heading, c.importance, c.width(rows)), width)


def percent(count: int, frames: int) -> str:
    """A share of all frames."""
    if not count:
        return "0"
    share = 100 * count / frames
    return f"{share:.1f} %" if share >= 0.1 else "<0.1 %"


def mean_std(spread: Spread | None) -> str:
    """Mean and standard deviation over frames."""
    if spread is None:
        return ""
    return f"{short(spread.mean)} ± {short(spread.std)}" if np.isfinite(spread.mean) else "-"


def _with_input(output: float, given: float) -> str:
    return f"{short(output)} ({short(given)})" if np.isfinite(given) else short(output)


def _shaking(row: Stability, name: str, unit: str) -> str:
    if row.shake is None:
        return ""
    given = float("nan") if row.input_shake is None else getattr(row.input_shake, name)
    return f"{_with_input(getattr(row.shake, name), given)} {unit}"


def short(value: float) -> str:
    """A number with as many places as people read; a dash where there is none."""
    if not np.isfinite(value):
        return "-"
    return f"{value:.2f}" if abs(value) < 100 else f"{value:,.0f}"


_COLUMNS: tuple[Column, ...] = (
    Column("sequence", MUST, lambda r: r.name),
    Column("hand", 5, lambda r: r.hand),
    Column("frames", MUST, lambda r: f"{r.frames:,}"),
    Column("predicted", 4, lambda r: percent(r.predicted, r.frames)),
    Column("lost", MUST, lambda r: percent(r.lost, r.frames)),
    Column("against", MUST, lambda r: r.against),
    Column("PA-MPJPE", MUST, lambda r: mean_std(r.pa_mpjpe_mm)),
    Column("median", 0, lambda r: short(r.pa_mpjpe_mm.median)),
    Column("p95", 2, lambda r: short(r.pa_mpjpe_mm.p95)),
    Column("max", 1, lambda r: short(r.pa_mpjpe_mm.max)),
    Column("reprojection, px", MUST, lambda r: mean_std(r.reprojection_px)),
    Column("input", 6, lambda r: mean_std(r.input_pa_mpjpe_mm)),
    Column("MPJPE", 7, lambda r: short(r.mpjpe_mm.mean)),
    Column("jitter", 8, lambda r: _with_input(r.jitter_m_s3, r.input_jitter_m_s3)),
    Column("hand shakes", 2, lambda r: _shaking(r, "palm_mm", "mm")),
    Column("fingers shake", 2, lambda r: _shaking(r, "fingers_deg", "°")),
    Column(
        "acceleration", 3, lambda r: _with_input(r.acceleration_m_s2, r.input_acceleration_m_s2)
    ),
)
