"""Replay as .rrd, and the viewer's process: loopback only, gone afterwards."""

from __future__ import annotations

import dataclasses
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from made_tracks import make_track
from recording_checks import rrd_columns
from sockets import listening

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.hand.limits import preset
from handtrack.hand.skeleton import ANGLE_JOINT, FINGERS
from handtrack.recording.parts import rows
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track
from handtrack.viewer import style
from handtrack.viewer.eye import Seen, eye
from handtrack.viewer.hand_plots import OUTSIDE, limit_marks
from handtrack.viewer.live_viewer import stream
from handtrack.viewer.replay import replay
from handtrack.viewer.rerun_log import log_rerun
from handtrack.viewer.shown import Run, shown


def content(path: Path | None) -> dict[str, dict[str, list[Any]]]:
    """All rows of a file, but for the ids and times of logging."""
    assert path is not None
    found = rrd_columns(path)
    del found["/__properties"]
    # rerun writes chunks in an order of its own
    return {
        entity: {name: rows for name, rows in sorted(columns.items()) if "RowId" not in name}
        for entity, columns in sorted(found.items())
    }


def test_saved_replay_equals_the_track(tmp_path: Path) -> None:
    track = make_track(25, lost=slice(5, 8))
    recording = write_mcap(track, tmp_path / "run.mcap")
    replayed = replay(recording, save=tmp_path / "replayed.rrd")
    direct = log_rerun(track, save=tmp_path / "direct.rrd")
    # NaN is not equal to itself
    assert str(content(replayed)) == str(content(direct))


def test_several_files_in_one_world(recording: Path, tmp_path: Path) -> None:
    other = write_mcap(make_track(20, "left", seed=3), tmp_path / "other.mcap")
    again = write_mcap(make_track(20, "left", seed=3), tmp_path / "again.mcap")
    found = content(replay([recording, other, again], save=tmp_path / "all.rrd", mesh=False))
    hands = {name.split("/")[2] for name in found if name.startswith("/errors")}
    assert hands == {"run_right", "other_left", "again_left"}


def test_a_part_of_a_recording(track: Track, recording: Path, tmp_path: Path) -> None:
    part = replay(recording, save=tmp_path / "part.rrd", start_s=0.5, end_s=1.0, mesh=False)
    found = content(part)["/errors/right"]
    assert found["frame"] == track.frame_index[15:31].tolist()
    # the viewer's clock begins with what is shown
    assert found["time"] == (track.time_ns[15:31] - track.time_ns[15]).tolist()


def test_runs_are_compared(tmp_path: Path) -> None:
    before = make_track(30, lost=slice(5, 8))
    # 2 mm off, of the same frames; and one that begins later
    moved = dataclasses.replace(
        before, filtered_joints=before.filtered_joints + np.array([0, 0, 0.002])
    )
    files = [
        write_mcap(t, tmp_path / f"{n}.mcap", mesh=False)
        for n, t in (("before", before), ("after", rows(moved, slice(10, 30))))
    ]
    saved = replay(files, save=tmp_path / "x.rrd", offset_m=0.3)
    found = content(saved)
    difference = found["/difference/after_right"]
    assert difference["frame"] == before.frame_index[10:].tolist()
    np.testing.assert_allclose(difference["Scalars:scalars"], 2.0, atol=1e-9)
    # to the right of the picture, by the distance asked for
    (move,) = found["/world/after_right"]["Transform3D:translation"][0]
    assert np.linalg.norm(move) == pytest.approx(0.3, abs=1e-6)
    right = eye([Seen.of(before)]).right
    np.testing.assert_allclose(move, 0.3 * right, atol=1e-6)
    assert "Transform3D:translation" not in found["/world/before_right"]
    colours = [
        found[f"/angles/{n}_right/index/angles"]["SeriesLines:colors"] for n in ("before", "after")
    ]
    assert colours[0] != colours[1]


def test_recordings_of_different_days_begin_together(tmp_path: Path) -> None:
    days = [make_track(12, start_ns=(1_700_000_000 + day * 86_400) * 10**9) for day in (0, 1)]
    files = [write_mcap(t, tmp_path / f"day{i}.mcap", mesh=False) for i, t in enumerate(days)]
    said: list[str] = []
    found = content(replay(files, save=tmp_path / "x.rrd", say=said.append))
    assert found["/errors/day0_right"]["time"] == found["/errors/day1_right"]["time"]
    (line,) = said
    assert "as if they began together" in line


def test_other_limits_show_what_is_outside(recording: Path, track: Track, tmp_path: Path) -> None:
    found = content(replay(recording, save=tmp_path / "x.rrd", limits="li2021", mesh=False))
    limits = preset("li2021")
    marks = limit_marks(limits, track.angles)
    assert (marks == OUTSIDE).any()
    for f, finger in enumerate(FINGERS):
        of_finger = slice(4 * f, 4 * f + 4)
        bounds = np.array(found[f"/angles/right/{finger}/limits"]["Scalars:scalars"])
        expected = np.r_[limits.lower[of_finger], limits.upper[of_finger]]
        np.testing.assert_allclose(bounds, np.tile(np.rad2deg(expected), (2, 1)))
        outside = (marks[:, of_finger] == OUTSIDE).any(1)
        if outside.any():
            points = found[f"/angles/right/{finger}/outside"]
            assert points["frame"] == track.frame_index[outside].tolist()
    shown = found["/world/right/limits"]
    counts = [len(strips) for strips in shown["LineStrips3D:strips"]]
    assert len(counts) == len(track)
    joints = np.zeros((len(track), 21), bool)
    joints[:, ANGLE_JOINT] = marks > 0
    assert counts == joints.sum(1).tolist()
    # the colours tell which are outside
    red = int.from_bytes(bytes(style.OUTSIDE), "big")
    outside_joints = np.zeros((len(track), 21), bool)
    outside_joints[:, ANGLE_JOINT] = marks == OUTSIDE
    assert [row.count(red) for row in shown["LineStrips3D:colors"]] == outside_joints.sum(
        1
    ).tolist()


def test_many_frames_are_shown_without_the_skin(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handtrack.viewer.replay.MOST_SKINS", 59)
    said: list[str] = []
    found = content(replay(recording, save=tmp_path / "x.rrd", say=said.append))
    assert "/world/right/skin" not in found
    assert said == ["60 frames are shown without the skin; --mesh draws it"]
    assert "/world/right/skin" in content(replay(recording, save=tmp_path / "y.rrd", mesh=True))


def test_in_recorded_time_the_same_is_sent(two_hands: list[Track], tmp_path: Path) -> None:
    hands = shown([Run("", two_hands)])
    whole = tmp_path / "whole.rrd"
    log_rerun(two_hands, save=whole)
    recording = rr.RecordingStream("handtrack")
    recording.save(tmp_path / "parts.rrd")
    start = time.monotonic()
    stream(recording, hands, speed=2.0)
    seconds = time.monotonic() - start
    recording.disconnect()
    assert seconds > two_hands[1].time_ns[-1] * 1e-9 / 2
    parts, expected = content(tmp_path / "parts.rrd"), content(whole)
    assert set(parts) == set(expected)
    for entity, columns in expected.items():
        if not entity.endswith("/limits"):  # drawn from end to end of every part
            assert str(sorted_rows(parts[entity])) == str(sorted_rows(columns)), entity
    assert len(parts["/angles/right/index/limits"]["time"]) > 4


def sorted_rows(columns: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """An entity's columns in order of time: chunks are in no order of their own."""
    if "time" not in columns:
        return columns
    order = np.argsort(columns["time"], kind="stable")
    return {
        name: [rows[i] for i in order] if len(rows) == len(order) else rows
        for name, rows in columns.items()
    }


def test_no_viewer_and_no_address(recording: Path) -> None:
    with pytest.raises(HandtrackError, match=r"no viewer answers at 127\.0\.0\.1:1: start one"):
        replay(recording, connect="127.0.0.1:1")
    with pytest.raises(SettingsError, match="nonsense is no address of a viewer"):
        replay(recording, connect="nonsense")
    with pytest.raises(SettingsError, match="expected more than 0"):
        replay(recording, connect="", speed=0.0)
    with pytest.raises(SettingsError, match="choose one"):
        replay(recording, connect="", web=True)
    with pytest.raises(SettingsError, match="a file has no speed"):
        replay(recording, save="x.rrd", speed=1.0)
    with pytest.raises(SettingsError, match="side by side, or offset"):
        replay(recording, side_by_side=True, offset_m=0.1)


def test_what_cannot_be_done_is_said(recording: Path, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no file"):
        replay([])
    with pytest.raises(InputError, match="no such file"):
        replay(tmp_path / "x.mcap")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(SettingsError, match=f"port {port} cannot be used"):
            replay(recording, web=True, port=port)
    with pytest.raises(SettingsError, match="port 99999 cannot be used"):
        replay(recording, web=True, port=99999)


def test_a_viewer_that_fails_is_told(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RERUN_CLI_PATH", "/usr/bin/false")
    with pytest.raises(HandtrackError, match="ended with status 1; is there a display"):
        replay(recording)
    with pytest.raises(HandtrackError, match="ended with status 1"):
        replay(recording, web=True, open_viewer=False)
    monkeypatch.setenv("RERUN_CLI_PATH", "/nowhere/rerun")
    with pytest.raises(HandtrackError, match="cannot be started"):
        replay(recording)


def test_a_window_that_is_closed_ends_quietly(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RERUN_CLI_PATH", "/usr/bin/true")
    assert replay(recording) is None


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's /proc")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_the_web_viewer_listens_on_loopback_and_goes(
    how: signal.Signals, recording: Path, tmp_path: Path
) -> None:
    code = (
        "import signal, sys\n"
        # shells start background jobs with SIGINT ignored
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from handtrack.viewer.replay import replay\n"
        f"replay({str(recording)!r}, web=True, open_viewer=False,"
        " say=lambda address: print(address, flush=True))\n"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment
    )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        (viewer,) = _children(process.pid)
        with urllib.request.urlopen(address, timeout=10) as page:
            assert b"<html" in page.read().lower()
        found = listening(viewer)
        assert len(found) == 2
        assert {ip for ip, _ in found} == {"127.0.0.1"}
        assert int(address.split(":")[2].split("/")[0]) in {port for _, port in found}
    finally:
        process.send_signal(how)
        code_of_exit = process.wait(15)
        process.stdout.close()
    assert code_of_exit == (0 if how == signal.SIGINT else 128 + how)
    deadline = time.monotonic() + 5
    while Path(f"/proc/{viewer}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not Path(f"/proc/{viewer}").exists()
    assert not list(tmp_path.glob("handtrack-*"))


def _children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(child) for child in text.split()]
