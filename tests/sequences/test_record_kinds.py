"""Frames in JSON as people bring them: every nesting, every name, nothing seen at first."""

import pytest
from records_of import named, objects, same
from test_names import SOURCES

from handtrack.hand.skeleton import FINGERS

BLANKS = {
    "null": lambda t: None,
    "nothing": lambda t: {},
    "empty list": lambda t: [],
    "a time alone": lambda t: {"time": t},
    "null joints": lambda t: {"time": t, "handedness": "left", "joints": None},
    "null joints and hand": lambda t: {"time": t, "handedness": None, "joints": None},
    "no hands": lambda t: {"time": t, "hands": []},
    "null hands": lambda t: {"time": t, "hands": None},
    "null sides": lambda t: {"time": t, "left": None, "right": None},
}


@pytest.mark.parametrize("blank", BLANKS)
@pytest.mark.parametrize("form", ["joints", "names", "objects", "hands", "sides"])
def test_nothing_seen_at_first(read, left, blank, form):
    frames = [BLANKS[blank](i / 60) for i in range(3)]
    for i, joints in enumerate(left, 3):
        frame = {
            "joints": {"handedness": "left", "joints": joints.tolist()},
            "names": {"handedness": "left", "joints": named(joints, SOURCES["webxr"])},
            "objects": {"handedness": "left", "landmarks": objects(joints)},
            "hands": {"hands": [{"handedness": "left", "joints": joints.tolist()}]},
            "sides": {"left": named(joints), "right": None},
        }[form]
        frames.append({"time": i / 60} | frame)
    for name in ("a.jsonl", "a.json"):
        (sequence,) = read(frames, name)
        assert (len(sequence), sequence.hand) == (15, "left")
        assert sequence.fps == pytest.approx(60, rel=1e-3)
        assert not sequence.present[:3].any()
        same(sequence, left, 3)


@pytest.mark.parametrize("source", SOURCES)
def test_names_of_every_source(read, right, source):
    (sequence,) = read([named(j, SOURCES[source]) for j in right])
    same(sequence, right)


@pytest.mark.parametrize(
    "point",
    [
        lambda p: p,
        lambda p: dict(zip("xyz", p, strict=True)),
        lambda p: dict(zip("XYZ", p, strict=True)),
        lambda p: {"position": p},
        lambda p: {"position": dict(zip("xyz", p, strict=True)), "radius": 0.01},
        lambda p: {"pose": {"position": dict(zip("xyz", p, strict=True))}},
        lambda p: {"transform": {"position": p, "orientation": [0, 0, 0, 1]}},
        lambda p: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *p, 1],
    ],
)
def test_forms_of_a_point(read, right, point):
    frames = [{n: point(p) for n, p in named(j).items()} for j in right]
    (sequence,) = read([{"joints": f} for f in frames])
    same(sequence, right)
    (sequence,) = read([{"landmarks": list(f.values())} for f in frames])
    same(sequence, right)


def test_lists_of_named_joints_and_fingers(read, right):
    items = [{"joint": n, "pose": {"position": p}} for n, p in named(right[0]).items()]
    (sequence,) = read({"items": items}, "a.json")
    same(sequence, right[:1])
    (sequence,) = read([{"keypoints3D": [{"name": i["joint"], **i["pose"]} for i in items]}])
    same(sequence, right[:1])
    fingers = {f: right[0, 4 * i + 1 : 4 * i + 5].tolist() for i, f in enumerate(FINGERS)}
    (sequence,) = read([{"wrist": right[0, 0].tolist()} | fingers])
    same(sequence, right[:1])
    bones = {str(i): {"position": p} for i, p in enumerate(right[0].tolist())}
    (sequence,) = read([{"joints": bones}])
    same(sequence, right[:1])
    axes = {a: right[0, :, i].tolist() for i, a in enumerate("xyz")}
    (sequence,) = read([{"joints": axes}])
    same(sequence, right[:1])


@pytest.mark.parametrize(
    "label",
    [
        "Left",
        "L",
        "left_hand",
        {"label": "Left", "score": 0.9, "index": 0},
        [{"categoryName": "Left", "score": 0.9}],
        [[{"category_name": "Left", "score": 0.9, "index": 1}]],
    ],
)
@pytest.mark.parametrize("key", ["handedness", "side", "hand", "hand_label"])
def test_labels(read, left, key, label):
    (sequence,) = read([{key: label, "joints": j.tolist()} for j in left])
    assert sequence.hand == "left"
    assert not any("no hand named" in note for note in sequence.notes)


def test_mediapipe_results(read, left, right):
    """World landmarks are read, not those in the picture; hands come in any order."""
    frames = []
    for i, (a, b) in enumerate(zip(left, right, strict=True)):
        picture = [objects(h * 0.5, visibility=0.0) for h in (a, b)]
        hands = [("Left", a), ("Right", b)][:: 1 if i % 2 else -1]
        frames.append(
            {
                "timestampMs": i * 40,
                "landmarks": picture,
                "worldLandmarks": [objects(h, visibility=0.0) for _, h in hands],
                "handedness": [[{"categoryName": n, "score": 0.9, "index": 0}] for n, _ in hands],
            }
        )
    frames.insert(0, {"timestampMs": -40, "landmarks": [], "worldLandmarks": [], "handedness": []})
    a, b = read(frames)
    assert (a.hand, b.hand, len(a)) == ("left", "right", 13)
    assert a.fps == pytest.approx(25)
    same(a, left, 1)
    same(b, right, 1)


@pytest.mark.parametrize("key", ["multi_handedness", "handednesses", "handedness"])
def test_labels_of_the_older_and_the_web_mediapipe(read, left, right, key):
    frames = []
    for i, (a, b) in enumerate(zip(left, right, strict=True)):
        hands = [("Left", a), ("Right", b)][:: 1 if i % 2 else -1]
        label = [{"classification": [{"index": 0, "score": 0.9, "label": n}]} for n, _ in hands]
        points = [{"landmark": objects(h)} for _, h in hands]
        frames.append({key: label, "multi_hand_world_landmarks": points})
    a, b = read(frames)
    assert (a.hand, b.hand) == ("left", "right")
    assert not any("no hand named" in note for note in (*a.notes, *b.notes))
    same(a, left)
    same(b, right)


@pytest.mark.parametrize(
    "keys", [("left", "right"), ("leftHand", "rightHand"), ("hand_l", "hand_r")]
)
@pytest.mark.parametrize(
    "inside", [lambda j: j, lambda j: {"joints": j}, lambda j: {"landmarks": j}]
)
def test_hands_by_side(read, left, right, keys, inside):
    frames = [
        {keys[0]: inside(a.tolist()), keys[1]: inside(b.tolist())}
        for a, b in zip(left, right, strict=True)
    ]
    frames[4][keys[1]] = None
    a, b = read(frames)
    assert (a.hand, b.hand, len(a), len(b)) == ("left", "right", 12, 12)
    same(a, left)
    assert not b.present[4].any()


def test_hands_in_a_list_in_a_list_of_hands_and_in_data(read, left, right):
    pairs = [
        [{"side": "left", "points": a.tolist()}, {"side": "right", "points": b.tolist()}]
        for a, b in zip(left, right, strict=True)
    ]
    for frames in (pairs, [{"data": {"hands": p}} for p in pairs], [{"hands": p} for p in pairs]):
        a, b = read(frames)
        assert (a.hand, b.hand) == ("left", "right")
        same(b, right)


@pytest.mark.parametrize(
    ("stamp", "fps"),
    [
        (lambda i: {"timestamp": 1.7e9 + i / 50}, 50),
        (lambda i: {"t": i / 50}, 50),
        (lambda i: {"timestampMs": 20 * i}, 50),
        (lambda i: {"time_ns": 20_000_000 * i}, 50),
        (lambda i: {"stamp": {"sec": 1700000000 + i // 50, "nanosec": i % 50 * 20_000_000}}, 50),
        (lambda i: {"header": {"stamp": {"secs": 5, "nsecs": i * 20_000_000}}}, 50),
        (lambda i: {"header": {"timestamp": i / 50, "frame_id": "world"}}, 50),
        (lambda i: {"elapsed": i / 50}, 50),
        (lambda i: {"frame_time": i / 50}, 50),
        (lambda i: {"time": f"2026-01-02T03:04:05.{20 * i:03d}Z"}, 50),
    ],
)
def test_times(read, right, stamp, fps):
    (sequence,) = read([stamp(i) | {"joints": j.tolist()} for i, j in enumerate(right)])
    assert sequence.fps == pytest.approx(fps, rel=1e-4)


def test_whole_files_around_frames(read, right):
    frames = [{"frame": i + 5, "joints": j.tolist()} for i, j in enumerate(right * 1e3)]
    about = {"fps": 60, "hand": "left", "unit": "mm", "subject": "B"}
    (sequence,) = read(about | {"frames": frames}, "a.json")
    assert (sequence.hand, sequence.subject, sequence.fps) == ("left", "B", pytest.approx(60))
    assert sequence.frame_index.tolist() == list(range(5, 17))
    same(sequence, right)
    for key in ("keypoints_3d", "landmarks", "points", "hand_joints", "jnts", "xyz", "kp3d"):
        (sequence,) = read({key: right.tolist(), "sample_rate": 25}, "a.json")
        assert sequence.fps == pytest.approx(25)
        same(sequence, right)
