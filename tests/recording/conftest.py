"""Tracks and recordings for the tests of recording."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_tracks import make_track

from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track


@pytest.fixture
def track() -> Track:
    return make_track()


@pytest.fixture
def two_hands() -> list[Track]:
    return [
        make_track(40, "right", offset=(0.0, 0.15, 0.0)),
        make_track(50, "left", seed=1, offset=(0.0, -0.15, 0.0), truth=False),
    ]


@pytest.fixture
def recording(track: Track, tmp_path: Path) -> Path:
    return write_mcap(track, tmp_path / "run.mcap")
