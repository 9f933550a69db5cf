"""What is told of a run while it goes on."""

from __future__ import annotations

import pytest

from handtrack.batching.progress import Progress


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that it is [s]."""
    now = [100.0]
    monkeypatch.setattr("handtrack.batching.progress.time.monotonic", lambda: now[0])
    return now


def _begun(clips: int) -> Progress:
    watch = Progress(dashboard="http://127.0.0.1:8787/status")
    watch.begin("clips", clips)
    return watch


def test_a_line_tells_rates_failures_time_left_and_the_dashboard(clock):
    watch = _begun(2_000)
    clock[0] += 50.0
    watch.add(500, 150_000, 3)
    said = watch.line()
    assert said == (
        "clips: 500 of 2,000, 2 min left, 3 failed, 10.0/s, 3,000 frames/s,"
        " http://127.0.0.1:8787/status"
    )
    assert watch.line(80).endswith("frames/s")
    assert watch.line(30) == "clips: 500 of 2,000"


def test_time_left_runs_down_until_the_next_one_is_late(clock):
    watch = _begun(4)
    clock[0] += 10.0
    watch.add(1, 300, 0)
    left = []
    for _ in range(4):
        left.append(watch.line().split(", ")[1])
        clock[0] += 5.0
    assert left == ["30 s left", "25 s left", "20 s left", "25 s left"]
    assert "6.0/min" in _slow(clock)


def _slow(clock: list[float]) -> str:
    watch = _begun(2)
    clock[0] += 10.0
    watch.add(1, 300, 0)
    return watch.line()


def test_what_has_no_count_is_told_too():
    watch = Progress()
    watch.prepare("starting workers")
    assert watch.line() == "starting workers ..."
