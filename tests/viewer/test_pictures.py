"""Pictures that a real viewer draws, without a screen: the hand is there, and it moves.

Where HANDTRACK_PICTURES names a folder the pictures are kept there.
"""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_tracks import make_track
from screens import Screen

import handtrack as ht
from handtrack.cli import run
from handtrack.recording.write import write_mcap
from handtrack.viewer.live_viewer import LiveViewer
from handtrack.viewer.replay import replay

SKIN, RUN = (226, 178, 148), (141, 178, 214)
"""Tints of the first and of the second hand."""


def tinted(picture: np.ndarray, tint: tuple[int, int, int]) -> np.ndarray:
    """Where the 3D view, the left half, has a colour of a lit tint: bright, and of its hue."""
    half = picture[:, : picture.shape[1] // 2]
    brightness = half.max(-1)
    hue = half / np.maximum(brightness, 1)[..., None]
    off = np.abs(hue - np.array(tint) / max(tint)).max(-1)
    return (brightness > 70) & (off < 0.12)


def test_a_hand_in_recorded_time_is_seen_and_moves(screen: Screen, tmp_path: Path) -> None:
    """`replay --connect --speed`: the viewer follows what comes."""
    recording = write_mcap(make_track(150, lost=slice(0)), tmp_path / "run.mcap", mesh=False)
    arguments: dict[str, Any] = {"connect": screen.address, "speed": 1.0}
    sending = threading.Thread(target=replay, args=(recording,), kwargs=arguments)
    sending.start()
    try:
        first = tinted(screen.until(lambda p: tinted(p, SKIN).mean() > 0.015), SKIN)
        assert first.mean() > 0.015
        # the silhouette of a hand that opens and turns: a good part of it is elsewhere soon
        moved = tinted(screen.until(lambda p: change(first, tinted(p, SKIN)) > 0.2), SKIN)
        assert moved.mean() > 0.015
        assert change(first, moved) > 0.2
    finally:
        sending.join()
    screen.picture("recorded-time")


def change(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pixels of two silhouettes that only one of them has."""
    return float((a ^ b).sum() / max(1, (a | b).sum()))


def test_a_hand_is_seen_while_it_is_tracked(screen: Screen, sample: ht.Sequence) -> None:
    model = ht.calibrate(ht.HandModel.default("right"), sample).model
    tracker = ht.Tracker(model, filter="kalman")
    before = tinted(screen.picture(), SKIN)

    def there(picture: np.ndarray) -> bool:
        """A hand, and not the one that the viewer showed already."""
        skin = tinted(picture, SKIN)
        return bool(skin.mean() > 0.006 and change(before, skin) > 0.2)

    with LiveViewer(screen.address) as viewer:
        for joints, time_ns in zip(sample.joints[:30], sample.time_ns[:30], strict=True):
            viewer.step(tracker.step(joints, int(time_ns)), tracker)
        viewer.flush()
        assert there(screen.until(there))
    screen.picture("live")


def test_track_live_shows_and_records(
    screen: Screen, sample_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = tinted(screen.picture(), SKIN)
    output = tmp_path / "run.mcap"
    options = ["--frames", "0:60", "--live", "--connect", screen.address, "-o", str(output)]
    assert run(["track", str(sample_file), *options]) == 0
    assert "tracked 61 frames" in capsys.readouterr().out
    (track,) = ht.read_mcap(output)
    assert len(track) == 61

    def there(picture: np.ndarray) -> bool:
        skin = tinted(picture, SKIN)
        return bool(skin.mean() > 0.006 and change(before, skin) > 0.2)

    assert there(screen.until(there))
    screen.picture("track-live")
    assert run(["track", str(sample_file), "--connect", screen.address]) == 2
    assert "--connect belongs to --live" in capsys.readouterr().err


def test_two_runs_side_by_side_have_their_colours(screen: Screen, tmp_path: Path) -> None:
    track = make_track(10, lost=slice(0))
    files = [write_mcap(track, tmp_path / f"{name}.mcap", mesh=False) for name in "ab"]
    replay(files, connect=screen.address, offset_m=0.22)

    def there(picture: np.ndarray) -> bool:
        return all(tinted(picture, tint).mean() > 0.01 for tint in (SKIN, RUN))

    picture = screen.until(there)
    assert there(picture)
    # the second run is to the right of the first
    columns = [np.flatnonzero(tinted(picture, tint).any(0)).mean() for tint in (SKIN, RUN)]
    assert columns[0] + 30 < columns[1]
    screen.picture("compared")
