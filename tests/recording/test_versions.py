"""Files of every format version that was ever written stay readable, and say the same."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from handtrack.mcap.hands import VERSIONS
from handtrack.recording.read import read_mcap
from handtrack.recording.write import FORMAT_VERSION

DATA = Path(__file__).parent / "data"
"""versionN.mcap as that version wrote it, versionN.json: hashes of the arrays it held."""


def test_version_1() -> None:
    tracks = read_mcap(DATA / "version1.mcap")
    expected = json.loads((DATA / "version1.json").read_text())
    assert [(t.name, t.hand, len(t)) for t in tracks] == [
        ("sample", "right", 8),
        ("sample", "left", 4),
    ]
    for track, was in zip(tracks, expected, strict=True):
        # it knew no rejected joints
        assert track.rejected.shape == (len(track), 21)
        assert not track.rejected.any()
        assert not track.restart.any()
        events = [[e.time_ns, e.level, e.text] for e in track.events]
        assert events == was.pop("events")
        assert " ".join(track.status.tolist()) == was.pop("status")
        assert dict(track.settings) == was.pop("settings")
        for name, digest in was.items():
            owner = track.model if name.startswith("model.") else track
            array: np.ndarray = getattr(
                owner, name.removeprefix("model.").replace("sweeps", "iterations")
            )
            assert hashlib.sha256(array.tobytes()).hexdigest()[:16] == digest, name


def test_what_is_written_can_be_read() -> None:
    assert int(FORMAT_VERSION) == VERSIONS[-1]
    assert list(VERSIONS) == list(range(1, VERSIONS[-1] + 1))
