"""Leap Motion recordings."""

import json

import numpy as np
import pytest

import handtrack as ht

FIELDS = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")


def fingers(joints, hand_id, kinds=range(5), types=True):
    out = []
    for kind in kinds:
        points = joints[4 * kind + 1 : 4 * kind + 5] * 1e3
        finger = {name: point.tolist() for name, point in zip(FIELDS, points, strict=True)}
        finger |= {"handId": hand_id, "id": 10 * hand_id + kind, "tool": False, "length": 50.0}
        if types:
            finger["type"] = kind
        out.append(finger)
    return out


def frame(i, *hands, stamp=True):
    """hands: (id, type, joints)."""
    out = {"id": 1000 + i, "currentFrameRate": 115.0, "hands": [], "pointables": []}
    if stamp:
        out["timestamp"] = 12_441_190_938 + 8_680 * i
    for hand_id, kind, joints in hands:
        out["hands"].append({"id": hand_id, "type": kind, "confidence": 0.8, "grabStrength": 0})
        out["pointables"] += fingers(joints, hand_id)
    return out


@pytest.fixture
def write(tmp_path):
    def to(frames, **metadata):
        path = tmp_path / "grab.json"
        path.write_text(json.dumps({"frames": frames, "metadata": metadata}))
        return path

    return to


def test_both_hands(write, left, right):
    frames = [frame(i, (7, "left", left[i]), (9, "right", right[i])) for i in range(12)]
    a, b = ht.load(write(frames))
    for sequence, joints, hand in ((a, left, "left"), (b, right, "right")):
        assert not sequence.present[:, 0].any()  # there is no wrist, and none is made up
        assert sequence.present[:, 1:].all()
        np.testing.assert_allclose(sequence.joints[:, 1:], joints[:, 1:])
        assert (sequence.hand, sequence.name) == (hand, f"grab {hand}")
        assert sequence.time_ns[0] == 12_441_190_938_000
        assert sequence.fps == pytest.approx(115.2, abs=0.1)
        assert sequence.confidence[0, :2].tolist() == [0, 0.8]
        assert sequence.notes == ()


def test_new_id_after_a_loss_is_the_same_hand(write, right):
    frames = [frame(i, (7 if i < 5 else 12, "right", right[i])) for i in range(12)]
    frames[4]["hands"], frames[4]["pointables"] = [], []
    (sequence,) = ht.load(write(frames))
    assert sequence.frame_index.tolist() == list(range(12))
    assert np.flatnonzero(~sequence.present.any(1)).tolist() == [4]
    assert "lost and found again 1 time(s)" in sequence.notes[0]


def test_two_right_hands_at_once(write, right):
    frames = [frame(i, (7, "right", right[i]), (8, "right", right[i] + 0.3)) for i in range(12)]
    frames[6]["hands"].pop(0)  # 7 is lost for a frame
    a, b = ht.load(write(frames))
    assert (a.name, b.name) == ("grab hand1 right", "grab hand2 right")
    np.testing.assert_allclose(b.joints[:, 1:], right[:, 1:] + 0.3)
    assert np.flatnonzero(~a.present.any(1)).tolist() == [6]
    assert len(a) == len(b) == 12


def test_missing_fingers_and_true_tips(write, right):
    frames = [frame(i, (7, "right", right[i])) for i in range(12)]
    frames[2]["pointables"] = fingers(right[2], 7, [0, 1, 4])
    del frames[3]["pointables"][1]["dipPosition"]
    for i in range(12):
        frames[i]["pointables"].append({"handId": 7, "tool": True, "tipPosition": [0, 0, 0]})
    frames[5]["pointables"][0]["btipPosition"] = [100.0, 200.0, 1000.0]
    frames[6]["hands"][0]["wrist"] = [110.0, 210.0, 1000.0]
    (sequence,) = ht.load(write(frames))
    assert (~sequence.present[2]).sum() == 9
    assert not sequence.present[3, 7]
    np.testing.assert_allclose(sequence.joints[5, 4], [0.1, 0.2, 1.0])
    np.testing.assert_allclose(sequence.joints[6, 0], [0.11, 0.21, 1.0])


def test_without_stamps_the_rate_is_used(write, right):
    frames = [frame(i, (7, "right", right[i]), stamp=False) for i in range(12)]
    (sequence,) = ht.load(write(frames))
    assert sequence.fps == pytest.approx(115, rel=1e-6)
    for f in frames:
        del f["currentFrameRate"]
    (sequence,) = ht.load(write(frames, frameRate="57"))
    assert sequence.fps == pytest.approx(57, rel=1e-6)


def test_packed_form(write, left, right):
    """Format 2: the first entry names the fields of the arrays after it."""
    names = ["id", "type", "confidence"]
    tip_names = ["id", "handId", "tool", "carpPosition", *FIELDS]
    structure = ["id", "timestamp", {"hands": [names]}, {"pointables": [tip_names]}]
    structure.append({"interactionBox": ["center", "size"]})
    frames = [structure]
    for i in range(12):
        hands = [[7, "left", 0.5], [9, "right", 1.0]]
        points = fingers(left[i], 7, types=False) + fingers(right[i], 9, types=False)
        packed = [[p.get(n) for n in tip_names] for p in points]
        frames.append([i, 1_000_000 + 10_000 * i, hands, packed, [[0, 200, 0], [235, 235, 147]]])
    a, b = ht.load(write(frames, formatVersion=2))
    np.testing.assert_allclose(a.joints[:, 1:], left[:, 1:])
    np.testing.assert_allclose(b.joints[:, 1:], right[:, 1:])
    assert a.fps == pytest.approx(100)
    frames[4] = frames[4][:2]
    with pytest.raises(ht.InputError, match=r"frames\[4\]: a packed frame does not have"):
        ht.load(write(frames))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.clear(), "frames is empty"),
        (lambda f: f[3]["hands"][0].pop("type"), r"frames\[3\]: hand 7 has no type"),
        (lambda f: f[3]["hands"][0].update(type="up"), r"frames\[3\]: the type of hand 7 is 'up'"),
        (lambda f: f[3]["pointables"][2].update(type=9), r"frames\[3\]: a finger's type is 9"),
        (
            lambda f: f[3]["pointables"][2].update(pipPosition=[1, 2]),
            r"frames\[3\]: expected `array` of length 3 at `pointables\[2\].pipPosition`",
        ),
        (lambda f: [x.update(hands=[]) for x in f], "no hand with finger joints in 12 Leap frames"),
    ],
)
def test_bad_recordings(write, right, change, message):
    frames = [frame(i, (7, "right", right[i])) for i in range(12)]
    change(frames)
    with pytest.raises(ht.InputError, match=message):
        ht.load(write(frames))
