"""The 3D views: an opaque skin, the bones that it hides, and a scale."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_checks import rrd_columns

from handtrack.tracking.track import Track
from handtrack.viewer import style
from handtrack.viewer.blueprint import blueprint
from handtrack.viewer.eye import Seen, eye
from handtrack.viewer.key import dots, lines
from handtrack.viewer.rerun_log import log_rerun
from handtrack.viewer.shown import Run, shown
from handtrack.viewer.style import Look


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
    (alone,) = worlds(blueprint(hands, Look(mesh=False)))
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


def test_a_light_ground_has_dark_lines(track: Track, tmp_path: Path) -> None:
    hands = shown([Run("", [track])])
    grounds = []
    for light in (False, True):
        world = worlds(blueprint(hands, Look(light=light)))[0]
        (colour,) = world.properties["Background"].color.as_arrow_array().to_pylist()
        grounds.append((colour >> 8 & 0xFF) / 255)
    assert grounds[0] < 0.2
    assert grounds[1] > 0.9
    path = log_rerun(track, save=tmp_path / "light.rrd", light=True, mesh=False)
    assert path is not None
    assert rrd_columns(path)["/world/right"]["AnnotationContext:context"]
    for light in (False, True):
        kinds = style.skeletons(0, light).values()
        assert len({colour for _, colour, _ in kinds}) == len(kinds)
    for _, (red, green, blue, _), _ in style.skeletons(0, light=True).values():
        # darker than the ground by far: every dot can be seen
        assert 0.3 * red + 0.59 * green + 0.11 * blue < 180


def test_two_runs_stand_side_by_side_unless_told(track: Track, tmp_path: Path) -> None:
    hands = shown([Run("a", [track]), Run("b", [track])])
    apart = worlds(blueprint(hands))
    assert [view.name for view in apart if "grid" in view.name] == [
        "a, grid of 5 cm",
        "b, grid of 5 cm",
    ]
    assert len(worlds(blueprint(hands, Look(apart=False)))) == 2


def test_the_key_names_what_is_shown(track: Track) -> None:
    (hand,) = shown([Run("", [track])])
    assert [e.label for e in dots([hand])] == [
        *("observed", "fitted", "filtered", "truth"),
        *("at a limit", "outside limits", "rejected"),
    ]
    assert {e.label for e in lines([hand])} >= {"base flexion", "thin: raw", "band: limit"}
    plain = dataclasses.replace(track, settings={"filter": "none"}, truth=None)
    (hand,) = shown([Run("", [plain])])
    names = [e.label for e in [*dots([hand]), *lines([hand])]]
    assert not {"filtered", "truth", "thin: raw"} & set(names)
    # its colours are those of what it names
    skeletons = {name: colour for name, colour, _ in style.skeletons(0).values()}
    assert [skeletons[e.label] for e in dots([hand])[:2]] == [e.colour for e in dots([hand])[:2]]


def test_the_error_in_pictures_is_told_in_pixels(track: Track) -> None:
    pixels = {"views": 2, "reprojection_px": {"mean": 3.21, "p95": 7.5}}
    seen = dataclasses.replace(track, settings=dict(track.settings) | {"cameras": pixels})
    names = []
    for each in (track, seen):
        arranged, found = blueprint(shown([Run("", [each])])), []
        look = [arranged.root_container]
        while look:
            at = look.pop(0)
            found.append(str(at.name))
            look += getattr(at, "contents", []) if hasattr(at, "row_shares") else []
            look += at.contents if type(at).__name__ in ("Horizontal", "Grid") else []
        names.append({name for name in found if name.startswith("errors")})
    name = "errors [mm]: to the observed, mean blue, max grey; to the truth, mean green"
    assert names == [{name}, {f"{name}; in the pictures, mean 3.2 px, p95 7.5 px"}]
