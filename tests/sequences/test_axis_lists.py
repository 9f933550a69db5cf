"""Joints whose x, y and z are lists of their own."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError

NAMES = [("x", "y", "z"), ("X", "Y", "Z"), ("xs", "ys", "zs"), ("x_list", "y_list", "z_list")]
SURE = np.linspace(0.5, 1, 21).tolist()


def columns(frame, names):
    return {k: frame[..., i].tolist() for i, k in enumerate(names)}


def load(path, value, suffix):
    path = path / f"a.{suffix}"
    lines = suffix == "jsonl"
    path.write_text("\n".join(map(json.dumps, value)) if lines else json.dumps(value))
    return {s.hand: s for s in ht.load(path)}


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("suffix", ["json", "jsonl"])
def test_lists_of_one_frame(tmp_path, right, names, suffix):
    own = [columns(f, names) for f in right]
    said = [{**c, "visibility": SURE} for c in own]
    inside = [{"landmarks": c} for c in said]
    world = [{"worldLandmarks": [c], "handedness": [[{"categoryName": "Right"}]]} for c in own]
    for value, sure in (
        (own, None),
        ([{"hand": "right", **c} for c in said], SURE),
        ([{"hand": "right", "score": 0.5, **c} for c in own], [0.5] * 21),
        ([{"hand": "right", **c} for c in inside], SURE),
        (world, None),
    ):
        (found,) = load(tmp_path, value, suffix).values()
        assert np.array_equal(found.joints, right)
        if sure is not None:
            assert np.allclose(found.confidence, np.broadcast_to(sure, right.shape[:2]))


@pytest.mark.parametrize("names", NAMES)
def test_lists_of_both_hands(tmp_path, left, right, names):
    pairs = [(columns(a, names), columns(b, names)) for a, b in zip(left, right, strict=True)]
    beside = [{"time": i / 25, "left": a, "right": b} for i, (a, b) in enumerate(pairs)]
    listed = [
        {"hands": [{"handedness": "Left", **a}, {"handedness": "Right", "landmarks": b}]}
        for a, b in pairs
    ]
    for value in (beside, {"fps": 25, "frames": beside}, listed):
        found = load(tmp_path, value, "json")
        assert np.array_equal(found["left"].joints, left)
        assert np.array_equal(found["right"].joints, right)
    beside[3]["left"] = {k: [] for k in names}
    beside[4]["left"] = None
    found = load(tmp_path, beside, "json")["left"]
    assert np.flatnonzero(~found.present.any(1)).tolist() == [3, 4]


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("turned", [False, True])
def test_lists_of_all_frames(tmp_path, left, right, names, turned):
    a, b = ((h.transpose(1, 0, 2) if turned else h) for h in (left, right))
    sure = np.tile(SURE, (len(right), 1))
    about = {"fps": 25, "hand": "right"}
    visible = {"visibility": (sure.T if turned else sure).tolist()}
    for value in (
        {**about, **columns(b, names), **visible},
        {**about, "landmarks": {**columns(b, names), **visible}},
    ):
        (found,) = load(tmp_path, value, "json").values()
        assert np.array_equal(found.joints, right)
        assert np.allclose(found.confidence, sure)
        assert found.fps == pytest.approx(25)
    hands = {"left": columns(a, names), "right": columns(b, names)}
    for value in ({"fps": 25, **hands}, {"fps": 25, "hands": hands}):
        found = load(tmp_path, value, "json")
        assert np.array_equal(found["left"].joints, left)
        assert np.array_equal(found["right"].joints, right)
    np.savez(tmp_path / "a.npz", **{k: b[..., i] for i, k in enumerate(names)}, fps=25)
    (found,) = ht.load(tmp_path / "a.npz")
    assert np.array_equal(found.joints, right)


def test_many_frames_are_read_alike(tmp_path, motion):
    right = motion("right", 400)
    value = [{"time": i / 50, "right": columns(f, NAMES[2])} for i, f in enumerate(right)]
    value[7]["right"] = None
    found = load(tmp_path, value, "jsonl")["right"]
    assert np.isnan(found.joints[7]).all()
    rest = np.arange(len(right)) != 7
    assert np.array_equal(found.joints[rest], right[rest])


def test_lists_that_do_not_fit(tmp_path, right):
    one = columns(right[0], NAMES[2])
    all_of = columns(right, NAMES[0])
    for value, match in (
        ([one, {**one, "ys": one["ys"][:20]}], "frame 1: xs, ys, zs are of different length"),
        ([one, {**one, "ys": ["a"] * 21}], "frame 1: ys is not a list of numbers"),
        ({**all_of, "z": all_of["z"][:5]}, "x, y, z have shapes .* expected one of all"),
        ({**all_of, "z": [*all_of["z"][:-1], [1.0]]}, r"z\[11\] has shape"),
    ):
        with pytest.raises(InputError, match=match) as caught:
            load(tmp_path, value, "json")
        assert "a.json" in str(caught.value)
        assert "\n" not in str(caught.value)
