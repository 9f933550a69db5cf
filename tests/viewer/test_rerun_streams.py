"""Rerun's recordings leave nothing in the process: it may make any number of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from made_tracks import make_track

from handtrack.errors import HandtrackError
from handtrack.viewer.process import free_port, grpc_address, viewer, wait_for
from handtrack.viewer.replay import replay
from handtrack.viewer.rerun_log import log_rerun

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="reads Linux's /proc")


def held() -> tuple[int, int]:
    """How many threads and open files the process has."""
    return len(os.listdir("/proc/self/task")), len(os.listdir("/proc/self/fd"))


def test_many_files_leave_no_thread_and_no_file_open(tmp_path: Path) -> None:
    """A thousand were made by hand; each that leaves something shows in a few."""
    track = make_track(2, skin=False)
    log_rerun(track, save=tmp_path / "a.rrd")
    before = held()
    for _ in range(6):
        log_rerun(track, save=tmp_path / "a.rrd")
    assert held() == before


def test_files_that_fail_leave_none_either(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    track = make_track(2, skin=False)
    log_rerun(track, save=tmp_path / "a.rrd")
    before = held()

    def fails(*_: object, **__: object) -> None:
        raise OSError("no space left")

    with monkeypatch.context() as patch:
        patch.setattr("handtrack.viewer.rerun_log.log_hands", fails)
        for _ in range(6):
            with pytest.raises(HandtrackError, match="no space left"):
                log_rerun(track, save=tmp_path / "b.rrd")
    # the last of them goes with the next one
    log_rerun(track, save=tmp_path / "a.rrd")
    assert held() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.rrd"]


def test_what_is_sent_to_a_viewer_leaves_none_either(recording: Path) -> None:
    port = free_port()
    with viewer("--serve-grpc", "--port", str(port)) as process:
        wait_for(process, port)
        counts = []
        for _ in range(4):
            replay(recording, connect=f"127.0.0.1:{port}", mesh=False)
            counts.append(held()[0])
    assert grpc_address(port).endswith(f":{port}/proxy")
    assert max(counts[1:]) <= counts[0]
