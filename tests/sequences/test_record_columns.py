"""Records whose objects are columns, and other ways to write hands as records."""

import numpy as np
import pytest
from records_of import named, objects, same
from test_names import SOURCES

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES


def test_objects_of_columns(read, left, right):
    columns = {n: right[:, i].tolist() for i, n in enumerate(SOURCES["mediapipe"])}
    (sequence,) = read(columns | {"time": [i / 20 for i in range(12)]}, "a.json")
    assert sequence.fps == pytest.approx(20)
    same(sequence, right)
    a, b = read({"left": {"joints": left.tolist()}, "right": {"joints": right.tolist()}}, "a.json")
    same(a, left)
    same(b, right)


def test_confidences(read, right):
    for sure in ("visibility", "presence", "score", "confidence"):
        lines = [{"landmarks": objects(j, **{sure: 0.5})} for j in right]
        lines[2]["landmarks"][3][sure] = 0.25
        (sequence,) = read(lines)
        expected = 1.0 if sure == "presence" else 0.25
        assert sequence.confidence[2, 3] == expected
    # MediaPipe's 0 of what it does not know
    (sequence,) = read([{"landmarks": objects(j, visibility=0.0)} for j in right])
    assert sequence.present.all()
    lines = [{"joints": j.tolist(), "isTracked": i != 4} for i, j in enumerate(right)]
    (sequence,) = read(lines)
    assert not sequence.present[4].any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda f: f["joints"].update(thumb_tpi=f["joints"].pop("thumb_tip")),
            "thumb_tpi.*thumb_tip",
        ),
        (lambda f: f["joints"].update(pinky_tip=[1, 2, 3]), "two joints are little_tip"),
        (lambda f: f.update(capture_time_code=5), "looks like a time"),
        (lambda f: f.update(handedness="both"), "hand is 'both', expected left or right"),
        (lambda f: f["joints"].update(wrist=[1, 2]), "wrist is no position"),
    ],
)
def test_what_is_not_understood(read, right, change, message):
    frames = [{"joints": named(j)} for j in right]
    change(frames[3])
    with pytest.raises(ht.InputError, match=message) as caught:
        read(frames)
    assert "line 4" in str(caught.value)


def test_arrays_of_two_hands(read, tmp_path, left, right):
    both = np.stack([right, left], axis=1)
    for name, array in (("a", both), ("b", both.reshape(12, 42, 3)), ("c", both.reshape(12, 126))):
        np.save(tmp_path / f"{name}.npy", array)
        found = {s.hand: s for s in ht.load(tmp_path / f"{name}.npy")}
        same(found["left"], left)
        same(found["right"], right)
    np.save(tmp_path / "d.npy", right.transpose(0, 2, 1))
    (sequence,) = ht.load(tmp_path / "d.npy")
    same(sequence, right)


@pytest.mark.parametrize(
    "keys",
    [
        {"left_joints": 0, "right_joints": 1},
        {"joints_left": 0, "joints_right": 1},
        {"left": 0, "right": 1},
        {"leftKeypoints3d": 0, "rightKeypoints3d": 1},
    ],
)
def test_npz_of_both_hands(tmp_path, left, right, keys):
    hands = (left, right)
    np.savez(tmp_path / "a.npz", t=np.arange(12) / 40, **{k: hands[i] for k, i in keys.items()})
    a, b = ht.load(tmp_path / "a.npz")
    assert (a.hand, b.hand) == ("left", "right")
    assert a.fps == pytest.approx(40)
    same(a, left)
    same(b, right)


def test_npz_under_other_names(tmp_path, right):
    for key in ("keypoints", "landmarks_m", "hand_joints_3d", "arr_0"):
        if key == "arr_0":
            np.savez(tmp_path / "a.npz", right)
        else:
            stamps = np.arange(12) * 40
            np.savez(tmp_path / "a.npz", timestamps=stamps, side="R", **{key: right})
        (sequence,) = ht.load(tmp_path / "a.npz")
        same(sequence, right)
    named_arrays = {n: right[:, i] for i, n in enumerate(SOURCES["ultraleap"])}
    np.savez(tmp_path / "a.npz", **named_arrays)
    (sequence,) = ht.load(tmp_path / "a.npz")
    same(sequence, right)


@pytest.mark.parametrize(
    ("size", "says"), [((1, 1), "shares of a picture"), ((640, 480), "pixels")]
)
def test_landmarks_in_a_picture(read, tmp_path, right, size, says):
    seen = right - right[:, :1] * [0, 0, 1]
    seen = seen / 1.6 * [*size, size[0]]
    for frames in (
        [{"handedness": "Right", "landmarks": objects(j)} for j in seen],
        [{"multi_hand_landmarks": [objects(j)]} for j in seen],
        [named(j, SOURCES["mediapipe"]) for j in seen],
    ):
        with pytest.raises(ht.InputError, match=says + ".*world landmarks"):
            read(frames)
    head = ",".join(f"{n}_{a}" for n in SOURCES["mediapipe"] for a in "xyz")
    rows = [",".join(map(str, j.ravel())) for j in seen]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
    with pytest.raises(ht.InputError, match=says):
        ht.load(tmp_path / "a.csv")
    # a hand given relative to its wrist is none
    (sequence,) = read([{"landmarks": objects(j - j[0])} for j in right])
    assert len(sequence) == 12


def test_hands_within_hands_without_end(tmp_path):
    for text in (
        '{"hands":' * 300 + "{}" + "}" * 300,
        '[{"hand":' * 100 + "[[]]" + "}]" * 100,
        '{"handedness":' + "[" * 300 + "]" * 300 + ', "joints": null}',
    ):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(ht.InputError):
            ht.load(tmp_path / "a.json")


def joint_objects(joints, names=JOINT_NAMES):
    """One hand's joints as lists and objects with names, as many programs write them."""
    at = [dict(zip("xyz", j, strict=True)) for j in joints.tolist()]
    mixed = [*range(1, len(at)), 0]
    return {
        "name, x": [{"name": n, **p} for n, p in zip(names, at, strict=True)],
        "joint, position": [{"joint": n, "position": p} for n, p in zip(names, at, strict=True)],
        "id, pos": [{"id": i, "pos": list(p.values())} for i, p in enumerate(at)],
        "mixed names": [{"name": names[i], "pose": {"position": at[i]}} for i in mixed],
        "mixed numbers": [{"index": i, **at[i]} for i in mixed],
        "name to list": named(joints, names),
        "name to x": dict(zip(names, at, strict=True)),
        "pairs": [[n, *p.values()] for n, p in zip(names, at, strict=True)],
        "pairs of lists": [[n, list(p.values())] for n, p in zip(names, at, strict=True)],
    }


def in_letters(value, way):
    if isinstance(value, dict):
        return {way(k): in_letters(v, way) for k, v in value.items()}
    return [in_letters(v, way) for v in value] if isinstance(value, list) else value


LETTERS = {
    "as they are": lambda k: k,
    "first": lambda k: k[:1].upper() + k[1:],
    "all": str.upper,
}


@pytest.mark.parametrize("letters", LETTERS)
@pytest.mark.parametrize("file", ["a.jsonl", "a.json"])
def test_named_joints_in_any_form_and_letters(read, left, letters, file):
    for form in joint_objects(left[0]):
        for around in ("joints", "hands", "left"):
            frames = []
            for i, joints in enumerate(left):
                hand = joint_objects(joints)[form]
                inside = {"joints": hand, "hand": "left"} if around != "left" else hand
                frame = {"hands": [inside]} if around == "hands" else {"left": hand}
                frames.append({"time": i / 60} | (inside if around == "joints" else frame))
            (sequence,) = read(in_letters(frames, LETTERS[letters]), file)
            same(sequence, left)
            assert sequence.hand == "left"
            assert sequence.fps == pytest.approx(60, rel=0.01)


def test_frames_that_are_lists_of_named_joints(read, left):
    for form in ("name, x", "mixed names", "mixed numbers", "pairs"):
        frames = [joint_objects(joints)[form] for joints in left]
        (sequence,) = read({"fps": 60, "frames": frames}, "a.json")
        same(sequence, left)
        (sequence,) = read(frames, "a.json")
        same(sequence, left)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_few_frames_are_no_hands_of_one_frame(read, left, n):
    joints = left[:n]
    plain, points = joints.tolist(), [objects(j) for j in joints]
    times = {"timestamps": [i / 60 for i in range(n)]}
    clips = [
        {"joints_m": plain},
        {"landmarks": plain, **times},
        {"keypoints": points, "hand": "left"},
        {"joints": points, "fps": 60},
        {"frames": plain, **times},
        {"data": plain},
        {"hands": {"left": plain}},
    ]
    for clip in clips:
        (sequence,) = read(clip, "a.json")
        same(sequence, joints)
    both = {"left_joints": plain, "right_joints": (joints * [-1, 1, 1]).tolist()}
    for clip in (both, {"hands": {"left": plain, "right": both["right_joints"]}, "fps": 60}):
        found = read(clip, "a.json")
        assert [s.hand for s in found] == ["left", "right"]
        same(found[0], joints)
    # of one picture
    label = [[{"categoryName": "Left"}], [{"categoryName": "Right"}]]
    found = read({"handedness": label, "worldLandmarks": [points[0], points[0]]}, "a.json")
    assert [len(s) for s in found] == [1, 1]
