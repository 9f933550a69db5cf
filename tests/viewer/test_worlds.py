"""The 3D views: an opaque skin, the bones that it hides, and a scale."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_checks import rrd_columns

from handtrack.tracking.track import Track
from handtrack.viewer.blueprint import Seen, blueprint, eye
from handtrack.viewer.rerun_log import log_rerun
from handtrack.viewer.shown import Run, shown


def worlds(arranged: Any) -> list[Any]:
    """The 3D views of a blueprint, from above to below and from left to right."""
    views, look = [], [arranged.root_container]
    while look:
        at = look.pop(0)
        if type(at).__name__ == "Spatial3DView":
            views.append(at)
        look[:0] = getattr(at, "contents", []) if hasattr(at, "row_shares") else []
    return views


def test_an_opaque_skin_does_not_hide_the_bones(track: Track, tmp_path: Path) -> None:
    path = log_rerun(track, save=tmp_path / "run.rrd")
    assert path is not None
    found = rrd_columns(path)
    (colour,) = found["/world/right/skin"]["Mesh3D:albedo_factor"][0]
    assert colour & 0xFF == 0xFF
    hands = shown([Run("", [track])])
    skin, bones = worlds(blueprint(hands))
    assert skin.contents == ["/world/right/**"]
    assert bones.contents == ["/world/right/**", "- /world/right/skin"]
    (alone,) = worlds(blueprint(hands, mesh=False))
    assert alone.contents == ["/world/right/**"]


def test_the_grid_is_a_scale_below_the_hand(track: Track) -> None:
    view = eye([Seen.of(track)])
    grid = worlds(blueprint(shown([Run("", [track])])))[0].properties["LineGrid3D"]
    normal, distance = np.split(np.array(grid.plane.as_arrow_array().to_pylist()[0]), [3])
    np.testing.assert_allclose(normal, view.up, atol=1e-6)
    assert grid.visible.as_arrow_array().to_pylist() == [True]
    assert grid.spacing.as_arrow_array().to_pylist() == pytest.approx([0.05])
    heights = track.fitted_joints @ view.up - distance
    known = heights[np.isfinite(heights)]
    assert (known > 0).mean() > 0.97
    assert known.min() < 0.15  # not far from them
