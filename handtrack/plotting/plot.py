"""Figures of tracks for papers: angles within limits, errors, statuses and events over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handtrack.errors import SettingsError, needed
from handtrack.files.whole import whole_file
from handtrack.plotting.panels import draw_angle, draw_errors, draw_legend, draw_statuses
from handtrack.plotting.runs import Run, chosen_angles, runs_of
from handtrack.plotting.settings import PlotSettings
from handtrack.tracking.track import Track

if TYPE_CHECKING:
    import matplotlib.figure
    from matplotlib.axes import Axes

SUFFIXES = (".pdf", ".svg", ".png")
_MM = 1 / 25.4
_ROW_MM, _ERRORS_MM, _LANE_MM = 25.0, 24.0, 3.5
_NARROWEST_MM = 34.0
"""Of a panel, with its labels, at a text of 7 pt."""


def plot(
    tracks: Track | Iterable[Track] | Mapping[str, Track],
    save: str | Path | None = None,
    *,
    fingers: Iterable[str] = (),
    joints: Iterable[str] = (),
    start_s: float | None = None,
    end_s: float | None = None,
    settings: PlotSettings | Mapping[str, Any] | None = None,
    **options: Any,
) -> matplotlib.figure.Figure:
    """Draw joint angles, errors, statuses and events over time, as papers want them.

    Each angle has a panel in degrees, in which what is outside the limits is shaded, with bands
    of the fit's standard deviation. Below are the errors in mm (PA-MPJPE of input and output
    where the track has a truth, else distances to the input), statuses, and events as marks.
    Several tracks are drawn in one figure, each in its colour.

    Args:
        tracks: one, several, or by the names they are to be called.
        save: .pdf or .svg (vectors), or .png; None for a figure of pyplot that is not written.
        fingers: names of fingers; all if there are none.
        joints: joints ("index_pip"), kinds of joints ("pip") or angles ("thumb_cmc_abduction");
            all if there are none.
        start_s, end_s: first and last time [s] from the first frame.
        settings, options: as in `PlotSettings`.

    Returns:
        The figure, of matplotlib; it can be changed and saved again.

    Raises:
        SettingsError: matplotlib is not installed (extra `plot`), a name is unknown, another
            ending, or there is nothing to draw.
        HandtrackError: the file cannot be written.
    """
    how = PlotSettings.of(settings, options)
    path = None if save is None else Path(save)
    if path is not None and path.suffix not in SUFFIXES:
        raise SettingsError(f"{path}: expected a name that ends in {', '.join(SUFFIXES)}")
    angles = chosen_angles(fingers, joints)
    runs = runs_of(tracks, start_s, end_s)
    with _style(how):
        figure = _empty_figure(path is None)
        _draw(figure, runs, angles, how)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            # the same track gives the same file
            about: dict[str, Any] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
            with whole_file(path) as part:
                kind = path.suffix.removeprefix(".")
                figure.savefig(part, format=kind, dpi=how.dpi, metadata=about.get(path.suffix))
    return figure


def _style(how: PlotSettings) -> AbstractContextManager[None]:
    """matplotlib's settings for a journal: text that can be read and edited, fine lines."""
    library = needed("matplotlib", "plots need matplotlib", "plot")
    context: AbstractContextManager[None] = library.rc_context(
        {
            "font.family": "sans-serif",
            "font.sans-serif": ["Arial", "Helvetica", "Liberation Sans", "DejaVu Sans"],
            "font.size": how.font_pt,
            "axes.titlesize": how.font_pt,
            "axes.labelsize": how.font_pt,
            "xtick.labelsize": how.font_pt - 1,
            "ytick.labelsize": how.font_pt - 1,
            "legend.fontsize": how.font_pt,
            "axes.linewidth": 0.5,
            "axes.titlepad": 2.5,
            "axes.labelpad": 1.5,
            "xtick.major.width": 0.5,
            "ytick.major.width": 0.5,
            "xtick.major.size": 2.0,
            "ytick.major.size": 2.0,
            "xtick.minor.width": 0.5,
            "xtick.minor.size": 1.2,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "legend.frameon": False,
            # fonts as text, which journals and drawing programs want
            "pdf.fonttype": 42,
            "svg.hashsalt": "handtrack",
            "path.simplify": True,
        }
    )
    return context


def _empty_figure(shown: bool) -> matplotlib.figure.Figure:
    """A figure that pyplot shows, or one that nobody has to close."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(w_pad=0.8 * _MM, h_pad=0.6 * _MM, hspace=0.02, wspace=0.02)
    if shown:
        import matplotlib.pyplot as plt

        return plt.figure(layout=layout)
    from matplotlib.figure import Figure

    return Figure(layout=layout)


def _draw(
    figure: matplotlib.figure.Figure, runs: list[Run], angles: list[int], how: PlotSettings
) -> None:
    """Panels of angles in a grid, a column for each finger where there are several; below them
    errors and statuses."""
    grid = _grid(angles, how)
    rows, columns = len(grid), len(grid[0])
    heights = [_ROW_MM] * rows
    heights += [_ERRORS_MM] if how.errors else []
    heights += [4.0 + _LANE_MM * len(runs)] if how.statuses else []
    scale = how.font_pt / 7.0
    figure.set_size_inches(how.width_mm * _MM, (sum(heights) + 10.0) * scale * _MM)
    places = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    first: Axes | None = None
    panels: list[Axes] = []
    lefts: list[Axes] = []
    for r, row in enumerate(grid):
        for c, angle in enumerate(row):
            if angle is None:
                continue
            axes = figure.add_subplot(places[r, c], sharex=first)
            first = first or axes
            draw_angle(axes, runs, angle, how)
            if not any(a is not None for a in row[:c]):
                axes.set_ylabel("angle (°)")
            if c == 0:
                lefts.append(axes)
            panels.append(axes)
    below = len(grid)
    if how.errors:
        axes = figure.add_subplot(places[below, :], sharex=first)
        draw_errors(axes, runs)
        panels.append(axes)
        lefts.append(axes)
        below += 1
    if how.statuses:
        axes = figure.add_subplot(places[below, :], sharex=first)
        draw_statuses(axes, runs)
        panels.append(axes)
    _label_times(panels, grid, how)
    figure.align_ylabels(lefts)
    draw_legend(figure, runs, how)


def _grid(angles: list[int], how: PlotSettings) -> list[list[int | None]]:
    """Angles in rows: a column for each finger if they fit, else as many as fit."""
    fit = max(1, int(how.width_mm // (_NARROWEST_MM * how.font_pt / 7.0)))
    fingers = sorted({angle // 4 for angle in angles})
    kinds = sorted({angle % 4 for angle in angles})
    if 1 < len(fingers) <= fit:
        return [
            [4 * f + k if 4 * f + k in angles else None for f in fingers]
            for k in kinds
            if any(4 * f + k in angles for f in fingers)
        ]
    columns = 1 if len(angles) <= 4 else min(fit, len(angles))
    padded: list[int | None] = [*angles, *[None] * (-len(angles) % columns)]
    return [padded[i : i + columns] for i in range(0, len(padded), columns)]


def _label_times(panels: list[Any], grid: list[list[int | None]], how: PlotSettings) -> None:
    """Name the axis of time where it ends: at the bottom, and below the last panel of a column
    where what follows has other columns."""
    n = len(panels) - how.errors - how.statuses
    of_angles = panels[:n]
    places = [(r, c) for r, row in enumerate(grid) for c, a in enumerate(row) if a is not None]
    for axes, (r, c) in zip(of_angles, places, strict=True):
        last = not any(other > r for other, column in places if column == c)
        axes.tick_params(labelbottom=last)
        if last and not (len(grid[0]) == 1 and (how.errors or how.statuses)):
            axes.set_xlabel("time (s)")
        elif last:
            axes.tick_params(labelbottom=False)
    for axes in panels[n:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].tick_params(labelbottom=True)
    panels[-1].set_xlabel("time (s)")
