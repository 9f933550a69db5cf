"""What the installed version of Rerun can do, from 0.24 on."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from handtrack.viewer.eye import Eye

if TYPE_CHECKING:
    import rerun.blueprint as rrb


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
    """Where a 3D view looks from (from 0.28); beside the hand where it goes along with it."""
    import rerun.blueprint as rrb

    controls = getattr(rrb, "EyeControls3D", None)
    if controls is None or "position" not in inspect.signature(controls).parameters:
        return {}
    origin = view.target - view.looked_at
    looking = controls(
        kind=rrb.Eye3DKind.Orbital,
        position=(view.position - origin).tolist(),
        look_target=view.looked_at.tolist(),
        eye_up=view.up.tolist(),
    )
    return {"eye_controls": looking}


def plot_background(colour: tuple[int, int, int]) -> dict[str, Any]:
    """The background of a plot, where it can be chosen (from 0.26)."""
    import rerun.blueprint as rrb

    kind = getattr(rrb.archetypes, "PlotBackground", None)
    if kind is None:
        return {}
    return accepted(rrb.TimeSeriesView, background=kind(color=colour, show_grid=True))


def log_columns(*names: str) -> dict[str, Any]:
    """Which columns a TextLogView shows, where that can be said (from 0.28)."""
    import rerun.blueprint as rrb

    if not hasattr(rrb, "TextLogColumns"):
        return {}
    where = "encodings" if importlib.util.find_spec("rerun.blueprint.encodings") else "datatypes"
    kind = importlib.import_module(f"rerun.blueprint.{where}").TextLogColumnKind
    kinds = [getattr(kind, name) for name in names]
    return {"columns": rrb.TextLogColumns(text_log_columns=kinds)}


def status_views() -> list[rrb.View]:
    """The hands' states over time, where they are drawn."""
    import rerun.blueprint as rrb

    return [rrb.StateTimelineView(origin="status", name="status")] if draws_states() else []
