"""Sequences through the paper's method, ours, the baselines and each filter: one table.

    python -m tools.bench.compare_methods [FILE OR FOLDER ...] [--fast] [--markdown MD] [--json OUT]

Without arguments: the sample, and motion like the sample's by another hand with noise of 2 and
5 mm. Errors are PA-MPJPE in mm, mean and standard deviation over frames: against the truth where
there is one, else against the observed joints, and then they say how well the hand explains its
input. Jitter is the output's, in m/s^3. For the baselines, and for them only, single joints that
are missing for up to five frames are put in between their neighbours in time; the MLP needs all 21.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import handtrack as ht
from handtrack.calibration.calibrate import calibrate
from handtrack.evaluation.compare import compare
from handtrack.evaluation.measure import Estimate
from handtrack.evaluation.results import StabilityReport
from handtrack.hand.model import HandModel
from tools.paper import baselines

Array = NDArray[np.float64]
Reports = dict[str, StabilityReport]

LONGEST_GAP = 5
TRACKED: dict[str, tuple[str, dict[str, Any]]] = {
    "exact": ("anatomical", {}),
    "li2021": ("li2021", {"update": "li2021", "calibrate": False}),
    "li2021, calibrated": ("li2021", {"update": "li2021", "calibrate": "proportions"}),
    "exact + one-euro": ("anatomical", {"filter": "one-euro"}),
    "exact + kalman": ("anatomical", {"filter": "kalman"}),
    "exact + rts": ("anatomical", {"filter": "rts"}),
}
"""Method -> limits and settings of `track`; the first is what the others are compared with."""
BASELINES: dict[str, baselines.Baseline] = {"GDC": "gdc", "GDC, PCA": "gdc-pca", "MLP": "mlp"}
"""On the scaled hand under the paper's limits, as li2021."""


def tracked(sequence: ht.Sequence, limits: str, settings: dict[str, Any]) -> StabilityReport:
    """A sequence tracked by one method, measured."""
    return ht.stability(ht.track(sequence, HandModel.default(sequence.hand, limits), **settings))


def baseline(sequence: ht.Sequence, method: baselines.Baseline) -> StabilityReport:
    """A sequence fitted by a baseline, frame by frame, measured."""
    model = calibrate(HandModel.default(sequence.hand, "li2021"), sequence, "scale").model
    joints = baselines.fit_batch(model, filled(sequence.joints), method).joints
    # where nothing was seen there is nothing to be judged
    seen = int((~np.isnan(joints).all((1, 2))).sum())
    return ht.stability(
        Estimate(
            sequence.name,
            sequence.hand,
            sequence.time_ns,
            sequence.frame_index,
            joints,
            (seen, 0, len(joints) - seen),
            sequence.joints,
            sequence.truth,
        )
    )


def filled(joints: Array) -> Array:
    """Joints (T, 21, 3) with short gaps of single joints closed by lines."""
    out = joints.copy()
    whole = ~np.isnan(joints[..., 0])
    some = whole.sum(1) >= 10
    frames = np.arange(len(joints))
    for j in range(joints.shape[1]):
        known = np.flatnonzero(whole[:, j])
        if len(known) < 2:
            continue
        after = np.searchsorted(known, frames).clip(1, len(known) - 1)
        near = known[after] - known[after - 1] <= LONGEST_GAP + 1
        gap = ~whole[:, j] & some & near & (frames > known[0]) & (frames < known[-1])
        for axis in range(3):
            out[gap, j, axis] = np.interp(frames[gap], known, joints[known, j, axis])
    return out


def named(sequence: ht.Sequence) -> ht.Sequence:
    """A sequence named after its folder too."""
    folder = Path(sequence.source).parent.name
    return replace(sequence, name=f"{folder}: {sequence.name}")


def synthetic() -> list[ht.Sequence]:
    """The sample, and longer motion by another hand at two noises, with its truth."""
    from tools.make.sample import motion, subject_hand

    root = Path(__file__).resolve().parents[2]
    out = ht.load(root / "recordings" / "sample.npz")
    for sigma in (2.0, 5.0):
        rng = np.random.default_rng(7)
        truth = subject_hand(rng).joints(*motion(20.0, 30.0, rng))
        seen = truth + rng.normal(0.0, 1e-3 * sigma, truth.shape)
        time_ns = np.rint(np.arange(len(truth)) * 1e9 / 30.0).astype(np.int64)
        made = ht.Sequence(time_ns, seen, truth=truth, name=f"made, {sigma:g} mm")
        out.append(replace(made, source="made"))
    return out


def study(sequences: list[ht.Sequence], fast: bool, said: Callable[[str], None]) -> list[Reports]:
    """Every sequence by every method."""
    out = []
    for sequence in sequences:
        said(f"{sequence.name}: {len(sequence)} frames")
        reports = {name: tracked(sequence, *how) for name, how in TRACKED.items()}
        if not fast:
            reports |= {name: baseline(sequence, method) for name, method in BASELINES.items()}
        out.append(reports)
    return out


def cells(reports: Reports) -> list[str]:
    """One row of the table, without the name."""
    first = next(iter(reports.values())).overall
    out = [str(first.frames), first.against]
    for report in reports.values():
        row = report.overall
        spread = row.pa_mpjpe_mm
        known = np.isfinite(spread.mean)
        errors = f"{spread.mean:.2f} ± {spread.std:.2f}; {_short(row.jitter_m_s3)}"
        out.append(errors if known else "-")
    return out


def _short(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def headings(reports: Reports) -> list[str]:
    """Of the table."""
    return ["sequence", "frames", "against", *reports]


def markdown(rows: list[list[str]], names: list[str]) -> str:
    """The table for the README."""
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows), ""])


def main(arguments: list[str] | None = None) -> list[Reports]:
    """Run the methods, print the table and what differs for sure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("inputs", nargs="*", type=Path, metavar="FILE OR FOLDER")
    parser.add_argument("--fast", action="store_true", help="without the baselines")
    parser.add_argument("--frames", type=int, help="at most so many frames of each")
    parser.add_argument("--sentences", action="store_true", help="what is clear, in words")
    parser.add_argument("--markdown", type=Path, metavar="OUT.md")
    parser.add_argument("--json", type=Path, metavar="OUT")
    options = parser.parse_args(arguments)
    sequences = [named(s) for path in options.inputs for s in ht.load(path)] or synthetic()
    if options.frames:
        last = options.frames - 1
        sequences = [s.frames(s.frame_index[0], s.frame_index[0] + last) for s in sequences]
    console = Console() if Console().is_terminal else Console(width=200)
    results = study(sequences, options.fast, lambda text: console.print(text, style="dim"))
    for sequence, reports in zip(sequences, results, strict=True):
        if options.sentences:
            console.print(f"\n{sequence.name}")
            some = {name: r for name, r in reports.items() if r.overall.compared}
            for difference in compare(some).differences:
                if difference.measure == "pa_mpjpe_mm":
                    console.print(difference.sentence)
    rows = [
        [sequence.name, *cells(reports)]
        for sequence, reports in zip(sequences, results, strict=True)
    ]
    names = headings(results[0])
    table = Table(title="PA-MPJPE, mm, mean ± std over frames; jitter, m/s³")
    for i, name in enumerate(names):
        table.add_column(name, justify="left" if i in (0, 2) else "right")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    if options.markdown:
        options.markdown.write_text(markdown(rows, names))
    if options.json:
        document = [
            {"sequence": s.name, "methods": {n: r.overall.to_dict() for n, r in reports.items()}}
            for s, reports in zip(sequences, results, strict=True)
        ]
        options.json.write_text(json.dumps(document, indent=1) + "\n")
    return results


if __name__ == "__main__":
    main()
