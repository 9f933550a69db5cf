"""What tells how large hands are, and how they lie: the world's axes and a bar of 5 or 10 cm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from handtrack.viewer import style
from handtrack.viewer.eye import Eye

if TYPE_CHECKING:
    import rerun as rr

_DOWN = 0.88  # of the way to the lower edge of what is seen
_WIDE_M = 0.25  # half of a picture whose bar is the longer one


def log_scale(recording: rr.RecordingStream, entity: str, view: Eye, light: bool) -> None:
    """The axes at the lower left of what is seen, the bar at the lower right, in the plane of
    what the eye looks at.

    Args:
        recording: where to.
        entity: under which; its origin is the eye's target where the eye goes along.
        view: the eye.
        light: on a light ground.
    """
    import rerun as rr

    width, height = view.extent
    corner = -_DOWN * height * view.upward + (0 if view.goes_along else view.target)
    length = 0.1 if width > _WIDE_M else 0.05
    left, right = corner - width * view.right, corner + width * view.right
    vectors = 0.5 * length * np.eye(3)
    axes = rr.Arrows3D(
        origins=[left] * 3,
        vectors=vectors,
        radii=0.015 * length,
        colors=[style.toned(colour, light) for colour in style.AXES],
    )
    recording.log(f"{entity}/axes", axes, static=True)
    bar = rr.LineStrips3D(
        [[right - length * view.right, right]],
        radii=0.02 * length,
        colors=style.ground(light).text,
    )
    recording.log(f"{entity}/bar", bar, static=True)
    # names stand on boxes of the viewer's, which are grey on any ground: light on them
    names = rr.Points3D(
        [*(left + 1.2 * vectors), right - 0.5 * length * view.right],
        radii=1e-5,
        colors=[*([style.DARK.text] * 3 if light else style.AXES), style.DARK.text],
        labels=["x", "y", "z", f"{100 * length:.0f} cm"],
        show_labels=True,
    )
    recording.log(f"{entity}/names", names, static=True)
