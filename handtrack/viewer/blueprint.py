"""How the viewer is arranged when a recording opens, as far as the installed Rerun can do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from handtrack.hand.skeleton import FINGERS
from handtrack.tracking.settings import reprojection_px
from handtrack.viewer import style
from handtrack.viewer.eye import GRID_M, Eye, Seen, eye
from handtrack.viewer.key import dots, key_view, lines
from handtrack.viewer.shown import Shown, counterpart
from handtrack.viewer.style import Look
from handtrack.viewer.versions import (
    accepted,
    eye_controls,
    log_columns,
    plot_background,
    status_views,
)

if TYPE_CHECKING:
    import rerun.blueprint as rrb

_ASPECT = 0.8
"""Width of the part of a usual window that shows the hands, as a share of its height."""


class Placed(NamedTuple):
    """Where the eye is, and how the views of skin and bones lie: one over the other, or beside."""

    view: Eye
    stacked: bool = False


def placed(
    hands: Sequence[Shown],
    look: Look | None = None,
    pictures: bool = False,
    seen: Sequence[Seen] = (),
) -> Placed:
    """Where hands are seen largest from, in the views that `blueprint` makes of them.

    Args:
        hands, look: as of `blueprint`.
        pictures: there are pictures below them.
        seen: what will be seen, if it is not what the hands hold.
    """
    look = look or Look()
    seen = seen or [Seen.of(hand.track, hand.offset) for hand in hands]
    groups = _groups(hands, look)
    alone = len({hand.run for hand in hands}) == len(hands) >= len(seen)
    still = look.still or not alone or any(any(hand.offset) for hand in hands)
    aspect = _ASPECT / len(groups) * (1.7 if pictures else 1.0)
    if not _with_skin(hands, look):
        return Placed(eye(seen, aspect=aspect, still=still))
    beside = eye(seen, aspect=aspect / 2, still=still)
    over = eye(seen, aspect=aspect * 2, still=still)
    return Placed(over, True) if over.distance < beside.distance else Placed(beside)


def blueprint(
    hands: Sequence[Shown],
    look: Look | None = None,
    *,
    follow: bool = False,
    at: Placed | None = None,
    pictures: Sequence[str] = (),
) -> rrb.Blueprint:
    """The hand at the left, beside it its bones without the skin that hides them, and what the
    dots mean; at the right the angles by finger, the events, the errors and the status.

    Args:
        hands: what is shown, of one recording or of several.
        look: how.
        follow: stay at the time that came last.
        at: where to look from; as shows all of the motion by default.
        pictures: names of cameras whose pictures are shown below the hands.
    """
    import rerun.blueprint as rrb

    look = look or Look()
    at = at or placed(hands, look, bool(pictures))
    worlds = [_worlds(group, look, at, len(hands) > 1) for group in _groups(hands, look)]
    left = [rrb.Horizontal(*worlds) if len(worlds) > 1 else worlds[0]]
    shares = [12.0]
    if pictures:
        cameras = [rrb.Spatial2DView(origin=f"pictures/{name}", name=name) for name in pictures]
        left.append(rrb.Horizontal(*cameras) if len(cameras) > 1 else cameras[0])
        shares.append(8.0)
    left.append(key_view("dots", dots(hands, look.light), look.light))
    plots = [_compared(hand, first, look) for hand in hands if (first := counterpart(hand, hands))]
    plots += [_plots(hand, look) for hand in hands]
    below = status_views()
    right = [
        key_view("lines", lines(hands, look.light), look.light),
        plots[0] if len(plots) == 1 else rrb.Tabs(*plots),
        *below,
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*left, row_shares=[*shares, sum(shares) / 13]),
            rrb.Vertical(
                *right, row_shares=[1.0, 11.0, 0.9 + 0.5 * min(len(hands), 4)][: len(right)]
            ),
            column_shares=[4, 5],
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


def _groups(hands: Sequence[Shown], look: Look) -> list[list[Shown]]:
    """The hands of each 3D view."""
    runs = dict.fromkeys(hand.run for hand in hands)
    if not look.apart or len(runs) < 2:
        return [list(hands)]
    return [[hand for hand in hands if hand.run == run] for run in runs]


def _with_skin(hands: Sequence[Shown], look: Look) -> bool:
    return look.mesh and any(hand.track.n_vertices for hand in hands)


def _worlds(
    hands: Sequence[Shown], look: Look, at: Placed, several: bool
) -> rrb.Container | rrb.View:
    """The hands, and where they have a skin, the same without it."""
    import rerun.blueprint as rrb

    apart = look.apart and several and hands[0].run_name
    name = hands[0].run_name if apart else "hands" if several else "hand"
    shown = [f"/world/{hand.topic}/**" for hand in hands]
    hidden = [f"- /world/{hand.topic}/skin" for hand in hands]
    # what goes along with the hand is drawn in the hand's own frame: Rerun's tracked entities
    # are looked at from anywhere until they are there (0.41)
    origin = f"world/{hands[0].topic}/middle" if at.view.goes_along else "world"
    whole = _world(shown, f"{name}, grid of {100 * GRID_M:.0f} cm", at.view, origin, look)
    if not _with_skin(hands, look):
        return whole
    bones = _world([*shown, *hidden], f"{name}: bones and joints", at.view, origin, look)
    return (rrb.Vertical if at.stacked else rrb.Horizontal)(whole, bones)


def _world(contents: list[str], name: str, view: Eye, origin: str, look: Look) -> rrb.Spatial3DView:
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        background=rrb.Background(color=style.ground(look.light).world),
        line_grid=_grid(view, look.light),
        **eye_controls(view),
    )


def _grid(view: Eye, light: bool) -> rrb.LineGrid3D:
    """A scale below the hands, square to their up: where the floor is nobody knows."""
    import rerun as rr
    import rerun.blueprint as rrb

    if view.goes_along:  # it would go along too: `log_ground` draws one that stays
        return rrb.LineGrid3D(visible=False)
    up = view.up / np.linalg.norm(view.up)
    return rrb.LineGrid3D(
        visible=True,
        spacing=GRID_M,
        plane=rr.components.Plane3D(up.tolist(), view.floor),
        color=style.ground(light).grid,
        stroke_width=1.0,
    )


def _plots(hand: Shown, look: Look) -> rrb.Vertical:
    """The angles of a hand and its events, and its errors."""
    topic = hand.topic
    views = [_plot(f"{f} [deg]", "angles", [f"/angles/{topic}/{f}/**"], look) for f in FINGERS]
    errors = _plot(_errors_name(hand), f"errors/{topic}", None, look)
    return _arranged([*views, _log([topic])], errors, topic)


def _errors_name(hand: Shown) -> str:
    """With the colours, as a legend would lie over the lines (those of `style.ERRORS`).

    What was seen in pictures has its error there: its observed joints are only what was made of
    the pictures."""
    name = "errors [mm]: to the observed, mean blue, max grey"
    if hand.track.truth is not None:
        name += "; to the truth, mean green"
    pixels = reprojection_px(hand.track.settings)
    if pixels is None or not isinstance(pixels.get("mean"), int | float):
        return name
    mean, p95 = (float(pixels.get(part, np.nan)) for part in ("mean", "p95"))
    return f"{name}; in the pictures, mean {mean:.1f} px, p95 {p95:.1f} px"


def _compared(hand: Shown, first: Shown, look: Look) -> rrb.Vertical:
    """The filtered angles of two runs in the same plots, and how far apart their joints are."""
    topics = [first.topic, hand.topic]
    views = []
    for finger in FINGERS:
        contents = [f"/angles/{topic}/{finger}/angles" for topic in topics]
        contents.append(f"/angles/{first.topic}/{finger}/limits")
        views.append(_plot(f"{finger} [deg]", "angles", contents, look))
    difference = f"difference/{hand.topic}"
    below = _plot("between the joints [mm]: mean blue, max grey", difference, None, look)
    name = f"{first.topic}, pale: {hand.topic}"
    return _arranged([*views, _log(topics)], below, name)


def _arranged(views: Sequence[rrb.View], below: rrb.TimeSeriesView, name: str) -> rrb.Vertical:
    """Five fingers and the events in two columns; what is wide below them."""
    import rerun.blueprint as rrb

    grid = rrb.Grid(*views, grid_columns=2)
    return rrb.Vertical(grid, below, row_shares=[5, 2], name=name)


def _log(topics: Sequence[str]) -> rrb.TextLogView:
    import rerun.blueprint as rrb

    contents = [f"/log/{topic}" for topic in topics]
    return rrb.TextLogView(
        origin="log", contents=contents, name="events", **log_columns("LogLevel", "Body")
    )


def _plot(name: str, origin: str, contents: list[str] | None, look: Look) -> rrb.TimeSeriesView:
    """A plot, without a key in it: the strip above the plots and their names tell."""
    import rerun.blueprint as rrb

    ground = style.ground(look.light)
    return rrb.TimeSeriesView(
        origin=origin,
        contents=contents or "$origin/**",
        name=name,
        plot_legend=rrb.PlotLegend(visible=False),
        **(plot_background(ground.plot) if ground.plot else {}),
    )
