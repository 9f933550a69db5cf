"""Plots of many clips, as SVG that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation.bootstrap import Uncertain
from handtrack.files.long_arrays import evenly

Array = NDArray[np.float64]

WIDTH, LEFT, TOP, BOTTOM = 720, 56, 10, 40
_COLOURS = ("var(--m0)", "var(--m1)")
_BINS = 60
_POINTS = 1500


def _ticks(low: float, high: float, n: int = 6) -> Array:
    step = 10 ** np.floor(np.log10(max(high - low, 1e-12) / n))
    step *= next(m for m in (1, 2, 5, 10) if (high - low) / (m * step) <= n)
    return np.asarray(np.arange(np.ceil(low / step), np.floor(high / step + 1e-9) + 1) * step)


def _text(x: float, y: float, text: str, anchor: str = "middle") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _across(y: float) -> str:
    return f'<line x1="{LEFT}" x2="{WIDTH - 10}" y1="{y:.1f}" y2="{y:.1f}"/>'


def _svg(height: float, parts: Sequence[str], title: str) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH} {height:.0f}" role="img" aria-label="{escape(title)}">'
        + "".join(parts)
        + "</svg>"
    )


def histogram(series: Sequence[Array], label: str) -> str:
    """How many clips have which value; of two runs two outlines.

    Args:
        series: values of each run, without NaN.
        label: of the axis, with the unit.
    """
    whole = np.concatenate(list(series))
    if not len(whole):
        return ""
    # the farthest hundredth would squeeze all others into one bar
    end = float(np.quantile(whole, 0.99)) * 1.05 or 1.0
    edges = np.linspace(0.0, end, _BINS + 1)
    counts = [np.histogram(np.minimum(s, end), edges)[0] for s in series]
    height, top = 240.0, max(int(c.max()) for c in counts)
    width, tall = WIDTH - LEFT - 10, height - TOP - BOTTOM

    def x(value: float) -> float:
        return LEFT + width * value / end

    def y(count: float) -> float:
        return TOP + tall * (1 - count / top)

    parts = ['<g class="grid">']
    levels = [t for t in _ticks(0, top, 4) if t == int(t)]
    parts += [
        f'<line x1="{LEFT}" x2="{WIDTH - 10}" y1="{y(t):.1f}" y2="{y(t):.1f}"/>' for t in levels
    ]
    parts.append("</g>")
    for count, colour in zip(counts, _COLOURS, strict=False):
        bars = (
            f'<rect x="{x(a):.1f}" y="{y(n):.1f}" width="{max(x(b) - x(a) - 1, 0.5):.1f}"'
            f' height="{TOP + tall - y(n):.1f}"><title>{a:.2f} to {b:.2f}: {n} clips</title></rect>'
            for a, b, n in zip(edges[:-1], edges[1:], count.tolist(), strict=True)
            if n
        )
        opacity = 0.85 if len(series) == 1 else 0.5
        parts.append(f'<g fill="{colour}" fill-opacity="{opacity}">{"".join(bars)}</g>')
    parts += [_text(LEFT - 8, y(t) + 4, f"{t:,.0f}", "end") for t in levels]
    parts += [_text(x(t), height - BOTTOM + 16, f"{t:g}") for t in _ticks(0, end)]
    beyond = int((whole > end).sum())
    more = f" ({beyond} beyond are in the last bar)" if beyond else ""
    parts.append(_text(LEFT + width / 2, height - 4, label + more))
    return _svg(height, parts, f"Clips by {label}")


def dots(rows: Sequence[tuple[str, Sequence[Uncertain]]], label: str) -> str:
    """A line for each group: value and interval; of two runs two.

    Args:
        rows: names, and a value of each run.
        label: of the axis, with the unit.
    """
    known = [v for _, values in rows for v in values if np.isfinite(v.value)]
    if not known:
        return ""
    ends = [e for v in known for e in (v.low, v.high, v.value) if np.isfinite(e)]
    low, high = min(ends), max(ends)
    room = 0.05 * (high - low) or 0.5
    low, high = low - room, high + room
    each, left = 20.0, 150
    height = TOP + each * len(rows) + BOTTOM

    def x(value: float) -> float:
        return left + (WIDTH - left - 14) * (value - low) / (high - low)

    foot = height - BOTTOM
    parts = ['<g class="grid">']
    parts += [
        f'<line x1="{x(t):.1f}" x2="{x(t):.1f}" y1="{TOP}" y2="{foot:.1f}"/>'
        for t in _ticks(low, high)
    ]
    parts.append("</g>")
    for i, (name, values) in enumerate(rows):
        middle = TOP + each * (i + 0.5)
        parts.append(_text(left - 10, middle + 4, name[:22], "end"))
        for k, value in enumerate(values):
            if not np.isfinite(value.value):
                continue
            at = middle + (k - (len(values) - 1) / 2) * 7
            said = f"{name}: {value.value:.3g}"
            if np.isfinite(value.low):
                said += f" [{value.low:.3g}, {value.high:.3g}]"
                parts.append(
                    f'<line x1="{x(value.low):.1f}" x2="{x(value.high):.1f}" y1="{at:.1f}"'
                    f' y2="{at:.1f}" stroke="{_COLOURS[k]}" stroke-width="2"/>'
                )
            parts.append(
                f'<circle cx="{x(value.value):.1f}" cy="{at:.1f}" r="4" fill="{_COLOURS[k]}">'
                f"<title>{escape(said)}</title></circle>"
            )
    parts += [_text(x(t), foot + 16, f"{t:g}") for t in _ticks(low, high)]
    parts.append(_text((left + WIDTH) / 2, height - 4, label))
    return _svg(height, parts, label)


def scatter(across: Array, up: Array, names: Sequence[str], labels: tuple[str, str]) -> str:
    """A point for each clip, on logarithmic axes, with the line of equal values.

    Args:
        across, up: (N,) values, without NaN.
        names: of the clips.
        labels: of the axes, with units.
    """
    fine = (across > 0) & (up > 0)
    index = np.flatnonzero(fine)
    if not len(index):
        return ""
    index = evenly(index, _POINTS)
    a, b = np.log10(across[index]), np.log10(up[index])
    low, high = float(min(a.min(), b.min())) - 0.05, float(max(a.max(), b.max())) + 0.05
    height = 340.0
    tall, wide = height - TOP - BOTTOM, WIDTH - LEFT - 10

    def x(value: float) -> float:
        return LEFT + wide * (value - low) / (high - low)

    def y(value: float) -> float:
        return TOP + tall * (high - value) / (high - low)

    decades = _decades(low, high)
    parts = ['<g class="grid">']
    for value, _ in decades:
        parts.append(
            f'<line x1="{x(value):.1f}" x2="{x(value):.1f}" y1="{TOP}" y2="{TOP + tall}"/>'
        )
        parts.append(
            f'<line x1="{LEFT}" x2="{WIDTH - 10}" y1="{y(value):.1f}" y2="{y(value):.1f}"/>'
        )
    parts.append("</g>")
    parts.append(
        f'<line x1="{x(low):.1f}" y1="{y(low):.1f}" x2="{x(high):.1f}" y2="{y(high):.1f}"'
        ' stroke="var(--reference)" stroke-dasharray="5 4"/>'
    )
    points = (
        f'<circle cx="{x(p):.1f}" cy="{y(q):.1f}" r="3"><title>{escape(names[i])}</title></circle>'
        for p, q, i in zip(a.tolist(), b.tolist(), index.tolist(), strict=True)
    )
    parts.append(f'<g fill="{_COLOURS[0]}" fill-opacity="0.45">{"".join(points)}</g>')
    parts += [_text(x(v), height - BOTTOM + 16, label) for v, label in decades]
    parts += [_text(LEFT - 8, y(v) + 4, label, "end") for v, label in decades]
    parts.append(_text(LEFT + wide / 2, height - 4, labels[0]))
    parts.append(
        f'<text transform="translate(12 {TOP + tall / 2:.0f}) rotate(-90)"'
        f' text-anchor="middle">{escape(labels[1])}</text>'
    )
    return _svg(height, parts, f"{labels[1]} over {labels[0]}")


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    """Places and labels of 1, 2, 5, 10 ..., and of more digits where that would be few."""
    found: list[tuple[float, str]] = []
    digits = (1, 2, 5) if high - low > 1 else (1, 1.5, 2, 3, 4, 5, 7)
    for decade in range(int(np.floor(low)), int(np.ceil(high)) + 1):
        for digit in digits:
            value = decade + float(np.log10(digit))
            if low <= value <= high:
                found.append((value, f"{digit * 10.0**decade:,g}"))
    return found
