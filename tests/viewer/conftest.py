"""What a file of Rerun holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from recording_checks import rrd_columns

from handtrack.tracking.track import Track
from handtrack.viewer.rerun_log import log_rerun


@pytest.fixture
def found(track: Track, tmp_path: Path) -> dict[str, dict[str, list[Any]]]:
    path = log_rerun(track, save=tmp_path / "run.rrd")
    assert path == tmp_path / "run.rrd"
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    assert path.is_file()
    return rrd_columns(path)
