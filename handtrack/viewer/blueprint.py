"""How the viewer is arranged when a recording opens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from handtrack.hand.skeleton import FINGERS
from handtrack.viewer.abilities import accepted, eye_controls, log_columns, status_views
from handtrack.viewer.eye import Eye, Seen, eye
from handtrack.viewer.shown import Shown, counterpart

if TYPE_CHECKING:
    import rerun.blueprint as rrb

_BACKGROUND = (24, 27, 34)


def blueprint(
    hands: Sequence[Shown],
    *,
    side_by_side: bool = False,
    follow: bool = False,
    view: Eye | None = None,
    pictures: Sequence[str] = (),
) -> rrb.Blueprint:
    """The 3D view at the left; the angles by finger, the errors and the log at the right.

    Args:
        hands: what is shown, of one recording or of several.
        side_by_side: a 3D view for each recording, instead of one for all.
        follow: stay at the time that came last.
        view: where to look from; as shows all of the motion by default.
        pictures: names of cameras whose pictures are shown below the hands.
    """
    import rerun.blueprint as rrb

    view = view or eye([Seen.of(hand.track, hand.offset) for hand in hands])
    runs = dict.fromkeys(hand.run for hand in hands)
    if side_by_side and len(runs) > 1:
        groups = [[hand for hand in hands if hand.run == run] for run in runs]
        # views that are narrow need a step back
        view = view.farther(1 + 0.2 * min(len(groups), 4))
        worlds = [_world(group, group[0].run_name, view) for group in groups]
    else:
        worlds = [_world(hands, "hands" if len(hands) > 1 else "hand", view)]
    plots = [_compared(hand, first) for hand in hands if (first := counterpart(hand, hands))]
    plots += [_plots(hand.topic) for hand in hands]
    # whose line it is matters only where there are several
    columns = ("EntityPath", "LogLevel", "Body")[len(hands) == 1 :]
    log = rrb.TextLogView(origin="log", name="events", **log_columns(*columns))
    below = status_views(log)
    left: rrb.Container | rrb.View = rrb.Horizontal(*worlds) if len(worlds) > 1 else worlds[0]
    if pictures:
        cameras = [rrb.Spatial2DView(origin=f"pictures/{name}", name=name) for name in pictures]
        left = rrb.Vertical(left, rrb.Horizontal(*cameras), row_shares=[3, 2])
    return rrb.Blueprint(
        rrb.Horizontal(
            left,
            rrb.Vertical(
                plots[0] if len(plots) == 1 else rrb.Tabs(*plots),
                rrb.Horizontal(*below, column_shares=[1, 2][-len(below) :]),
                row_shares=[4, 1],
            ),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(
            state="collapsed",
            **accepted(
                rrb.TimePanel,
                timeline="time",
                loop_mode="off" if follow else "all",  # what loops does not follow
                play_state="following" if follow else None,
            ),
        ),
        collapse_panels=True,
    )


def _world(hands: Sequence[Shown], name: str, view: Eye) -> rrb.Spatial3DView:
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin="world",
        contents=[f"/world/{hand.topic}/**" for hand in hands],
        name=name,
        background=rrb.Background(color=_BACKGROUND),
        # a grid would claim to know the floor
        line_grid=rrb.LineGrid3D(visible=False),
        **eye_controls(view),
    )


def _plots(topic: str) -> rrb.Grid:
    """The angles of a hand, and its errors."""
    import rerun.blueprint as rrb

    views = [_angles(finger, [f"/angles/{topic}/{finger}/**"]) for finger in FINGERS]
    errors = rrb.TimeSeriesView(
        origin=f"errors/{topic}",
        name="errors [mm]",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )
    return rrb.Grid(*views, errors, grid_columns=2, name=topic)


def _compared(hand: Shown, first: Shown) -> rrb.Grid:
    """The filtered angles of two runs in the same plots, and how far apart their joints are."""
    import rerun.blueprint as rrb

    views = [
        _angles(
            finger,
            [
                *[f"/angles/{topic}/{finger}/angles" for topic in (first.topic, hand.topic)],
                f"/angles/{first.topic}/{finger}/limits",
            ],
        )
        for finger in FINGERS
    ]
    difference = rrb.TimeSeriesView(
        origin=f"difference/{hand.topic}",
        name="between the joints [mm]",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )
    name = f"{first.topic}, pale: {hand.topic}"
    return rrb.Grid(*views, difference, grid_columns=2, name=name)


def _angles(finger: str, contents: list[str]) -> rrb.TimeSeriesView:
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin="angles",
        contents=contents,
        name=f"{finger} [deg]",
        # the colours mean the same in every finger: the top row's key is enough
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=finger in FINGERS[:2]),
    )
