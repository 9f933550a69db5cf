"""Recordings as other people's readers see them: npm's @mcap/core and rerun's checker.

.ci/run installs the npm packages and names their folder in NODE_PATH.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from made_tracks import make_track
from recording_checks import decoder, messages
from screens import lacking

from handtrack.recording.recorder import McapRecorder
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track
from handtrack.viewer.process import _executable

CHECK = Path(__file__).parent / "mcap_core_check.mjs"


@pytest.fixture(params=["lz4", "zstd", "none", "stretches"])
def written(request: pytest.FixtureRequest, two_hands: list[Track], tmp_path: Path) -> Path:
    path = tmp_path / "run.mcap"
    if request.param != "stretches":
        return write_mcap(two_hands, path, compression=request.param, foxglove_mesh=True)
    names = [(t.name, t.hand) for t in two_hands]
    with McapRecorder(path, hands=names, mesh="quantised", foxglove_mesh=True) as recorder:
        for hand, track in enumerate(two_hands):
            recorder.add(track, hand)
    return path


def test_typescript(written: Path, two_hands: list[Track], tmp_path: Path) -> None:
    modules = os.environ.get("NODE_PATH", "")
    node = shutil.which("node")
    if node is None or not Path(modules, "@mcap", "core").is_dir():
        lacking("node", "it or its packages are not there (NODE_PATH)")
    # node looks for packages beside the script
    (tmp_path / "node_modules").symlink_to(modules)
    script = shutil.copy(CHECK, tmp_path)
    ran = subprocess.run([node, script, str(written)], capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    found = json.loads(ran.stdout)
    expected = {topic: len(rows) for topic, rows in messages(written).items()}
    assert found["topics"] == expected
    assert int(found["messages"]) == found["streamed"] == sum(expected.values())
    assert "handtrack.summary" in found["metadata"]
    times = sorted(int(t) for track in two_hands for t in track.time_ns)
    assert [int(state["time"]) for state in found["states"]] == times
    first = found["states"][0]
    np.testing.assert_array_equal(first["angles"], two_hands[0].angles[0])
    assert first["status"] == two_hands[0].status[0]


def test_rerun_finds_nothing_wrong(written: Path) -> None:
    command = [str(_executable()), "mcap", "check", "--full", str(written)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120)
    rows = [line.split() for line in ran.stdout.splitlines() if "/" in line][1:]
    status = {row[3]: row[0] for row in rows}
    assert set(messages(written)) <= set(status)
    assert set(status.values()) == {"ok"}, ran.stdout + ran.stderr


def test_the_scene_is_the_skin(tmp_path: Path) -> None:
    """foxglove.SceneUpdate, decoded by the schema in the file."""
    track = make_track(40)
    found = messages(write_mcap(track, tmp_path / "a.mcap", foxglove_mesh=True))["/right/skin"]
    make = decoder(found[0][1])
    vertices = track.vertices()
    assert len(found) == len(track)
    for i in (0, 21, 39):
        scene = make.FromString(found[i][2])
        if track.status[i] == "lost":
            assert not scene.entities
            assert [d.id for d in scene.deletions] == ["right"]
            continue
        (entity,) = scene.entities
        assert not scene.deletions
        assert (entity.frame_id, entity.id) == ("world", "right")
        stamp = entity.timestamp
        assert stamp.seconds * 10**9 + stamp.nanos == track.time_ns[i]
        (triangles,) = entity.triangles
        points = np.array([[p.x, p.y, p.z] for p in triangles.points])
        np.testing.assert_array_equal(points, vertices[i])
        np.testing.assert_array_equal(np.array(triangles.indices).reshape(-1, 3), track.model.faces)
        assert triangles.pose.orientation.w == 1
        assert triangles.color.a == 1
