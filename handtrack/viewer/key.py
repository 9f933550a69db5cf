"""What dots and lines mean: two strips, one below the hands and one above the plots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from handtrack.viewer import style
from handtrack.viewer.shown import Shown
from handtrack.viewer.style import Colour
from handtrack.viewer.versions import accepted

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

_LETTER, _SPACE, _HEIGHT, _MIDDLE = 7.2, 26.0, 40.0, 14.0  # in pixels of a picture as wide
_TURN = np.linspace(0, 2 * np.pi, 25)
_ABOVE = np.array([0.0, -6.0])  # of a sign from the top of its name
_CIRCLE = 5.0 * np.stack([np.cos(_TURN), np.sin(_TURN)], 1)


class Entry(NamedTuple):
    """A sign of the key: a dot, a ring, or a line so many points wide."""

    label: str
    colour: Colour
    sign: str = "dot"
    width: float = 5.0


def dots(hands: Sequence[Shown], light: bool = False) -> list[Entry]:
    """Of the 3D views."""
    shown = {style.OBSERVED, style.FITTED}
    if any(hand.track.filtered for hand in hands):
        shown.add(style.FILTERED)
    if any(hand.track.truth is not None for hand in hands):
        shown.add(style.TRUTH)
    found = [
        Entry(name, c) for id_, (name, c, _) in style.skeletons(0, light).items() if id_ in shown
    ]
    found.append(Entry("at a limit", style.toned(style.HELD, light), "ring"))
    found.append(Entry("outside limits", style.OUTSIDE, "ring"))
    return [*found, Entry("rejected", style.REJECTED, "dot", 7.0)]


def lines(hands: Sequence[Shown], light: bool = False) -> list[Entry]:
    """Of the plots of angles."""
    names = ("base flexion", "base abduction", "1st hinge", "2nd hinge")
    colours = style.angle_colours(0, light)
    found = [
        Entry(name, colour, "line", style.FILTERED_WIDTH)
        for name, colour in zip(names, colours, strict=True)
    ]
    text = style.ground(light).text
    if any(hand.run for hand in hands):
        found.append(Entry("pale: later run", style.angle_colours(1, light)[0], "line", 2.2))
    if any(hand.track.filtered for hand in hands):
        found.append(Entry("thin: raw", text, "line", style.RAW_WIDTH))
    found.append(Entry("band: limit", (*text[:3], 130), "line", style.LIMIT_WIDTH))
    for name, state in (("gone", "lost"), ("found", "fitted")):
        found.append(Entry(name, style.STATUS_COLOURS[state]))
    return found


def log_key(recording: rr.RecordingStream, hands: Sequence[Shown], light: bool = False) -> None:
    """Send both strips."""
    _log(recording, "key/dots", dots(hands, light), light)
    _log(recording, "key/lines", lines(hands, light), light)


def key_view(name: str, entries: Sequence[Entry], light: bool = False) -> rrb.Spatial2DView:
    """The view of a strip.

    Args:
        name: "dots" or "lines".
        entries: what is in it.
        light: on a light ground.
    """
    import rerun.blueprint as rrb

    _, length = _places(entries)
    return rrb.Spatial2DView(
        origin=f"key/{name}",
        name="key",
        background=rrb.Background(color=style.ground(light).world),
        visual_bounds=rrb.VisualBounds2D(x_range=[0, length], y_range=[0, _HEIGHT]),
        **accepted(rrb.Spatial2DView, titlebar=False),
    )


def _places(entries: Sequence[Entry]) -> tuple[list[float], float]:
    """The middle of each entry, and the length of all."""
    widths = [_SPACE + _LETTER * len(entry.label) for entry in entries]
    ends = np.cumsum(widths)
    return [float(end - width / 2) for end, width in zip(ends, widths, strict=True)], float(
        ends[-1]
    )


def _log(recording: rr.RecordingStream, entity: str, entries: Sequence[Entry], light: bool) -> None:
    import rerun as rr

    places, _ = _places(entries)
    at = [np.array([x, _MIDDLE]) for x in places]
    # a name stands on a box of the viewer's, which is grey on any ground: light on it
    names = rr.Points2D(
        at,
        radii=-0.01,
        colors=[style.DARK.text if light else entry.colour for entry in entries],
        labels=[entry.label for entry in entries],
        show_labels=True,
    )
    recording.log(f"{entity}/names", names, static=True)
    for sign in ("dot", "ring", "line"):
        some = [i for i, entry in enumerate(entries) if entry.sign == sign]
        colours = [entries[i].colour for i in some]
        widths = [-entries[i].width for i in some]  # below zero: of the screen
        if sign == "dot":
            dots = rr.Points2D([at[i] + _ABOVE for i in some], radii=widths, colors=colours)
            recording.log(f"{entity}/dots", dots, static=True)
        elif some:
            strips = [
                at[i] + _ABOVE + (_CIRCLE if sign == "ring" else [[-14, 0], [14, 0]]) for i in some
            ]
            radii = [-1.0] * len(some) if sign == "ring" else [width / 2 for width in widths]
            drawn = rr.LineStrips2D(strips, radii=radii, colors=colours)
            recording.log(f"{entity}/{sign}s", drawn, static=True)
