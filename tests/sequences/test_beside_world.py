"""Results of MediaPipe with landmarks in the picture beside those in the world."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht

SIZE = (640, 480)


def landmarks(hand, n):
    """World landmarks (n, 21, 3) [m], and shares of a picture with MediaPipe's z."""
    t = np.arange(n)[:, None, None]
    model = ht.HandModel.default(hand)
    world = model.joints(model.mean_angles) + 0.001 * np.sin(0.3 * t + np.arange(3))
    world = world - world.mean(1, keepdims=True)
    side = 0.3 if hand == "left" else 0.7
    shares = np.concatenate([side + 0.9 * world[..., :2], world[..., 2:]], -1)
    shares[..., 2] -= shares[:, :1, 2]
    return world, shares


def points(joints):
    return [{"x": float(x), "y": float(y), "z": float(z)} for x, y, z in joints]


def record(t, hands, about):
    made = {h: landmarks(h, t + 1) for h in hands}
    return {
        "timestamp_ms": 33 * t,
        "landmarks": [points(made[h][1][t]) for h in hands],
        "worldLandmarks": [points(made[h][0][t]) for h in hands],
        "handedness": [[{"categoryName": h.title(), "score": 0.9}] for h in hands],
        **about,
    }


def check(found, n, hands=("left", "right")):
    assert [s.hand for s in found] == list(hands)
    for sequence in found:
        world, shares = landmarks(sequence.hand, n)
        assert sequence.detector == "mediapipe"
        assert sequence.picture.size == SIZE
        np.testing.assert_allclose(sequence.joints, world, atol=1e-6)
        np.testing.assert_allclose(sequence.picture.image, shares[..., :2] * SIZE, atol=1e-3)


SAID = {"image_width": SIZE[0], "image_height": SIZE[1]}


@pytest.mark.parametrize("n", [12, 260])  # many are read without decoding each
@pytest.mark.parametrize("hands", [("left", "right"), ("right",)])
def test_lines_and_lists_of_results(tmp_path, n, hands):
    records = [record(t, hands, SAID) for t in range(n)]
    (tmp_path / "seen.jsonl").write_text("\n".join(map(json.dumps, records)))
    check(ht.load(tmp_path / "seen.jsonl"), n, hands)
    (tmp_path / "seen.json").write_text(json.dumps(records))
    check(ht.load(tmp_path / "seen.json"), n, hands)
    frames = [record(t, hands, {}) for t in range(n)]
    whole = {"image_size": SIZE, "frames": frames}
    (tmp_path / "whole.json").write_text(json.dumps(whole))
    check(ht.load(tmp_path / "whole.json"), n, hands)


def test_who_says_the_size(tmp_path):
    frames = [record(t, ("right",), {}) for t in range(12)]
    path = tmp_path / "seen.json"
    path.write_text(json.dumps(frames))
    (silent,) = ht.load(path)
    assert silent.picture is None
    assert any("--image-size WxH" in note for note in silent.notes)
    check(ht.load(path, image_size=SIZE), 12, ("right",))
    with pytest.raises(ht.SettingsError, match="image_size is"):
        ht.load(path, image_size=(0, 480))
    # turned round, they are not the camera's axes any more
    assert ht.load(path, image_size=SIZE, mirror="x")[0].picture is None


def test_arrays_of_both(tmp_path):
    world, shares = landmarks("right", 12)
    for name in ("hand_landmarks", "image_landmarks"):
        arrays = {name: shares, "hand_world_landmarks": world, "image_size": SIZE, "hand": "right"}
        np.savez(tmp_path / "seen.npz", **arrays)
        check(ht.load(tmp_path / "seen.npz"), 12, ("right",))
    np.savez(tmp_path / "seen.npz", **{**arrays, "image_size": [0, 1]})
    with pytest.raises(ht.InputError, match="image_size is"):
        ht.load(tmp_path / "seen.npz")


def test_the_command_takes_the_size(tmp_path, capsys, monkeypatch):
    from handtrack.cli import run

    monkeypatch.chdir(tmp_path)
    frames = [record(t, ("right",), {}) for t in range(12)]
    (tmp_path / "seen.json").write_text(json.dumps(frames))
    arguments = ["track", "seen.json", "-o", "a.mcap", "--mesh", "none", "--overwrite"]
    for more, lens in ((["--image-size", "640x480"], "assumed"), (["--fov", "60"], "60 degrees")):
        if lens != "assumed":
            more = [*more, "--image-size", "640x480"]
        assert run([*arguments, *more]) == 0
        assert "fitted to its joints and its picture" in capsys.readouterr().err
        (track,) = ht.read_mcap("a.mcap")
        assert track.settings["cameras"]["lens"] == lens
