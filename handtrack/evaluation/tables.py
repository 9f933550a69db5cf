"""Reports as files for other programs: CSV, and a LaTeX table; with the numbers that Li et al.
2021 publish, to stand beside ours."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handtrack.evaluation.compare import Comparison
from handtrack.evaluation.results import Spread, Stability, StabilityReport

Report = StabilityReport | Comparison


def labelled_rows(report: Report) -> list[tuple[str, Stability]]:
    """Every row with its method ("" where there is only one): sequences, then overall.

    Of a comparison the overall rows are those of the common frames.
    """
    if isinstance(report, StabilityReport):
        several = len(report.sequences) > 1
        return [("", r) for r in (*report.sequences, *([report.overall] if several else []))]
    rows = [(name, r) for name, part in report.methods.items() for r in part.sequences]
    return rows + [(name, row_named(row, "common frames")) for name, row in report.common.items()]


def row_named(row: Stability, name: str) -> Stability:
    """The same numbers under another name."""
    from dataclasses import replace

    return replace(row, name=name)


def to_csv(report: Report) -> str:
    """One line per sequence (and method), and per pool of them, which `scope` tells apart:
    "sequence", "all sequences", "common frames"; empty = not known."""
    own = report.sequences if isinstance(report, StabilityReport) else ()
    singles = {id(row) for row in own}
    if isinstance(report, Comparison):
        singles = {id(row) for part in report.methods.values() for row in part.sequences}
    pooled = "common frames" if isinstance(report, Comparison) else "all sequences"
    flat = [
        {"method": method, "scope": "sequence" if id(row) in singles else pooled}
        | _flat(row.to_dict() | {"notes": "; ".join(row.notes)})
        for method, row in labelled_rows(report)
    ]
    columns = list(dict.fromkeys(key for row in flat for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _flat(values: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out |= _flat(value, f"{before}{key}.")
        elif isinstance(value, list):
            for side, part in zip(("low", "high"), value, strict=True):
                out[f"{before}{key}.{side}"] = part
        else:
            out[before + key] = value
    return out


_LATEX: tuple[tuple[str, Callable[[Stability], float | Spread]], ...] = (
    ("PA-MPJPE", lambda r: r.pa_mpjpe_mm),
    ("p95", lambda r: r.pa_mpjpe_mm.p95),
    ("MPJPE", lambda r: r.mpjpe_mm),
    ("jitter", lambda r: r.jitter_m_s3),
    (r"lost (\%)", lambda r: 100 * r.lost / r.frames),
)


def to_latex(report: Report) -> str:
    """A booktabs table; of a comparison, one row per method, the best of each column bold."""
    if isinstance(report, Comparison):
        lost = {
            name: 100 * part.overall.lost / part.overall.frames
            for name, part in report.methods.items()
        }
        rows = list(report.common.items())
        cells = [[read(row) for _, read in _LATEX[:-1]] + [lost[name]] for name, row in rows]
        labels = [name for name, _ in rows]
        best = [min(map(_value, column)) for column in zip(*cells, strict=True)]
        about = f"{report.frames} common frames"
    else:
        singles = [row for _, row in labelled_rows(report)]
        cells = [[read(row) for _, read in _LATEX] for row in singles]
        labels = [row.name for row in singles]
        best = [-np.inf] * len(_LATEX)
        about = f"{report.overall.frames} frames"
    against = {row.against for _, row in labelled_rows(report)}
    lines = [
        f"% handtrack stability: {about}, against {' and '.join(sorted(against))}.",
        "% mm, mean (standard deviation) over frames; jitter in m/s^3.",
        rf"\begin{{tabular}}{{l{'r' * len(_LATEX)}}}",
        r"\toprule",
        " & ".join(["", *(heading for heading, _ in _LATEX)]) + r" \\",
        r"\midrule",
    ]
    for label, row_cells in zip(labels, cells, strict=True):
        shown = [
            _latex_cell(cell, _value(cell) == b) for cell, b in zip(row_cells, best, strict=True)
        ]
        lines.append(" & ".join([_escaped(label), *shown]) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def _value(cell: float | Spread) -> float:
    value = cell.mean if isinstance(cell, Spread) else cell
    return value if np.isfinite(value) else float("inf")


def _latex_cell(cell: float | Spread, best: bool) -> str:
    if not np.isfinite(_value(cell)):
        return "--"
    text = f"{cell.mean:.2f} ({cell.std:.2f})" if isinstance(cell, Spread) else f"{cell:.2f}"
    return rf"\textbf{{{text}}}" if best else text


def _escaped(text: str) -> str:
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    special |= {c: f"\\{c}" for c in "&%$#_{}"}
    return "".join(special.get(c, c) for c in text)


PANOPTIC_SEQUENCE = "171204_pose6"
PANOPTIC_FRAMES = (20701, 20800)


@dataclass(frozen=True)
class Published:
    """A row of the paper.

    Attributes:
        name: the method.
        mean_mm, std_mm: PA-MPJPE over frames.
    """

    name: str
    mean_mm: float
    std_mm: float


PANOPTIC = (
    Published("FrankMocap, as in the paper", 5.3442, 0.5151),
    Published("Li et al. 2021, as in the paper", 5.3302, 0.4320),
)
"""The Visual Computer, doi 10.1007/s00371-021-02250-y, section on sequences: CMU Panoptic
171204_pose6, frames 20701..20800."""


@dataclass(frozen=True)
class PaperRows:
    """The paper's rows and what must be known to read them beside ours.

    Attributes:
        published: the paper's.
        caution: how ours differ from them.
    """

    published: tuple[Published, ...]
    caution: str

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "published": [vars(p) for p in self.published],
            "caution": self.caution,
        }


def panoptic_rows(rows: Iterable[Stability]) -> PaperRows | None:
    """The paper's rows for its Panoptic sequence; None if these are other sequences."""
    found = [r for r in rows if PANOPTIC_SEQUENCE in r.name]
    if not found:
        return None
    first, last = PANOPTIC_FRAMES
    caution = "The paper's estimates come from images"
    if found[0].against == "observed":
        caution += "; here the hand is fitted to the annotated joints themselves"
    caution += "."
    numbers = [r.material.frame_index for r in found if r.material is not None]
    if any((n[0], n[-1]) != (first, last) for n in numbers):
        here = f"{numbers[0][0]}:{numbers[0][-1]}"
        caution += f" The paper's frames are {first}:{last}, these are {here}."
    return PaperRows(PANOPTIC, caution)
