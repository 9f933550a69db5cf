"""How recordings are laid out in Rerun's viewer."""

from __future__ import annotations

import dataclasses
import resource
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from made_tracks import make_track
from recording_checks import rrd_columns
from rerun.chunk import RrdReader

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.hand.skinning import VertexNormals
from handtrack.tracking.track import Track
from handtrack.viewer.eye import Seen, eye
from handtrack.viewer.hand_log import BATCH
from handtrack.viewer.hand_plots import HandPlots
from handtrack.viewer.rerun_log import log_rerun


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
