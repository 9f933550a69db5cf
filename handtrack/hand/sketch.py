"""What notebooks show of a hand: its skeleton as a small picture, beside a table."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import ModelError
from handtrack.hand.axes import palm_frame
from handtrack.hand.skeleton import BONES, Hand

PALM = (0, 5, 9, 17)
"""Joints that a sketch cannot do without: wrist, bases of index, middle and little finger."""
_SIDE, _MARGIN = 140.0, 10.0
_STYLE = "stroke='#4477aa' stroke-width='3' fill='#ee6677'"


def sketch(joints: ArrayLike, hand: Hand) -> str:
    """The back of the hand, fingers upwards, as SVG; joints that are missing are left out.

    Args:
        joints: (21, 3), any unit and frame; NaN for what is missing, which no joint of
            `PALM` may be.
        hand: "left" or "right".

    Raises:
        ModelError: the palm has no width.
    """
    points: NDArray[np.float64] = np.asarray(joints, np.float64)
    x, y, _ = palm_frame(points, hand)
    known: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(-1))
    flat = np.stack([points @ -y, points @ -x], axis=1)
    least, most = flat[known].min(axis=0), flat[known].max(axis=0)
    flat = _MARGIN + _SIDE * (flat - least) / (most - least).max()
    lines = "".join(
        f"<line x1='{flat[a, 0]:.1f}' y1='{flat[a, 1]:.1f}' x2='{flat[b, 0]:.1f}'"
        f" y2='{flat[b, 1]:.1f}'/>"
        for a, b in BONES
        if known[a] and known[b]
    )
    dots = "".join(f"<circle cx='{u:.1f}' cy='{v:.1f}' r='3'/>" for u, v in flat[known])
    size = _SIDE + 2 * _MARGIN
    return (
        f"<svg width='{size:.0f}' height='{size:.0f}' {_STYLE}>{lines}"
        f"<g stroke='none'>{dots}</g></svg>"
    )


def html_card(title: str, rows: Mapping[str, str], joints: ArrayLike | None, hand: Hand) -> str:
    """A table of named values under a title, beside the sketch of joints (21, 3).

    Joints without a whole palm, or whose palm has no width, have no sketch; nor has None.
    """
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(value)}</td></tr>"
        for name, value in rows.items()
    )
    table = f"<table><caption>{escape(title)}</caption>{cells}</table>"
    picture = ""
    if joints is not None and np.isfinite(np.asarray(joints)[list(PALM)]).all():
        try:
            picture = sketch(joints, hand)
        except ModelError:
            picture = ""
    return f"<div style='display:flex;gap:1em'>{picture}{table}</div>"
