"""Foxglove's layout: each panel shows what recordings hold, and none stays empty."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from made_tracks import make_track
from mcap.reader import make_reader

from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS
from handtrack.recording.write import write_mcap


@pytest.fixture(scope="module")
def layout() -> dict[str, Any]:
    text = files("handtrack.viewer").joinpath("foxglove_layout.json").read_text(encoding="utf-8")
    made: dict[str, Any] = json.loads(text)
    return made


def panels(at: Any) -> Iterator[str]:
    """The names of the panels in a tree of them."""
    if isinstance(at, str):
        yield at
    else:
        yield from panels(at["first"])
        yield from panels(at["second"])


def test_every_panel_has_a_place_and_settings(layout: dict[str, Any]) -> None:
    placed = list(panels(layout["layout"]))
    for tab in layout["configById"]["Tab!fingers"]["tabs"]:
        placed += panels(tab["layout"])
    assert sorted(placed) == sorted(layout["configById"])


def test_every_topic_and_field_is_in_recordings(layout: dict[str, Any], tmp_path: Path) -> None:
    path = write_mcap(make_track(5), tmp_path / "x.mcap", foxglove_mesh=True)
    with path.open("rb") as file:
        found = {c.topic for _, c, _ in make_reader(file).iter_messages()}
    config = layout["configById"]
    topics = set(config["3D!hands"]["topics"])
    topics |= {config[f"RosOut!{hand}"]["topicToRender"] for hand in ("right", "left")}
    paths = [p["value"] for panel in config.values() for p in panel.get("paths", ())]
    topics |= {path.partition(".")[0] for path in paths}
    assert {t for t in topics if t.startswith("/right/")} == found - {
        "/right/model",
        "/right/event",
        "/right/transforms",
        "/right/robot_description",  # the skin is drawn
    }
    assert {t.replace("/left/", "/right/") for t in topics} <= found
    assert not re.search("velocity|effort", json.dumps(layout))


def test_every_angle_is_plotted_once_under_its_name(layout: dict[str, Any]) -> None:
    for hand in ("right", "left"):
        for f, finger in enumerate(FINGERS):
            lines = layout["configById"][f"Plot!{hand}_{finger}"]["paths"]
            for k, line in enumerate(lines):
                assert line["value"] == f"/{hand}/joint_states.position[{4 * f + k}]"
                assert f"{finger}_{line['label'].replace(' ', '_')}" == ANGLE_NAMES[4 * f + k]
            assert len(lines) == 4
