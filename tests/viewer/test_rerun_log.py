"""What Rerun gets: entities, rows and values, read back from the .rrd file."""

from __future__ import annotations

import dataclasses
import resource
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from made_tracks import make_track
from recording_checks import rrd_columns
from rerun.chunk import RrdReader

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.hand.skeleton import FINGERS
from handtrack.hand.skinning import VertexNormals
from handtrack.tracking.track import Track
from handtrack.viewer.eye import Seen, eye
from handtrack.viewer.hand_log import BATCH
from handtrack.viewer.hand_plots import HandPlots
from handtrack.viewer.rerun_log import log_rerun

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def found(track: Track, tmp_path: Path) -> dict[str, dict[str, list[Any]]]:
    path = log_rerun(track, save=tmp_path / "run.rrd")
    assert path == tmp_path / "run.rrd"
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    assert path.is_file()
    return rrd_columns(path)


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


def test_blueprint_comes_with_the_file(track: Track, tmp_path: Path) -> None:
    reader = RrdReader(log_rerun(track, save=tmp_path / "run.rrd"))
    assert len(reader.blueprints()) == 1
    assert [entry.application_id for entry in reader.recordings()] == ["handtrack: run"]


def test_two_files_in_one_viewer_keep_their_own_layout(track: Track, tmp_path: Path) -> None:
    """Rerun has one layout for each application."""
    of = {
        (entry.application_id, blueprint.application_id)
        for name in ("a", "b")
        for reader in [RrdReader(log_rerun(track, save=tmp_path / f"{name}.rrd"))]
        for entry in reader.recordings()
        for blueprint in reader.blueprints()
    }
    assert of == {("handtrack: a", "handtrack: a"), ("handtrack: b", "handtrack: b")}


def test_two_hands_without_filter_truth_or_mesh(two_hands: list[Track], tmp_path: Path) -> None:
    plain = [dataclasses.replace(t, settings={"filter": "none"}, truth=None) for t in two_hands]
    path = log_rerun(plain, save=tmp_path / "run.rrd", mesh=False)
    assert path is not None
    found = rrd_columns(path)
    for hand, track in zip(("right", "left"), plain, strict=True):
        assert len(found[f"/errors/{hand}"]["Scalars:scalars"][0]) == 2
        assert len(found[f"/world/{hand}/fitted"]["frame"]) == len(track)
    assert not any(e.endswith(("skin", "raw", "filtered", "truth")) for e in found)


def test_unix_time_and_many_batches(tmp_path: Path) -> None:
    start = 1_700_000_000_000_000_123
    track = make_track(BATCH + 10, start_ns=start, skin=True)
    path = log_rerun(track, save=tmp_path / "run.rrd")
    assert path is not None
    skin = rrd_columns(path)["/world/right/skin"]
    assert skin["time"] == track.time_ns.tolist()
    assert len(skin["Mesh3D:vertex_positions"]) == len(track)


def test_long_recordings_are_sent_in_small_pieces(
    track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A viewer looks through whole pieces, and shows a frame the sooner the smaller they are."""
    whole = log_rerun(track, save=tmp_path / "whole.rrd", mesh=False)
    for module in ("hand_log", "sending"):
        monkeypatch.setattr(f"handtrack.viewer.{module}.ROWS", 16)
    pieces = log_rerun(track, save=tmp_path / "pieces.rrd", mesh=False)
    assert whole is not None
    assert pieces is not None
    large = {c.entity_path for c in RrdReader(pieces).stream() if c.num_rows > 16}
    assert large == set()
    found, expected = rrd_columns(pieces), rrd_columns(whole)
    for entity in ("/world/right/observed", "/world/right/limits", "/angles/right/thumb/raw"):
        order = np.argsort(found[entity]["frame"])
        for name in ("frame", "time", "Points3D:positions", "Scalars:scalars"):
            if name in expected[entity]:
                # NaN is not equal to itself
                assert str([found[entity][name][i] for i in order]) == str(expected[entity][name])


def test_nothing_known_and_no_frames(tmp_path: Path) -> None:
    lost = make_track(8, lost=slice(0, 8), truth=False)
    assert log_rerun(lost, save=tmp_path / "lost.rrd") is not None
    arrays = {
        f.name: getattr(lost, f.name)[:0]
        for f in dataclasses.fields(Track)
        if isinstance(getattr(lost, f.name), np.ndarray)
    }
    empty = dataclasses.replace(lost, **arrays)
    assert log_rerun(empty, save=tmp_path / "empty.rrd") is not None


def test_into_a_recording_of_the_caller(track: Track, tmp_path: Path) -> None:
    recording = rr.RecordingStream("mine")
    recording.save(tmp_path / "mine.rrd")
    assert log_rerun(track, recording=recording, mesh=False) is None
    recording.disconnect()
    assert "/errors/right" in rrd_columns(tmp_path / "mine.rrd")


def test_what_cannot_be_done_is_said(track: Track, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no track"):
        log_rerun([], save=tmp_path / "x.rrd")
    with pytest.raises(SettingsError, match="not both"):
        log_rerun(track, recording=rr.RecordingStream("x"), save=tmp_path / "x.rrd")
    with pytest.raises(SettingsError, match="no Rerun recording is active"):
        log_rerun(track)
    with pytest.raises(InputError, match="no folder"):
        log_rerun(track, save=tmp_path / "nowhere" / "x.rrd")
    with pytest.raises(InputError, match="is a folder"):
        log_rerun(track, save=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs resource limits")
def test_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    """rerun writes in a thread of its own and says nothing when the disk is full."""
    code = f"""
        import signal, sys
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        sys.path.insert(0, {str(Path(__file__).parents[1])!r})
        from made_tracks import make_track
        from handtrack.errors import HandtrackError
        from handtrack.viewer.rerun_log import log_rerun
        try:
            log_rerun(make_track(100), save={str(tmp_path / "x.rrd")!r})
        except HandtrackError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)),
    )
    assert "x.rrd: cannot be written" in done.stdout, done.stderr
    assert list(tmp_path.iterdir()) == []


def test_failure_in_the_middle_leaves_nothing(
    track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(HandPlots, "_errors", fails)
    with pytest.raises(HandtrackError, match="Input/output error"):
        log_rerun(track, save=tmp_path / "x.rrd")
    assert list(tmp_path.iterdir()) == []


def test_normals_of_a_sphere_point_outwards() -> None:
    from scipy.spatial import ConvexHull

    rng = np.random.default_rng(0)
    points = rng.normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * a).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    poses = points + np.arange(70.0)[:, None, None]
    normals = VertexNormals(faces.astype(np.int32), len(points))(poses)
    assert normals.shape == poses.shape
    assert ((normals * points).sum(-1) > 0.97).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)


def test_a_lone_vertex_has_no_normal() -> None:
    faces = np.array([[0, 1, 2]], np.int32)
    points = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]]])
    np.testing.assert_array_equal(
        VertexNormals(faces, 4)(points)[0], [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 0]]
    )


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_eye_sees_the_back_of_the_hand_with_fingers_up(hand: str) -> None:
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    track = make_track(2, hand, lost=slice(0, 0))
    rest = np.stack([track.model.rest_joints @ turn.T + [3.0, -2, 1]] * 2)
    track = dataclasses.replace(track, fitted_joints=rest, observed=rest)
    position, target, up = (np.array(v) for v in eye([Seen.of(track)])[:3])
    back = turn @ [0.0, 0, 1]
    fingers = turn @ [1.0, 0, 0]
    assert up @ fingers > 0.95
    direction = (position - target) / np.linalg.norm(position - target)
    assert direction @ back > 0.8
    assert np.linalg.norm(target - rest[0].mean(0)) < 0.05
    assert np.linalg.norm(np.concatenate([position, target, up])) < 20


def test_the_eye_of_nothing_is_somewhere() -> None:
    lost = make_track(4, lost=slice(0, 4))
    for found in (eye([Seen.of(lost)]), eye([Seen.of(lost)], along=True)):
        assert np.isfinite(np.array(found[:3])).all()
