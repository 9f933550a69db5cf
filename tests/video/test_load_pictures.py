"""ht.load finds the hands in videos and images, as `track` does."""

from __future__ import annotations

import inspect
import sys

import numpy as np
import pytest
from clips import Told, seen, write_image, write_video

import handtrack as ht
from handtrack.errors import SettingsError
from handtrack.video import detections

pytest.importorskip("av", reason="the extra video is not installed")


def test_a_video_is_its_hands(tmp_path, monkeypatch):
    path = tmp_path / "clip.mp4"
    write_video(path, [0, 33, 67, 100])
    both = [seen("left", 100), seen("right", 400)]
    made = [Told(both, both, both, both) for _ in range(3)]
    waiting = iter(made)
    monkeypatch.setattr(detections, "MediaPipeDetector", lambda *a, **k: next(waiting))
    monkeypatch.setattr(detections, "isinstance", lambda *a: False, raising=False)
    left, right = ht.load(path)
    assert (left.hand, right.hand) == ("left", "right")
    assert right.time_ns.tolist() == [0, 33_000_000, 67_000_000, 100_000_000]
    assert np.array_equal(right.joints[0], both[1].world)
    (only,) = ht.load(str(path), hand="left", frames=(1, 2))
    assert only.frame_index.tolist() == [1, 2]
    assert made[0].closed
    exchanged = ht.load(path, "swap", fps=50.0)
    assert [s.hand for s in exchanged] == ["right", "left"]
    assert exchanged[0].time_ns[1] == 20_000_000


@pytest.mark.parametrize("data", [b"\xff\xd8\xff\xe0", b"\x89PNG\r\n\x1a\n", b"\0\0\0\x18ftypisom"])
def test_what_is_damaged_is_told_before_a_detector_is_asked_for(tmp_path, monkeypatch, data):
    monkeypatch.setattr(detections, "MediaPipeDetector", None)
    path = tmp_path / "a.json"
    path.write_bytes(data)
    with pytest.raises(ht.InputError) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_options_of_joints_are_refused(tmp_path):
    path = tmp_path / "a.png"
    write_image(path, 90)
    with pytest.raises(SettingsError, match=r"a\.png: --unit and --key are for joint sequences"):
        ht.load(path, unit="mm", key="x")
    with pytest.raises(SettingsError, match="expected one of auto, left, right, swap"):
        ht.load(path, hand="both")


def test_without_the_extra_it_says_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    write_image(path, 90)
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setattr(detections, "MediaPipeDetector", lambda *a, **k: Told([]))
    monkeypatch.setattr(detections, "isinstance", lambda *a: False, raising=False)
    with pytest.raises(SettingsError, match=r"pip install 'handtrack\[video\]'"):
        ht.load(path)


def test_joints_are_read_as_ever(sample_file):
    assert "passed_over" in inspect.signature(ht.load).parameters
    (sequence,) = ht.load(sample_file, frames=(0, 9))
    assert len(sequence) == 10
