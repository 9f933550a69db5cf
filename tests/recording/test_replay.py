"""Replay as .rrd, and the viewer's process: loopback only, gone afterwards."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from made_tracks import make_track
from recording_checks import rrd_columns

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.recording.mcap_io import write_mcap
from handtrack.recording.replay import replay
from handtrack.recording.rerun_log import log_rerun


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
        "from handtrack.recording.replay import replay\n"
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
        listening = _listening(viewer)
        assert len(listening) == 2
        assert {ip for ip, _ in listening} == {"127.0.0.1"}
        assert int(address.split(":")[2].split("/")[0]) in {port for _, port in listening}
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


def _listening(pid: int) -> list[tuple[str, int]]:
    """(address, port) of the sockets on which a process listens."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        target = os.readlink(link) if link.is_symlink() else ""
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    out = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:
                address, port = fields[1].split(":")
                ip = ".".join(str(b) for b in reversed(bytes.fromhex(address)))
                out.append((ip, int(port, 16)))
    return out
