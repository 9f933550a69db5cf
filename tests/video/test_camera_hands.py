"""Which hand it is that calibrated cameras, or a lens, saw in videos: --hand of `track`."""

from __future__ import annotations

import numpy as np
import pytest
from clips import write_video

import handtrack as ht
from handtrack.cli import run
from handtrack.cli.inputs import Reading
from handtrack.video.detections import Detections

pytest.importorskip("av", reason="the extra video is not installed")

FRAMES, SIZE = 12, (640, 480)


@pytest.fixture
def video(tmp_path, monkeypatch):
    """A right hand half a metre away, which the detector called left."""
    model = ht.HandModel.default("right")
    angles = np.tile(model.mean_angles, (FRAMES, 1))
    angles[:, 4::4] += 0.3 * np.sin(np.arange(FRAMES) / 4)[:, None]
    joints = model.joints(model.limits.clamp(angles))
    world = joints - joints.mean(1, keepdims=True)
    seen = world + np.array([0.0, 0.0, 0.5])
    focal = SIZE[0] / 2 / np.tan(np.radians(30))
    pixels = seen[..., :2] / seen[..., 2:] * focal + np.array(SIZE) / 2
    nothing = np.full((FRAMES, 21, 3), np.nan)
    path = tmp_path / "clip.mp4"
    write_video(path, [33 * t for t in range(FRAMES)])
    found = Detections(
        source=str(path),
        size=SIZE,
        time_ns=np.arange(FRAMES) * 33_000_000,
        frame_index=np.arange(FRAMES),
        image={"left": pixels, "right": nothing[..., :2]},
        world={"left": world, "right": nothing},
        score={"left": np.ones(FRAMES), "right": np.zeros(FRAMES)},
    )
    monkeypatch.setattr(Reading, "detect", lambda *_: found)
    monkeypatch.chdir(tmp_path)
    return str(path)


@pytest.mark.parametrize(("choice", "hand"), [("auto", "left"), ("swap", "right")])
def test_labels_of_a_video_are_exchanged(video, choice, hand, capsys):
    options = ["--fov", "60", "--detector", "none", "--no-mesh", "-q"]
    assert run(["track", video, "-o", "a.mcap", "--hand", choice, *options]) == 0
    (track,) = ht.read_mcap("a.mcap")
    assert (track.hand, track.name, len(track)) == (hand, "clip", FRAMES)
    assert track.model.hand == hand


@pytest.mark.parametrize("lens", [(), ("--fov", "60")])
def test_the_only_hand_is_what_the_user_says(video, lens, capsys):
    assert run(["track", video, "-o", "a.mcap", "--hand", "right", *lens]) == 0
    assert "labelled left, taken as right as asked" in capsys.readouterr().err
    (track,) = ht.read_mcap("a.mcap")
    assert track.hand == "right"
