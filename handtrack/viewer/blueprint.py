"""How the viewer is arranged when a recording opens, and where it looks from, as far as the
installed version of Rerun can do it."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import BASES, FINGERS
from handtrack.tracking.track import Part
from handtrack.viewer.shown import Shown, counterpart

if TYPE_CHECKING:
    import rerun.blueprint as rrb

_BACKGROUND = (24, 27, 34)
_GRID = (58, 64, 76, 255)
GRID_M = 0.05
"""Between the lines of the grid below the hands [m]."""


def blueprint(
    hands: Sequence[Shown],
    *,
    side_by_side: bool = False,
    follow: bool = False,
    view: Eye | None = None,
    pictures: Sequence[str] = (),
    mesh: bool = True,
) -> rrb.Blueprint:
    """The hand at the left, below it its bones without the skin that hides them; the angles by
    finger, the errors and the log at the right.

    Args:
        hands: what is shown, of one recording or of several.
        side_by_side: a 3D view for each recording, instead of one for all.
        follow: stay at the time that came last.
        view: where to look from; as shows all of the motion by default.
        pictures: names of cameras whose pictures are shown below the hands.
        mesh: the skin is sent, where there is one.
    """
    import rerun.blueprint as rrb

    view = view or eye([Seen.of(hand.track, hand.offset) for hand in hands])
    runs = dict.fromkeys(hand.run for hand in hands)
    if side_by_side and len(runs) > 1:
        groups = [[hand for hand in hands if hand.run == run] for run in runs]
        # views that are narrow need a step back
        view = view.farther(1 + 0.2 * min(len(groups), 4))
        worlds = [_worlds(group, group[0].run_name, view, mesh) for group in groups]
    else:
        worlds = [_worlds(hands, "hands" if len(hands) > 1 else "hand", view, mesh)]
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


def _worlds(hands: Sequence[Shown], name: str, view: Eye, mesh: bool) -> rrb.Container | rrb.View:
    """The hands, and where they have a skin, below them the same without it."""
    import rerun.blueprint as rrb

    shown = [f"/world/{hand.topic}/**" for hand in hands]
    hidden = [f"- /world/{hand.topic}/skin" for hand in hands]
    whole = _world(shown, f"{name}, grid of {100 * GRID_M:.0f} cm", view)
    if not mesh or not any(hand.track.n_vertices for hand in hands):
        return whole
    return rrb.Vertical(
        whole,
        _world([*shown, *hidden], f"{name}: bones and joints", view),
        row_shares=[1, 1],
    )


def _world(contents: list[str], name: str, view: Eye) -> rrb.Spatial3DView:
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin="world",
        contents=contents,
        name=name,
        background=rrb.Background(color=_BACKGROUND),
        line_grid=_grid(view),
        **eye_controls(view),
    )


def _grid(view: Eye) -> rrb.LineGrid3D:
    """A scale below the hands, square to their up: where the floor is nobody knows."""
    import rerun as rr
    import rerun.blueprint as rrb

    up = view.up / np.linalg.norm(view.up)
    # the eye is as far from the middle as what it sees is long
    below = float(np.linalg.norm(view.position - view.target)) / 2
    return rrb.LineGrid3D(
        visible=True,
        spacing=GRID_M,
        plane=rr.components.Plane3D(up.tolist(), float(up @ view.target) - below),
        color=_GRID,
        stroke_width=1.0,
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


Array = NDArray[np.float64]

_MOST = 2000  # frames looked at of each hand


class Seen(NamedTuple):
    """Joints (n, 21, 3) of a hand [m], NaN = missing, as far as they are to be in view."""

    hand: str
    joints: Array

    @staticmethod
    def of(track: Part, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> Seen:
        """The fitted joints of a track and the observed ones, moved by an offset."""
        some = slice(None, None, 1 + len(track) // _MOST)
        joints = np.concatenate([track.fitted_joints[some], track.observed[some]])
        return Seen(track.hand, joints + np.asarray(offset))


class Eye(NamedTuple):
    """Where to look from, where to [m], and which way is up, in the world."""

    position: Array
    target: Array
    up: Array

    @property
    def right(self) -> Array:
        """The direction to the right of the picture."""
        across = np.cross(self.target - self.position, self.up)
        return np.asarray(across / np.linalg.norm(across))

    def farther(self, factor: float) -> Eye:
        """The same view from so many times as far."""
        return self._replace(position=self.target + factor * (self.position - self.target))


def eye(hands: Sequence[Seen]) -> Eye:
    """An eye that sees the hands.

    The frame of the world is the source's: nothing says which way is up. So the hands say it:
    fingers upwards, seen from the back of the hand, from as far as shows all of the motion.
    """
    joints = np.concatenate([hand.joints for hand in hands])
    points = joints[np.isfinite(joints).all(-1)]
    whole = joints[np.isfinite(joints).all((1, 2))]
    low, high = np.array([-0.1] * 3), np.array([0.1] * 3)
    if len(points):
        low, high = np.percentile(points, [1, 99], axis=0)
    target = (low + high) / 2
    up = _direction(whole[:, BASES[2]] - whole[:, 0], np.array([0.0, 0.0, 1.0]))
    away = _direction(np.concatenate([_backs(h) for h in hands]), np.array([1.0, 0.0, 0.0]))
    away = away - (away @ up) * up
    if np.linalg.norm(away) < 1e-3:
        away = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    away /= np.linalg.norm(away)
    distance = 1.05 * max(float(np.linalg.norm(high - low)), 0.2)
    # a little from above and from the side shows depth
    side = np.cross(up, away)
    offset = away + 0.25 * side + 0.3 * up
    return Eye(target + distance * offset / np.linalg.norm(offset), target, up)


def _direction(vectors: Array, otherwise: Array) -> Array:
    """Mean direction of vectors (n, 3); `otherwise` where they cancel or there is none."""
    mean = vectors.mean(0) if len(vectors) else np.zeros(3)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-3 else otherwise


def _backs(hand: Seen) -> Array:
    """Directions (n, 3) out of the back of the hand [m^2, not normalised]."""
    joints = hand.joints[np.isfinite(hand.joints).all((1, 2))]
    index, little = joints[:, BASES[1]] - joints[:, 0], joints[:, BASES[4]] - joints[:, 0]
    normal = np.cross(little, index)
    return normal if hand.hand == "right" else -normal


def accepted(function: Callable[..., Any], **wanted: Any) -> dict[str, Any]:
    """The arguments among those wanted that a function of this version knows."""
    known = inspect.signature(function).parameters
    return {name: value for name, value in wanted.items() if name in known}


def draws_states() -> bool:
    """Whether states over time are drawn as bands (from 0.32); the log tells them too."""
    import rerun as rr

    return hasattr(rr, "StateChange")


def writes_footers() -> bool:
    """Whether a file that is complete ends in a footer (from 0.28)."""
    import rerun as rr

    return tuple(map(int, rr.__version__.split(".")[:2])) >= (0, 28)


def eye_controls(view: Eye) -> dict[str, Any]:
    """Where a 3D view looks from, where that can be said (from 0.28)."""
    import rerun.blueprint as rrb

    controls = getattr(rrb, "EyeControls3D", None)
    if controls is None or "position" not in inspect.signature(controls).parameters:
        return {}
    looking = controls(
        kind=rrb.Eye3DKind.Orbital,
        position=view.position.tolist(),
        look_target=view.target.tolist(),
        eye_up=view.up.tolist(),
    )
    return {"eye_controls": looking}


def log_columns(*names: str) -> dict[str, Any]:
    """Which columns a TextLogView shows, where that can be said (from 0.28)."""
    import rerun.blueprint as rrb

    if not hasattr(rrb, "TextLogColumns"):
        return {}
    where = "encodings" if importlib.util.find_spec("rerun.blueprint.encodings") else "datatypes"
    kind = importlib.import_module(f"rerun.blueprint.{where}").TextLogColumnKind
    kinds = [getattr(kind, name) for name in names]
    return {"columns": rrb.TextLogColumns(text_log_columns=kinds)}


def status_views(log: rrb.TextLogView) -> list[rrb.View]:
    """The hands' states beside the log, or the log alone."""
    import rerun.blueprint as rrb

    states = [rrb.StateTimelineView(origin="status", name="status")] if draws_states() else []
    return [*states, log]
