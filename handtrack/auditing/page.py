"""The audit as a page of its own: a table, every finding in a sentence, the worst frames drawn."""

from __future__ import annotations

import html

import numpy as np
from numpy.typing import NDArray

from handtrack import __version__
from handtrack.auditing.findings import Audited
from handtrack.auditing.reading import Unread
from handtrack.evaluation.shake import palm_motion
from handtrack.hand.skeleton import BONES

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;padding:0 1rem;
color:#222;background:#fff}table{border-collapse:collapse;width:100%}th,td{text-align:left;
padding:.25rem .6rem;border-bottom:1px solid #ddd}td.n,th.n{text-align:right;
font-variant-numeric:tabular-nums}h2{margin:2rem 0 .3rem}ul{margin:.3rem 0}
tr.found td{padding:0 .6rem .6rem 1.6rem;color:#666}tr.of td{border-bottom:0;padding-top:.6rem}
figure{display:inline-block;margin:.4rem;width:12.5rem;vertical-align:top}figcaption{font-size:.8rem;color:#555;text-align:center}.kind{font-weight:600}
@media(prefers-color-scheme:dark){body{color:#ddd;background:#181818}th,td{border-color:#444}
tr.found td{color:#aaa}}
"""
_SIZE = 170
_NUMBERS = (
    ("palm mm", "palm_mm"),
    ("bones %", "bones_percent"),
    ("size %", "size_percent"),
    ("hand shakes mm", "shake_palm_mm"),
    ("fingers shake °", "shake_fingers_deg"),
    ("residual mm", "residual_mm"),
    ("bound mm", "bound_mm"),
)


def to_html(audits: list[Audited], unread: list[Unread] | None = None) -> str:
    """One page that needs nothing but itself; the worst sequences first."""
    head = "".join(f'<th class="n">{h}</th>' for h in ("score", "frames", "marked %"))
    head += "".join(f'<th class="n">{h}</th>' for h, _ in _NUMBERS)
    rows = "".join(_row(i, a) for i, a in enumerate(audits))
    parts = "".join(_part(i, a) for i, a in enumerate(audits) if a.findings)
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>handtrack audit</title>'
        f"<style>{_STYLE}</style><h1>What cannot be true of {len(audits)} sequences</h1>"
        "<p>The worst first: every kind of fault counts by the square root of the share of frames"
        " it is in, and more the further it is beyond what is let pass.</p>"
        f"<table><tr><th>sequence</th><th>hand</th>{head}</tr>{rows}</table>"
        f"{_unread(unread or [])}{parts}"
        f"<p>Made by handtrack {__version__}.</p></html>"
    )


def _unread(unread: list[Unread]) -> str:
    if not unread:
        return ""
    lines = "".join(f"<li>{html.escape(u.error)}</li>" for u in unread)
    return f"<h2>Not read ({len(unread)})</h2><ul>{lines}</ul>"


def _row(i: int, a: Audited) -> str:
    kinds = ", ".join(f.kind for f in a.findings) or "nothing"
    cells = [f"{a.score:.2f}", f"{len(a.time_ns):,}", f"{100 * a.share:.1f}"]
    cells += [
        f"{v:.2f}" if np.isfinite(v := a.numbers.get(n, np.nan)) else "-" for _, n in _NUMBERS
    ]
    numbers = "".join(f'<td class="n">{c}</td>' for c in cells)
    name = f'<a href="#s{i}">{html.escape(a.name)}</a>' if a.findings else html.escape(a.name)
    return (
        f'<tr class="of"><td>{name}</td><td>{a.hand}</td>{numbers}</tr>'
        f'<tr class="found"><td colspan="{len(cells) + 2}">{kinds}</td></tr>'
    )


def _part(i: int, a: Audited) -> str:
    found = "".join(
        f'<li><span class="kind">{f.kind}</span> ({f.frames:,} frames): {html.escape(f.text)}</li>'
        for f in a.findings
    )
    pictures = "".join(_picture(a, t) for t in a.worst_frames())
    name, where = html.escape(a.name), html.escape(a.source)
    return f'<h2 id="s{i}">{name} ({a.hand})</h2><p>{where}</p><ul>{found}</ul>{pictures}'


def _picture(a: Audited, t: int) -> str:
    """The frame seen onto the palm; joints that were found wanting are red."""
    _, turns = palm_motion(a.joints[t : t + 1])
    x = a.joints[t] - np.nanmean(a.joints[t], axis=0)
    if np.isfinite(turns).all():
        # the palm's two long directions are the page's
        palm = x[[0, 5, 9, 13, 17]]
        axes = np.linalg.svd(palm[~np.isnan(palm[:, 0])], full_matrices=True)[2]
        x = x @ axes.T
    flat = x[:, :2] * np.array([1.0, -1.0])
    half = float(np.nanmax(np.abs(flat))) or 1.0
    places = _SIZE / 2 + 0.46 * _SIZE * flat / half
    wrong = _marked(a, t)
    lines = "".join(
        f'<line x1="{p[0]:.1f}" y1="{p[1]:.1f}" x2="{q[0]:.1f}" y2="{q[1]:.1f}"'
        f' stroke="{"#c22" if wrong[c] else "#789"}" stroke-width="3" stroke-linecap="round"/>'
        for b, c in BONES
        if np.isfinite([*(p := places[b]), *(q := places[c])]).all()
    )
    dots = "".join(
        f'<circle cx="{p[0]:.1f}" cy="{p[1]:.1f}" r="4" fill="{"#c22" if w else "#345"}"/>'
        for p, w in zip(places, wrong, strict=True)
        if np.isfinite(p).all()
    )
    kinds = [f.kind for f in a.findings if f.marks[t].any() and f.frames < len(a.time_ns)]
    title = f"frame {a.frame_index[t]}: {', '.join(kinds)}"
    return (
        f'<figure><svg width="{_SIZE}" height="{_SIZE}">{lines}{dots}</svg>'
        f"<figcaption>{html.escape(title)}</figcaption></figure>"
    )


def _marked(a: Audited, t: int) -> NDArray[np.bool_]:
    wrong = np.zeros(21, dtype=bool)
    for f in a.findings:
        # of what is in all joints, nothing would stand out
        if not f.marks[t].all():
            wrong |= f.marks[t]
    return wrong
