"""The panels of a figure: an angle, errors, statuses with events; and their legend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import ANGLE_NAMES
from handtrack.plotting.runs import Run
from handtrack.plotting.settings import PlotSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Of the runs: Okabe and Ito's, which the colour-blind can tell apart."""
_INPUT = "#7F7F7F"
_OUTSIDE = "#E4E4E4"
_STATUSES = {"fitted": "#A8D8C4", "predicted": "#E69F00", "lost": "#3C3C3C"}
_LEVELS = {"warning": ("v", "#D55E00"), "info": ("|", "#000000")}
_TIME_STEPS = 6
"""Between the numbers on an axis of time, which all panels share."""
_MANY = 20_000
"""So many frames are drawn as points of a picture inside the vectors."""


def draw_angle(axes: Axes, runs: list[Run], angle: int, how: PlotSettings) -> None:
    """One angle of every run [deg], with the limits that its hand has."""
    lowest = min(float(np.rad2deg(run.track.model.limits.lower[angle])) for run in runs)
    highest = max(float(np.rad2deg(run.track.model.limits.upper[angle])) for run in runs)
    ends = [lowest, highest]
    for i, run in enumerate(runs):
        ends += _draw_run(axes, run, COLOURS[i % len(COLOURS)], angle, how, len(runs) == 1)
    room = 0.08 * (max(ends) - min(ends))
    bottom, top = min(ends) - room, max(ends) + room
    for a, b in ((bottom, lowest), (highest, top)):
        axes.axhspan(a, b, color=_OUTSIDE, lw=0, zorder=0)
    axes.set_ylim(bottom, top)
    _tick(axes, 6)
    axes.margins(x=0.01)
    finger, joint, motion = ANGLE_NAMES[angle].split("_")
    axes.set_title(f"{finger.capitalize()} {joint.upper()} {motion}")


def _tick(axes: Axes, steps: int) -> None:
    """At most so many steps between numbers upwards, and at least three numbers."""
    from matplotlib.ticker import MaxNLocator

    _tick_time(axes)
    axes.yaxis.set_major_locator(MaxNLocator(steps, steps=[1, 2, 3, 5, 10], min_n_ticks=3))


def _tick_time(axes: Axes) -> None:
    from matplotlib.ticker import AutoMinorLocator, MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(_TIME_STEPS, steps=[1, 2, 5, 10]))
    axes.xaxis.set_minor_locator(AutoMinorLocator(2))


def _draw_run(
    axes: Axes, run: Run, colour: str, angle: int, how: PlotSettings, alone: bool
) -> list[float]:
    """One angle of a run, and the least and greatest number drawn of it."""
    track = run.track
    if not track.measured_angles[angle]:
        if alone:
            axes.text(0.5, 0.5, "never seen", transform=axes.transAxes, ha="center", va="center")
        return []
    many = len(track) > _MANY
    seconds, steady = run.broken(np.rad2deg(track.angles[:, angle]))
    _, raw = run.broken(np.rad2deg(track.angles_raw[:, angle]))
    _, variance = run.broken(track.angle_variance[:, angle])
    reach = [steady]
    if how.bands:
        spread = how.bands * np.rad2deg(np.sqrt(np.where(np.isfinite(variance), variance, np.nan)))
        axes.fill_between(
            seconds, raw - spread, raw + spread, color=colour, alpha=0.22, lw=0, rasterized=many
        )
    if track.filtered and how.raw and alone:
        axes.plot(seconds, raw, color=_INPUT, lw=0.4, rasterized=many)
        reach.append(raw)
    axes.plot(seconds, steady, color=colour, lw=0.9, rasterized=many)
    known = np.concatenate([values[np.isfinite(values)] for values in reach])
    return [float(known.min()), float(known.max())] if len(known) else []


def draw_errors(axes: Axes, runs: list[Run]) -> None:
    """Errors of every run [mm]: output in its colour, what it is to be compared with in grey."""
    label, alone, greatest = runs[0].error_label, len(runs) == 1, 0.0
    for i, run in enumerate(runs):
        # runs against a truth and runs without one have no axis in common
        found = run.errors_mm if run.error_label == label else {}
        for name, values in found.items():
            compared = name != "output" and len(found) > 1
            if compared and not alone and (i or name == "fit"):
                continue
            seconds, drawn = run.broken(values)
            axes.plot(
                seconds,
                drawn,
                color=_INPUT if compared else COLOURS[i % len(COLOURS)],
                lw=0.5 if compared else 0.9,
                label=name if alone or compared else None,
                rasterized=len(run.track) > _MANY,
            )
            if np.isfinite(drawn).any():
                greatest = max(greatest, float(np.nanquantile(drawn, 0.995)))
    axes.set_ylabel(label)
    axes.set_ylim(0, 1.5 * greatest or 1.0)  # the legend stands above the lines
    _tick(axes, 5)
    axes.margins(x=0.01)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper right", ncols=2, handlelength=1.6, borderaxespad=0.0)


def draw_statuses(axes: Axes, runs: list[Run]) -> None:
    """A lane for each run: its statuses as bars, its events as marks above them."""
    for i, run in enumerate(runs):
        lane = len(runs) - 1 - i
        for status, colour in _STATUSES.items():
            spans = _spans(run, np.asarray(run.track.status == status))
            axes.broken_barh(spans, (lane + 0.1, 0.45), color=colour, lw=0)
        for level, (mark, colour) in _LEVELS.items():
            times = [
                e.time_ns for e in run.track.events if (e.level == "info") == (level == "info")
            ]
            at = run.seconds[0] + (np.array(times) - int(run.track.time_ns[0])) * 1e-9
            axes.plot(at, np.full(len(at), lane + 0.78), mark, color=colour, ms=2.6, mew=0.5)
    names = ["status"] if len(runs) == 1 else [run.name for run in runs]
    axes.set_yticks(np.arange(len(runs))[::-1] + 0.33, names)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(0, len(runs))
    _tick_time(axes)
    axes.spines["left"].set_visible(False)


def _spans(run: Run, wanted: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Start and length [s] of the stretches of frames that are wanted."""
    step = float(np.median(np.diff(run.seconds))) if len(run.seconds) > 1 else 0.01
    index = run.with_breaks
    inside = np.concatenate([[False], np.where(index < 0, False, wanted[index]), [False]])
    starts = np.flatnonzero(inside[1:] & ~inside[:-1])
    ends = np.flatnonzero(~inside[1:] & inside[:-1]) - 1
    return [
        (run.seconds[index[a]] - step / 2, run.seconds[index[b]] - run.seconds[index[a]] + step)
        for a, b in zip(starts, ends, strict=True)
    ]


def draw_legend(figure: Figure, runs: list[Run], how: PlotSettings) -> None:
    """What lines, bands, shades and marks are, above the panels."""
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    track, alone = runs[0].track, len(runs) == 1
    named = {run.name: COLOURS[i % len(COLOURS)] for i, run in enumerate(runs)}
    if alone:
        name = str(track.settings.get("filter", "filtered")) if track.filtered else "fit"
        named = {name: COLOURS[0]} | ({"fit": _INPUT} if track.filtered and how.raw else {})
    made: list[Any] = [Line2D([], [], color=c, lw=0.9, label=name) for name, c in named.items()]
    if how.bands:
        shades = [COLOURS[i % len(COLOURS)] for i in range(len(runs))]
        bands = tuple(Patch(color=colour, alpha=0.22, lw=0) for colour in shades)
        bands[0].set_label(f"fit ± {how.bands:g} sd")
        made.append(bands)
    made.append(Patch(color=_OUTSIDE, lw=0, label=f"outside limits ({track.model.limits.name})"))
    if how.statuses:
        present = {s for run in runs for s in run.track.status.tolist()}
        made += [Patch(color=c, lw=0, label=s) for s, c in _STATUSES.items() if s in present]
        events = [e for run in runs for e in run.track.events]
        for level, (mark, colour) in _LEVELS.items():
            if any((e.level == "info") == (level == "info") for e in events):
                label = "event" if level == "info" else "warning"
                made.append(
                    Line2D([], [], marker=mark, color=colour, ms=2.6, mew=0.5, lw=0, label=label)
                )
    columns = max(1, int(how.width_mm / (26.0 * how.font_pt / 7.0)))
    names = [one[0].get_label() if isinstance(one, tuple) else one.get_label() for one in made]
    figure.legend(
        made, names, loc="outside upper left", ncols=min(columns, len(made)), handlelength=1.6,
        columnspacing=1.2, borderaxespad=0.2,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)},
    )  # fmt: skip
