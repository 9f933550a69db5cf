"""What Rerun gets: entities, rows and values, read back from the .rrd file."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_checks import rrd_columns

from handtrack.hand.skeleton import FINGERS
from handtrack.hand.skinning import VertexNormals
from handtrack.tracking.track import Track
from handtrack.viewer.rerun_log import log_rerun

pytestmark = pytest.mark.filterwarnings("error")


def test_entities(found: dict[str, Any]) -> None:
    expected = {f"/world/right/{n}" for n in ("skin", "observed", "fitted", "filtered", "truth")}
    expected |= {"/world/right/limits", "/world/right/rejected"}
    expected |= {
        f"/angles/right/{f}/{kind}"
        for f in FINGERS
        for kind in ("raw", "angles", "limits", "events")
    }
    expected |= {f"/world/right/scale/{n}" for n in ("axes", "bar", "names")}
    expected |= {f"/key/dots/{n}" for n in ("names", "dots", "rings")}
    expected |= {f"/key/lines/{n}" for n in ("names", "dots", "lines")}
    expected |= {"/world/right", "/errors/right", "/status/right", "/log/right"}
    assert set(found) - {"/__properties"} == expected


def test_rejected_joints_are_marked_where_they_were_seen(
    found: dict[str, Any], track: Track
) -> None:
    rows = found["/world/right/rejected"]
    shown = dict(zip(rows["frame"], rows["Points3D:positions"], strict=True))
    assert track.rejected.any()
    last: Any = []
    for t, frame in enumerate(track.frame_index.tolist()):
        last = shown.get(frame, last)
        expected = track.observed[t][track.rejected[t]].astype(np.float32)
        np.testing.assert_array_equal(np.array(last).reshape(-1, 3), expected)


def test_turns_are_marked_among_the_angles(found: dict[str, Any], track: Track) -> None:
    for finger in FINGERS:
        rows = found[f"/angles/right/{finger}/events"]
        # predicted in the first frame, lost at 20, found again at 26
        assert rows["frame"] == [100, 101, 120, 126]
        gone, back = np.array(rows["Scalars:scalars"]).T
        np.testing.assert_array_equal(gone, [0.0, np.nan, 0.0, np.nan])
        np.testing.assert_array_equal(back, [np.nan, 0.0, np.nan, 0.0])
    assert track.restart[26]


def test_timelines(found: dict[str, Any], track: Track) -> None:
    for entity in ("/world/right/skin", "/world/right/fitted", "/angles/right/thumb/raw"):
        assert found[entity]["frame"] == track.frame_index.tolist()
        assert found[entity]["time"] == track.time_ns.tolist()


def test_skin(found: dict[str, Any], track: Track) -> None:
    skin = found["/world/right/skin"]
    vertices = track.vertices().astype(np.float32)
    normals = VertexNormals(track.model.faces, vertices.shape[1])(vertices)
    for i, (points, normal) in enumerate(
        zip(skin["Mesh3D:vertex_positions"], skin["Mesh3D:vertex_normals"], strict=True)
    ):
        if track.status[i] == "lost":
            assert points == normal == []
        elif i % 10 == 0:
            np.testing.assert_array_equal(points, vertices[i])
            np.testing.assert_allclose(normal, normals[i], atol=1e-6)
    faces = skin["Mesh3D:triangle_indices"][0]
    np.testing.assert_array_equal(faces, track.model.faces)


def test_a_skin_recorded_now_and_then_stays_in_between(track: Track, tmp_path: Path) -> None:
    class Recorded:
        """Every third skin of the track, as a recording of a licensed model gives them."""

        n_vertices, faces = track.n_vertices, track.faces

        def vertices(self, frames: Any) -> np.ndarray:
            out = track.vertices()
            out[np.arange(len(out)) % 3 > 0] = np.nan
            return out[frames]

    path = log_rerun(dataclasses.replace(track, skin=Recorded()), save=tmp_path / "run.rrd")
    assert path is not None
    skin = rrd_columns(path)["/world/right/skin"]
    counts = dict(zip(skin["frame"], map(len, skin["Mesh3D:vertex_positions"]), strict=True))
    lost = track.status == "lost"
    expected = {
        frame: 0 if gone else track.n_vertices
        for i, (frame, gone) in enumerate(zip(track.frame_index.tolist(), lost, strict=True))
        if gone or i % 3 == 0
    }
    assert counts == expected


@pytest.mark.parametrize(
    ("name", "attribute"),
    [
        ("observed", "observed"),
        ("fitted", "fitted_joints"),
        ("filtered", "filtered_joints"),
        ("truth", "truth"),
    ],
)
def test_skeletons(name: str, attribute: str, found: dict[str, Any], track: Track) -> None:
    entity = found[f"/world/right/{name}"]
    joints = getattr(track, attribute)
    ids = entity["Points3D:keypoint_ids"]
    assert len(ids) == len(track)
    for i, (which, points) in enumerate(zip(ids, entity["Points3D:positions"], strict=True)):
        present = np.flatnonzero(np.isfinite(joints[i]).all(-1))
        assert which == present.tolist()
        expected = joints[i, present].astype(np.float32)
        np.testing.assert_array_equal(np.array(points).reshape(-1, 3), expected)


def test_angles_are_degrees_by_finger(found: dict[str, Any], track: Track) -> None:
    for f, finger in enumerate(FINGERS):
        for kind, angles in (("raw", track.angles_raw), ("angles", track.angles)):
            entity = found[f"/angles/right/{finger}/{kind}"]
            expected = np.rad2deg(angles[:, 4 * f : 4 * f + 4])
            np.testing.assert_array_equal(entity["Scalars:scalars"], expected)
            assert len(entity["SeriesLines:names"][0]) == 4
    names = found["/angles/right/index/angles"]["SeriesLines:names"][0]
    assert names == ["MCP flexion", "MCP abduction", "PIP flexion", "DIP flexion"]


def test_errors_are_millimetres(found: dict[str, Any], track: Track) -> None:
    values = np.array(found["/errors/right"]["Scalars:scalars"])
    known = track.status != "lost"
    used = np.where(track.rejected, np.nan, track.error)[known]
    np.testing.assert_allclose(values[known, 0], 1e3 * np.nanmean(used, 1))
    np.testing.assert_allclose(values[known, 1], 1e3 * np.nanmax(used, 1))
    assert track.truth is not None
    off = np.linalg.norm(track.filtered_joints - track.truth, axis=-1).mean(1)
    np.testing.assert_allclose(values[known, 2], 1e3 * off[known], atol=1e-9)
    assert np.isnan(values[~known]).all()


def test_status_and_log(found: dict[str, Any]) -> None:
    status = found["/status/right"]
    assert status["frame"] == [100, 101, 120, 126]
    states = [row[0] for row in status["StateChange:state"]]
    assert states == ["predicted", "fitted", "lost", "fitted"]
    log = found["/log/right"]
    assert [row[0] for row in log["TextLog:text"]] == [
        "frame 100: predicted: first frame",
        "frame 101: fitted",
        "hand lost: no joints",
        "hand found again after 6 frames",
    ]
    assert [row[0] for row in log["TextLog:level"]] == ["INFO", "INFO", "WARN", "INFO"]
    assert log["frame"] == [100, 101, 120, 126]
