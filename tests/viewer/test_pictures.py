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


def test_the_sample_fills_the_picture_dark_and_light(
    screen: Screen, sample: ht.Sequence, tmp_path: Path
) -> None:
    track = ht.track(sample.frames(0, 59), filter="kalman")
    recording = write_mcap(track, tmp_path / "sample.mcap", mesh=False)
    for name, light in (("viewer-dark", False), ("viewer-light", True)):
        replay(recording, connect=screen.address, light=light)

        def there(picture: np.ndarray, light: bool = light) -> bool:
            ground = picture[picture.shape[0] // 6, picture.shape[1] // 20]
            return bool((ground.min() > 200) == light and tinted(picture, SKIN).mean() > 0.025)

        # the skin's own view is half of the left half, and the fist is smaller than the open hand
        picture = screen.until(there)
        screen.picture(name)
        assert there(picture), name


def test_the_camera_is_seen_beside_the_hand(screen: Screen, sample: ht.Sequence) -> None:
    cv2 = pytest.importorskip("cv2", reason="the extra video is not installed")
    blue = np.full((480, 640, 3), (200, 60, 20), np.uint8)  # BGR
    jpeg = cv2.imencode(".jpg", blue)[1].tobytes()
    tracker = ht.Tracker(ht.HandModel.default("right"))
    points = np.stack([np.linspace(100, 500, 21), np.full(21, 240.0)], 1)

    def there(picture: np.ndarray) -> bool:
        half = picture[:, : picture.shape[1] // 2]
        off = np.abs(half - np.array([20, 60, 200])).max(-1)
        return bool((off < 25).mean() > 0.05)

    with LiveViewer(screen.address, pictures=["camera"]) as viewer:
        for i, joints in enumerate(sample.joints[:5]):
            viewer.picture("camera", lambda: jpeg, int(sample.time_ns[i]), i, {"right": points})
            viewer.step(tracker.step(joints, int(sample.time_ns[i])), tracker)
        viewer.flush()
        assert there(screen.until(there))
    screen.picture("live-camera")


def test_two_runs_side_by_side_have_their_colours(screen: Screen, tmp_path: Path) -> None:
    track = make_track(10, lost=slice(0))
    files = [write_mcap(track, tmp_path / f"{name}.mcap", mesh=False) for name in "ab"]
    replay(files, connect=screen.address, offset_m=0.22)

    def there(picture: np.ndarray) -> bool:
        """Both are there, the second run to the right of the first."""
        seen = [tinted(picture, tint) for tint in (SKIN, RUN)]
        if not all(each.mean() > 0.01 for each in seen):
            return False
        columns = [np.flatnonzero(each.any(0)).mean() for each in seen]
        return bool(columns[0] + 30 < columns[1])

    picture = screen.until(there)
    screen.picture("offset")
    assert there(picture)


def test_two_runs_have_views_of_their_own(screen: Screen, tmp_path: Path) -> None:
    track = make_track(60, lost=slice(0))
    files = [write_mcap(track, tmp_path / f"{name}.mcap", mesh=False) for name in "ab"]
    replay(files, connect=screen.address)

    def there(picture: np.ndarray) -> bool:
        wide = picture.shape[1] // 4
        return all(
            tinted(np.tile(part, (1, 2, 1)), tint).mean() > 0.03
            for part, tint in (
                (picture[:, : wide * 9 // 10], SKIN),
                (picture[:, wide * 9 // 10 : wide * 18 // 10], RUN),
            )
        )

    assert there(screen.until(there))
    screen.picture("compared")
