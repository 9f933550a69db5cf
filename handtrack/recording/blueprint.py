"""How the viewer is arranged when a recording opens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import BASES, FINGERS
from handtrack.recording.topics import hand_topics
from handtrack.tracking.track import Track

if TYPE_CHECKING:
    import rerun.blueprint as rrb

Array = NDArray[np.float64]

_BACKGROUND = (24, 27, 34)


def blueprint(tracks: Sequence[Track]) -> rrb.Blueprint:
    """The 3D view at the left; the angles by finger, the errors and the log at the right."""
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumnKind as Column

    topics = hand_topics((t.name, t.hand) for t in tracks)
    position, target, up = eye(tracks)
    world = rrb.Spatial3DView(
        origin="world",
        name="hands" if len(tracks) > 1 else "hand",
        background=rrb.Background(color=_BACKGROUND),
        # a grid would claim to know the floor
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=up
        ),
    )
    plots = [_plots(topic) for topic in topics]
    status = rrb.StateTimelineView(origin="status", name="status")
    columns = [Column.EntityPath, Column.LogLevel, Column.Body]
    log = rrb.TextLogView(
        origin="log",
        name="events",
        # whose line it is matters only where there are several
        columns=rrb.TextLogColumns(text_log_columns=columns if len(topics) > 1 else columns[1:]),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            world,
            rrb.Vertical(
                plots[0] if len(plots) == 1 else rrb.Tabs(*plots),
                rrb.Horizontal(status, log, column_shares=[1, 2]),
                row_shares=[4, 1],
            ),
            column_shares=[1, 1],
        ),
        rrb.TimePanel(state="collapsed", timeline="time", loop_mode="all"),
        collapse_panels=True,
    )


def _plots(topic: str) -> rrb.Grid:
    import rerun.blueprint as rrb

    views = [
        rrb.TimeSeriesView(
            origin=f"angles/{topic}/{finger}",
            name=f"{finger} [deg]",
            # the colours mean the same in every finger: the top row's key is enough
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=finger in FINGERS[:2]),
        )
        for finger in FINGERS
    ]
    errors = rrb.TimeSeriesView(origin=f"errors/{topic}", name="errors [mm]")
    return rrb.Grid(*views, errors, grid_columns=2, name=topic)


def eye(tracks: Sequence[Track]) -> tuple[list[float], list[float], list[float]]:
    """Where to look from, where to, and which way is up, in the world [m].

    The frame of the world is the source's: nothing says which way is up. So the hands say it:
    fingers upwards, seen from the back of the hand, from as far as shows all of the motion.
    """
    joints = np.concatenate([t.fitted_joints for t in tracks] + [t.observed for t in tracks])
    points = joints[np.isfinite(joints).all(-1)]
    whole = joints[np.isfinite(joints).all((1, 2))]
    low, high = np.array([-0.1] * 3), np.array([0.1] * 3)
    if len(points):
        low, high = np.percentile(points, [1, 99], axis=0)
    target = (low + high) / 2
    up = _direction(whole[:, BASES[2]] - whole[:, 0], np.array([0.0, 0.0, 1.0]))
    backs = [_backs(t) for t in tracks]
    away = _direction(np.concatenate(backs), np.array([1.0, 0.0, 0.0]))
    away = away - (away @ up) * up
    if np.linalg.norm(away) < 1e-3:
        away = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    away /= np.linalg.norm(away)
    distance = 1.05 * max(float(np.linalg.norm(high - low)), 0.2)
    # a little from above and from the side shows depth
    side = np.cross(up, away)
    offset = away + 0.25 * side + 0.3 * up
    position = target + distance * offset / np.linalg.norm(offset)
    return position.tolist(), target.tolist(), up.tolist()


def _direction(vectors: Array, otherwise: Array) -> Array:
    """Mean direction of vectors (n, 3); `otherwise` where they cancel or there is none."""
    mean = vectors.mean(0) if len(vectors) else np.zeros(3)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-3 else otherwise


def _backs(track: Track) -> Array:
    """Directions (n, 3) out of the back of the hand [m^2, not normalised]."""
    joints = track.fitted_joints[np.isfinite(track.fitted_joints).all((1, 2))]
    index, little = joints[:, BASES[1]] - joints[:, 0], joints[:, BASES[4]] - joints[:, 0]
    normal = np.cross(little, index)
    return normal if track.hand == "right" else -normal
