"""The report of a data set as one web page."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from handtrack import __version__
from handtrack.batching import plots
from handtrack.batching.data_set import Report
from handtrack.batching.sums import Sure
from handtrack.batching.two_runs import Comparison
from handtrack.evaluation.bootstrap import Uncertain

TITLES = {
    "pa_mpjpe_mm": ("PA-MPJPE", "mm"),
    "pa_mpjpe_std_mm": ("its std", "mm"),
    "jitter_m_s3": ("jitter", "m/s³"),
    "input_jitter_m_s3": ("input jitter", "m/s³"),
    "input_pa_mpjpe_mm": ("input PA-MPJPE", "mm"),
    "residual_mm": ("residual", "mm"),
    "bound_mm": ("bound", "mm"),
    "lost_percent": ("lost", "%"),
}
"""Measures as people read them, with units."""
_SPOKEN = {
    "pa_mpjpe_std_mm": ("the std of PA-MPJPE", "mm"),
    "lost_percent": ("the share of lost frames", "points"),
}
AGAINST = {
    "truth": "Errors are against the truth.",
    "observed": "Errors are against the observed joints: how well the hand explains what it was"
    " given, noise included. This is not accuracy.",
    "nothing": "There is nothing to measure errors against.",
}
_FAILED = 200
_STYLE = (
    "<style>th.words, td.words { text-align: left }"
    " td.words { white-space: normal; overflow-wrap: anywhere }</style>"
)


def shown(value: Uncertain) -> str:
    """A value with its interval, as text."""
    if not np.isfinite(value.value):
        return "–"
    text = number(value.value)
    if np.isfinite(value.low) and value.high > value.low:
        text += f" [{number(value.low)}, {number(value.high)}]"
    return text


def number(value: float) -> str:
    """Three digits, as 0.667, 4.40, 31.1 and 311; all of a large number: 2,130."""
    if not value:
        return "0"
    # rounding may carry: 9.996 is 10.0
    whole = int(np.floor(np.log10(float(f"{abs(value):.2e}")))) + 1
    return f"{value:,.{min(max(3 - whole, 0), 6)}f}"


def page(report: Report | Comparison) -> str:
    """The report: numbers, plots, the worst clips, what failed."""
    if isinstance(report, Comparison):
        title, body = " and ".join(report.names), _compared(report)
    else:
        title, body = report.results.place, _alone(report)
    look = files("handtrack.evaluation").joinpath("page.html").read_text(encoding="utf-8")
    style = re.search(r"<style>.*?</style>", look, re.DOTALL)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)} – handtrack</title>{style[0] if style else ''}{_STYLE}</head>"
        "<body><main>"
        f"<header><h1>{escape(title)}</h1>{body}"
        f"<footer>handtrack {__version__}. Intervals: 95 %, by a bootstrap over subjects, then"
        " over the clips of each.</footer></main></body></html>"
    )


def _section(title: str, hint: str, inside: str) -> str:
    if not inside:
        return ""
    return f'<section><h2>{escape(title)}</h2><p class="hint">{escape(hint)}</p>{inside}</section>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], words: Sequence[str] = ()) -> str:
    """A table of cells that are HTML; columns of words begin at the left, numbers end together."""
    sides = [' class="words"' if name in words else "" for name in head]
    top = "".join(f"<th{s}>{escape(cell)}</th>" for s, cell in zip(sides, head, strict=True))
    body = "".join(
        "<tr>"
        + "".join(f"<td{s}>{cell}</td>" for s, cell in zip(sides, row, strict=True))
        + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><tr>{top}</tr>{body}</table></div>'


def _head(*first: str) -> list[str]:
    return [*first, "clips", "frames", *(f"{name} [{unit}]" for name, unit in TITLES.values())]


def _cells(group: Sure) -> list[str]:
    return [f"{group.clips:,}", f"{group.frames:,}", *_values(group.values)]


def _values(values: Mapping[str, Uncertain]) -> list[str]:
    """Cells of the measures, each with its interval below it."""
    cells = []
    for name in TITLES:
        value, space, interval = shown(values[name]).partition(" ")
        cells.append(escape(value) + (f"<br><small>{escape(interval)}</small>" if space else ""))
    return cells


def _scope(report: Report) -> str:
    of = report.overall
    people = f" of {of.subjects:,} subjects" if report.results.units.known else ""
    return f"{of.clips:,} clips{people}, {of.frames:,} frames{_bad(report)}. {_meaning(report)}"


def _bad(report: Report) -> str:
    return f", {len(report.results.failed):,} failed" if report.results.failed else ""


def _meaning(*reports: Report) -> str:
    against = {name for r in reports for name in r.results.table["against"].to_pylist()}
    return " ".join(AGAINST.get(name, "") for name in sorted(against))


def _notes(notes: Sequence[str]) -> str:
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return f'<ul class="notes">{items}</ul>' if items else ""


def _alone(report: Report) -> str:
    results = report.results
    parts = [f"<p>{escape(_scope(report))}</p></header>", _notes(results.notes)]
    parts.append(
        _section(
            "Overall", "All frames pooled.", _table(_head(""), [["all", *_cells(report.overall)]])
        )
    )
    values, label = _clip_values(report)
    parts.append(
        _section("Clips", "How many clips have which error.", plots.histogram([values], label))
    )
    parts += [_group(column, groups) for column, groups in report.groups.items()]
    numbers = results.numbers
    known = np.isfinite(numbers["input_jitter_m_s3"]) & np.isfinite(numbers["jitter_m_s3"])
    names = np.array(results.table["clip"].to_pylist())[known].tolist()
    parts.append(
        _section(
            "Jitter in and out",
            "Below the line a clip came out steadier than it went in.",
            plots.scatter(
                numbers["input_jitter_m_s3"][known],
                numbers["jitter_m_s3"][known],
                names,
                ("jitter of the observed joints [m/s³]", "jitter of the output [m/s³]"),
            ),
        )
    )
    parts.append(_worst(report))
    parts.append(_failed(report))
    return "".join(parts)


def _clip_values(report: Report) -> tuple[NDArray[np.float64], str]:
    name = "pa_mpjpe_mean_mm"
    label = "PA-MPJPE [mm]"
    values = report.results.numbers[name]
    if not np.isfinite(values).any():
        values, label = report.results.numbers["jitter_m_s3"], "jitter [m/s³]"
    return values[np.isfinite(values)], label


def _group(column: str, groups: Mapping[str, Sure]) -> str:
    measure = "pa_mpjpe_mm"
    if not any(np.isfinite(g.values[measure].value) for g in groups.values()):
        measure = "jitter_m_s3"
    name, unit = TITLES[measure]
    rows = [(value, [group.values[measure]]) for value, group in groups.items()]
    plot = plots.dots(rows[:60], f"{name} [{unit}]")
    table = _table(_head(column), [[escape(v), *_cells(g)] for v, g in groups.items()])
    return _section(f"By {column}", "Mean over all frames, with its interval.", plot + table)


def _worst(report: Report) -> str:
    measure = "PA-MPJPE [mm]" if report.worst_by.endswith("_mm") else "jitter [m/s³]"
    head = ["clip", "subject", "hand", measure, "to look at it"]
    rows = [
        [
            escape(w.clip),
            escape(w.subject),
            w.hand,
            f"{w.value:.2f}",
            f"<code>{escape(w.command)}</code>",
        ]
        for w in report.worst
    ]
    table = _table(head, rows, ("subject", "hand", "to look at it")) if rows else ""
    return _section("Worst clips", "With the command that shows each in the viewer.", table)


def _failed(report: Report) -> str:
    failed = report.results.failed
    if not failed:
        return ""
    rows = [[escape(path), escape(error)] for path, error in failed[:_FAILED]]
    hint = f"{len(failed):,} clips" + (f", the first {_FAILED}" if len(failed) > _FAILED else "")
    return _section("Failed", hint, _table(["clip", "why"], rows, ("why",)))


def _compared(of: Comparison) -> str:
    people = f" of {of.subjects:,} subjects" if of.subjects else ""
    whole = "; ".join(
        f"{name}: {r.overall.clips:,} clips, {r.overall.frames:,} frames{_bad(r)}"
        for name, r in zip(of.names, of.reports, strict=True)
    )
    about = f"{of.clips:,} clips{people} that both have ({whole}). {_meaning(*of.reports)}"
    legend = "".join(
        f'<span><i class="dot" style="background:var(--m{i})"></i>{escape(name)}</span>'
        for i, name in enumerate(of.names)
    )
    legend = f'<div class="legend">{legend}</div>'
    parts = [
        f"<p>{escape(about)}</p></header>",
        '<ul class="verdicts">',
    ]
    for text, clear in sentences(of):
        parts.append(f'<li class="{"clear" if clear else "open"}">{escape(text)}</li>')
    parts += ["</ul>", _notes(of.notes)]
    rows = [[escape(n), *_cells(group)] for n, group in zip(of.names, of.common, strict=True)]
    difference = ["difference", "", "", *_values(of.differences)]
    parts.append(
        _section("Both", "On the clips that both have.", _table(_head(""), [*rows, difference]))
    )
    found = [_clip_values(report) for report in of.reports]
    if found[0][1] == found[1][1]:
        plot = plots.histogram([values for values, _ in found], found[0][1])
        parts.append(_section("Clips", "How many clips have which error.", legend + plot))
    mine, other = (report.groups.get("subject", {}) for report in of.reports)
    both = [(s, [g[s].values["pa_mpjpe_mm"] for g in (mine, other)]) for s in mine if s in other]
    if plot := plots.dots(both[:60], "PA-MPJPE [mm]"):
        hint = "Mean over all frames, with its interval."
        parts.append(_section("By subject", hint, legend + plot))
    for name, report in zip(of.names, of.reports, strict=True):
        parts.append(_worst(report).replace("<h2>Worst clips", f"<h2>{escape(name)}: worst clips"))
        parts.append(_failed(report))
    return "".join(parts)


def sentences(of: Comparison) -> list[tuple[str, bool]]:
    """What is better, in words, and whether that is sure."""
    found = []
    for name in ("pa_mpjpe_mm", "pa_mpjpe_std_mm", "jitter_m_s3", "lost_percent"):
        value = of.differences[name]
        if not np.isfinite(value.value):
            continue
        title, unit = _SPOKEN.get(name, TITLES[name])
        if not value.value:
            found.append((f"{title} is the same of {of.names[1]} and of {of.names[0]}", False))
            continue
        less = "less" if value.value < 0 else "more"
        text = (
            f"{title} of {of.names[1]} is {number(abs(value.value))} {unit} {less} than of"
            f" {of.names[0]}"
        )
        if np.isfinite(value.low):
            text += f" (difference [{number(value.low)}, {number(value.high)}])"
        text += "" if value.clear else ": not sure"
        found.append((text, value.clear))
    return found
