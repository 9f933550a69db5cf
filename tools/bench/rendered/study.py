"""What brings detections nearer to the truth: every method on every clip, with intervals."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import handtrack as ht
from tools.bench.rendered.cases import Case, cases
from tools.bench.rendered.layout import Clip
from tools.bench.rendered.measures import Interval, measure, summary
from tools.bench.rendered.methods import RAW, Estimate, Method, standard

Row = dict[str, Any]


def study(
    clips: list[Clip],
    methods: Callable[[list[Case]], dict[str, Method]] = standard,
    camera: int = 0,
    progress: Callable[[str], None] | None = None,
) -> list[Row]:
    """A row for each clip, input and method.

    Args:
        clips: detections and truth.
        methods: makes the methods, once all cases are known.
        camera: whose world landmarks are one camera's input.
        progress: told the name of each case as it begins.
    """
    given = [case for clip in clips for case in cases(clip, camera)]
    rowed = methods(given)
    rows: list[Row] = []
    for case in given:
        if progress:
            progress(f"{case.clip.name}, {case.input}")
        for name, method in rowed.items():
            failed = ""
            try:
                estimate = method(case)
            except ht.HandtrackError as error:
                failed = str(error)
                estimate = Estimate(np.full_like(case.joints, np.nan), None)
            row: Row = {"clip": case.clip.name, "input": case.input, "method": name}
            row |= {"motion": case.clip.motion, "failed": failed, "note": estimate.note}
            rows.append(row | measure(estimate.joints, estimate.angles, case))
    return rows


def summaries(rows: list[Row]) -> list[Row]:
    """One row for each input and method: means over clips, and ratios to raw."""
    out = []
    for given in dict.fromkeys(row["input"] for row in rows):
        mine = [row for row in rows if row["input"] == given]
        raw = [row for row in mine if row["method"] == RAW]
        for method in dict.fromkeys(row["method"] for row in mine):
            group = [row for row in mine if row["method"] == method]
            out.append({"input": given, "method": method} | summary(group, raw))
    return out


_COLUMNS = ("PA-MPJPE", "x raw", "nearer", "moving", "x raw", "acc.", "jitter", "truth's", "angles")


def table(given: str, rows: list[Row]) -> Table:
    """The summaries of one input."""
    clips = max(row["clips"] for row in rows)
    out = Table(title=f"{given}: {clips} clips; mm, m/s², m/s³, degrees; 95 % over clips")
    out.add_column("method")
    for column in _COLUMNS:
        out.add_column(column, justify="right")
    for row in rows:
        name = row["method"] + (f" ({row['failed']} failed)" if row["failed"] else "")
        if not row["clips"]:
            out.add_row(name, *["-"] * len(_COLUMNS))
            continue
        out.add_row(
            name,
            _text(row["pa_mm"], 2, False),
            _text(row["pa_mm_ratio"], 3),
            f"{100 * row['nearer']:.0f} %",
            _text(row["moving_mm"], 2, False),
            _text(row["moving_mm_ratio"], 3),
            _text(row["acceleration"], 2, False),
            _text(row["jitter"], 0, False),
            _text(row["jitter_truth"], 0, False),
            _text(row["angle_deg"], 1, False),
        )
    return out


def _text(number: Interval, digits: int, interval: bool = True) -> str:
    if not np.isfinite(number.value):
        return "-"
    text = f"{number.value:.{digits}f}"
    return f"{text} {number.low:.{digits}f}-{number.high:.{digits}f}" if interval else text


def say(rows: list[Row], console: Console) -> None:
    """Print the tables of all inputs, and what failed."""
    overall = summaries(rows)
    for given in dict.fromkeys(row["input"] for row in overall):
        console.print(table(given, [row for row in overall if row["input"] == given]))
    for row in rows:
        if row["failed"]:
            console.print(f"{row['clip']}, {row['input']}, {row['method']}: {row['failed']}")


def write_json(rows: list[Row], path: Path) -> None:
    """Summaries and rows; numbers that are none are null."""
    content = {"overall": summaries(rows), "rows": rows}
    path.write_text(json.dumps(_finite(content), indent=1, allow_nan=False) + "\n")


def write_overall(rows: list[Row], path: Path) -> None:
    """The summaries alone, as the documentation's tables take them."""
    path.write_text(json.dumps(_finite(summaries(rows)), indent=1, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, Interval):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
