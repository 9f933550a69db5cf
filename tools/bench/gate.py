"""Hold a benchmark's numbers against the committed ones, and say what got worse by how much.

    python -m tools.bench.benchmark --json now.json
    python -m tools.bench.gate now.json               exit status 1 where something got worse
    python -m tools.bench.gate now.json --update      make it the baseline

Compared are ratios of times of one run, never times: how many times as long another solver takes
on the same frames, and what the tool's steps take in frames of scipy's fit. Beside them stand
shares that no machine changes, as of poses that end in the best optimum.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

BASELINE = Path(__file__).with_name("baseline.json")
SPEED, EXACT = 0.25, 0.002
"""How much worse a ratio of times may be before it is said, and a number that is no time."""


@dataclass(frozen=True)
class Measure:
    """A number of a run.

    Attributes:
        name: what it is.
        value: the number.
        better: "more" or "less".
        within: how much worse it may be, as a share.
    """

    name: str
    value: float
    better: str
    within: float

    def worse(self, before: float) -> float:
        """By which share it is worse than before; below zero where it is better."""
        if before == 0 or self.value == 0:
            return 0.0 if before == self.value else float("inf")
        return before / self.value - 1 if self.better == "more" else self.value / before - 1


def measures(document: dict[str, Any]) -> list[Measure]:
    """What of a benchmark's JSON can be compared with another run's.

    Raises:
        KeyError: it lacks a part.
    """
    rows = [row for table in document["fit"].values() for row in table if "median us" in row]
    found = list(_solvers(rows))
    scipy = next(
        row["median us"]
        for row in rows
        if row["solver"].startswith("scipy") and row["start"] == "frame before"
    )
    found += _motions(*document["motion"].values())
    found += _optima(*document["quality"].values())
    tool = next(iter(document["tool"].values()))
    found += [
        Measure(
            f"{row['what']}, a frame in fits of scipy's", row["us/frame"] / scipy, "less", SPEED
        )
        for row in tool
    ]
    return found + [
        Measure(f"{row['what']}, kB a frame", row["kB/frame"], "less", EXACT)
        for row in tool
        if "kB/frame" in row
    ]


def _solvers(rows: list[dict[str, Any]]) -> Iterator[Measure]:
    for row in rows:
        name = f"{row['solver']} from the {row['start']}"
        if row["x ours"] == 1.0:
            continue
        ours = row["solver"].startswith("ours")
        yield Measure(f"{name}, times ours", row["x ours"], "less" if ours else "more", SPEED)
        yield Measure(f"{name}, objective of ours", row["of ours"], "more", EXACT)


def _motions(warm: list[dict[str, Any]], cold: list[dict[str, Any]]) -> Iterator[Measure]:
    for rows, kind, call in ((warm, "motion", "step()"), (cold, "cold poses", "fit()")):
        for row in rows:
            name, median = f"{kind}, {row['noise mm']:g} mm", row["median us"]
            yield Measure(f"{name}: p99 over median", row["p99 us"] / median, "less", 2 * SPEED)
            each = row[f"{call} median us"] / median
            yield Measure(f"{name}: {call} over the compiled fit", each, "less", SPEED)


def _optima(rows: list[dict[str, Any]]) -> Iterator[Measure]:
    for row in rows:
        yield Measure(
            f"cold poses, {row['noise mm']:g} mm: % in the best optimum",
            row["optimum %"],
            "more",
            EXACT,
        )


def compare(now: list[Measure], before: dict[str, float], console: Console) -> list[str]:
    """Print every number beside the one before.

    Returns:
        A line for each that is worse than it may be, or is gone.
    """
    table = Table(title="against the baseline", title_justify="left")
    for column in ("what", "before", "now", "worse by"):
        table.add_column(column, justify="left" if column == "what" else "right")
    told = []
    for measure in now:
        if measure.name not in before:
            table.add_row(measure.name, "", f"{measure.value:.4g}", "new")
            continue
        old, worse = before[measure.name], measure.worse(before[measure.name])
        table.add_row(measure.name, f"{old:.4g}", f"{measure.value:.4g}", f"{100 * worse:+.1f} %")
        if worse > measure.within:
            told.append(
                f"{measure.name}: {old:.4g} -> {measure.value:.4g}, worse by {100 * worse:.0f} %"
                f" (up to {100 * measure.within:g} % is noise)"
            )
    console.print(table)
    named = {measure.name for measure in now}
    return told + [f"{name}: not measured" for name in before if name not in named]


def main(arguments: list[str] | None = None) -> int:
    """Compare, or update the baseline; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("numbers", type=Path, help="what benchmark.py --json wrote")
    parser.add_argument("--baseline", type=Path, default=BASELINE)
    parser.add_argument("--update", action="store_true", help="make these numbers the baseline")
    options = parser.parse_args(arguments)
    document = json.loads(options.numbers.read_text())
    try:
        now = measures(document)
    except KeyError as error:
        print(
            f"{options.numbers}: part {error} is missing: run the benchmark whole", file=sys.stderr
        )
        return 2
    if options.update:
        kept = {"machine": document["machine"], "ratios": {m.name: m.value for m in now}}
        options.baseline.write_text(json.dumps(kept, indent=1) + "\n")
        print(f"{options.baseline}: {len(now)} ratios")
        return 0
    before = json.loads(options.baseline.read_text())["ratios"]
    told = compare(now, before, Console(width=None if sys.stdout.isatty() else 130))
    for line in told:
        print(line)
    print(f"{len(told)} of {len(before)} got worse" if told else f"none of {len(before)} got worse")
    return 1 if told else 0


if __name__ == "__main__":
    sys.exit(main())
