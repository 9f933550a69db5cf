"""From pictures to sequences, files and recordings; MediaPipe itself on real videos."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from clips import Told, seen, write_image, write_video

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import InputError, SettingsError
from handtrack.video import model_file
from handtrack.video.detections import NoHandError, detect

pytest.importorskip("av", reason="the extra video is not installed")


@pytest.fixture
def video(tmp_path) -> Path:
    path = tmp_path / "clip.mp4"
    write_video(path, [0, 33, 67, 100])
    return path


def test_what_is_seen_becomes_a_sequence_of_each_hand(video, tmp_path):
    both = [seen("left", 100), seen("right", 400)]
    told = Told(both, both[1:], [], both)
    found = detect(video, told)
    assert found.hands == ("left", "right")
    assert found.size == (64, 48)
    left, right = found.sequences()
    assert (left.hand, right.hand, left.name) == ("left", "right", "clip left")
    assert right.time_ns.tolist() == [0, 33_000_000, 67_000_000, 100_000_000]
    assert right.present.any(1).tolist() == [True, True, False, True]
    assert left.present.any(1).tolist() == [True, False, False, True]
    assert np.array_equal(left.joints[0], both[0].world)
    assert np.array_equal(found.image["right"][1], both[1].image)
    assert not told.closed  # whoever made it closes it

    found.save(tmp_path / "out.npz")
    again = ht.load(tmp_path / "out.npz")
    assert [s.hand for s in again] == ["left", "right"]
    for a, b in zip(again, (left, right), strict=True):
        assert np.allclose(a.joints, b.joints, atol=1e-8, equal_nan=True)
        assert np.array_equal(a.time_ns, b.time_ns)
        assert np.allclose(a.confidence, b.confidence, atol=1e-6)


def test_only_the_frames_asked_for_are_looked_at(video):
    told = Told([seen("right", 100)], [seen("right", 101)])
    found = detect(video, told, frames=(1, 2))
    assert found.frame_index.tolist() == [1, 2]
    assert [t for _, t in told.pictures] == [33_000_000, 67_000_000]
    with pytest.raises(InputError, match="no picture in frames 7:9"):
        detect(video, Told(), frames=(7, 9))


def test_no_hand_anywhere_is_said(video):
    with pytest.raises(NoHandError, match="no hand was found in 4 frames"):
        detect(video, Told([], [], [], []))


def test_the_model_is_made_from_the_wheel_and_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(SettingsError, match="--make-model"):
        model_file.find()
    wheel = tmp_path / "mediapipe.whl"
    parts = {inside: bytes([7 + i]) * 1000 for i, inside in enumerate(model_file._PARTS.values())}
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    monkeypatch.setattr(model_file, "_download", lambda folder: wheel)
    path = model_file.make()
    assert path == model_file.find() == tmp_path / "cache" / "handtrack" / "hand_landmarker.task"
    data = path.read_bytes()
    with zipfile.ZipFile(path) as task:
        for name, inside in model_file._PARTS.items():
            assert task.read(name) == parts[inside]
            assert task.getinfo(name).compress_type == zipfile.ZIP_STORED
            assert data.index(parts[inside]) % 16 == 0  # aligned, so that it can be mapped
    with pytest.raises(InputError, match="not a MediaPipe task file"):
        model_file.find(Path(__file__))
    with zipfile.ZipFile(tmp_path / "other.task", "w") as other:
        other.writestr("face.tflite", b"x")
    with pytest.raises(InputError, match=r"other\.task: not a hand landmark model: hand_detector"):
        model_file.find(tmp_path / "other.task")
    with pytest.raises(InputError, match="no such file"):
        model_file.find(tmp_path / "none.task")


def test_the_command_line_says_what_is_missing(tmp_path, capsys, monkeypatch, video):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "nothing"))
    assert run(["detect"]) == 2
    assert run(["detect", str(tmp_path / "none.mp4"), "-o", str(tmp_path / "o.npz")]) == 2
    assert run(["track", str(video), "--unit", "mm"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert "expected a video" in lines[0]
    assert "none.mp4" in lines[1]
    assert "not pictures" in lines[2]


def mediapipe_is_there() -> bool:
    try:
        import mediapipe  # noqa: F401
    except ImportError:
        return False
    return model_file.kept().is_file()


needs_mediapipe = pytest.mark.skipif(
    not mediapipe_is_there(), reason="MediaPipe or its model is missing (detect --make-model)"
)


@needs_mediapipe
def test_a_picture_without_a_hand_fails_with_status_1(tmp_path, capfd):
    write_image(tmp_path / "grey.png", 128)
    assert run(["detect", str(tmp_path / "grey.png"), "-o", str(tmp_path / "o.npz")]) == 1
    out = capfd.readouterr()
    assert out.err.count("\n") == 1  # and nothing of what MediaPipe prints
    assert "no hand was found" in out.err
    assert not (tmp_path / "o.npz").exists()
    assert run(["track", str(tmp_path / "grey.png"), "-o", str(tmp_path / "o.mcap")]) == 1
    assert "no hand was found" in capfd.readouterr().err
    assert ht.read_mcap(tmp_path / "o.mcap") == []  # complete, and empty


@needs_mediapipe
def test_a_real_video_gives_the_landmarks_of_the_reference(tmp_path, capsys, shared_data):
    """Reference: the same video through MediaPipe by other hands (../shared/data/README.md)."""
    source = shared_data / "dex" / "human_hand_video.mp4"
    out = tmp_path / "dex.npz"
    assert run(["detect", str(source), "-o", str(out), "--frames", "0:59"]) == 0
    assert "right hand in 60 of 60 frames" in capsys.readouterr().out
    (found,) = ht.load(out)
    with np.load(shared_data / "dex" / "joints.npz") as reference:
        joints = reference["joints_m"][:60].astype(float)
    distance = np.linalg.norm(found.joints - joints, axis=-1)
    assert np.median(distance) < 2e-3
    with np.load(out) as data:
        image, size = data["right_image_px"], data["size_px"]
    assert size.tolist() == [1280, 720]
    assert ((image > 0) & (image < size)).all()
