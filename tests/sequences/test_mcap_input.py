"""MCAP: JSON joint messages, and handtrack's own recordings."""

import json

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.mcap.hand import Head, encode_hand
from handtrack.mcap.schema import descriptor_set, message_class
from handtrack.mcap.state import ARRAYS
from handtrack.recording.write import write_mcap

START = 1_782_897_167_604_809_000
STEP = 33_333_333


def bones(joints, side):
    out = {}
    for i, joint in enumerate(joints):
        place = (-1.0, -1.0, -1.0) if np.isnan(joint).any() else joint
        position = dict(zip("xyz", map(float, place), strict=True))
        out[str(i)] = {"bone_name": f"{side}_{i}", "to_global": {"position": position}}
    return out


def write_json(path, topics, stamp=lambda t: str(t), **options):
    """topics: {topic: [bone_data or other fields per frame]}."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start()
        schema = writer.register_schema("hand", "jsonschema", b'{"type": "object"}')
        for topic, frames in topics.items():
            channel = writer.register_channel(topic, "json", schema)
            for i, fields in enumerate(frames):
                time = START + i * STEP
                header = {"timestamp": stamp(time), "frame_index": i, "topic_name": topic}
                data = json.dumps({"header": header, **fields}).encode()
                writer.add_message(channel, time + 500, data, time + 500)
        writer.finish()
    return path


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": CompressionType.LZ4, "chunk_size": 4000},
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
    ],
)
def test_bones_of_both_hands(tmp_path, left, right, options):
    left[4] = np.nan
    left[5, 3] = np.nan
    path = write_json(
        tmp_path / "ego.mcap",
        {
            "/robot0/handtracking/left": [{"bone_data": bones(j, "Left")} for j in left],
            "/robot0/handtracking/right": [{"bone_data": bones(j, "Right")} for j in right],
            "/robot0/status": [{"battery": 0.5}] * 3,
        },
        **options,
    )
    a, b = ht.load(path)
    assert [(s.name, s.hand) for s in (a, b)] == [("ego left", "left"), ("ego right", "right")]
    np.testing.assert_array_equal(a.joints, left)
    np.testing.assert_array_equal(b.joints, right)
    assert a.notes == b.notes == ()
    # the messages' own stamps: they are on the same clock, and nearer to the truth
    np.testing.assert_array_equal(a.time_ns, START + STEP * np.arange(12))
    assert a.frame_index.tolist() == list(range(12))


@pytest.mark.parametrize("stamp", [lambda t: t / 1e9, lambda t: None, lambda t: t % 10**9])
def test_stamps_of_another_clock_are_not_used(tmp_path, right, stamp):
    frames = [{"bone_data": bones(j, "Hand")} for j in right]
    (sequence,) = ht.load(write_json(tmp_path / "a.mcap", {"/hand": frames}, stamp))
    np.testing.assert_array_equal(sequence.time_ns, START + 500 + STEP * np.arange(12))
    assert "from the way the fingers flex" in sequence.notes[0]


def test_bone_names_confidence_and_absent_bones(tmp_path, left):
    frames = [{"bone_data": bones(j, "Left")} for j in left]
    frames[2]["bone_data"]["4"]["confidence"] = 0.25
    frames[3]["confidence"] = 0.5
    del frames[4]["bone_data"]["8"]
    (sequence,) = ht.load(write_json(tmp_path / "a.mcap", {"/hand": frames}))
    assert sequence.hand == "left"
    assert sequence.confidence[2, 4] == 0.25
    assert (sequence.confidence[3] == 0.5).all()
    assert not sequence.present[4, 8]


def test_plain_joints(tmp_path, right):
    frames = [{"joints_mm": (j * 1e3).tolist(), "hand": "right"} for j in right]
    (sequence,) = ht.load(write_json(tmp_path / "a.mcap", {"/a": frames}))
    np.testing.assert_allclose(sequence.joints, right)
    assert (sequence.hand, sequence.name) == ("right", "a")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda f: f[3]["bone_data"].update({"25": {}}),
            "/hand, message 3: bone_data has a bone '25'",
        ),
        (
            lambda f: f[3]["bone_data"]["1"]["to_global"]["position"].pop("x"),
            "/hand, message 3: object missing required field `x`",
        ),
        (lambda f: f[3].update(confidence=[1]), r"/hand, message 3: confidence has shape \(1,\)"),
        (lambda f: [x.pop("bone_data") for x in f], "no joints in the JSON messages of /hand"),
    ],
)
def test_bad_messages(tmp_path, right, change, message):
    frames = [{"bone_data": bones(j, "Right")} for j in right]
    change(frames)
    path = write_json(tmp_path / "a.mcap", {"/hand": frames})
    with pytest.raises(ht.InputError, match=message) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("blank", [{}, {"bone_data": None}, {"bone_data": {}}])
def test_messages_in_which_nothing_was_seen_come_first(tmp_path, right, blank):
    frames = [blank, blank, *({"bone_data": bones(j, "Right")} for j in right)]
    (sequence,) = ht.load(write_json(tmp_path / "a.mcap", {"/hand": frames}))
    assert (len(sequence), sequence.hand) == (14, "right")
    assert not sequence.present[:2].any()
    np.testing.assert_allclose(sequence.joints[2:], right)


@pytest.mark.parametrize("blank", [{}, {"hands": []}, {"left": None, "right": None}])
def test_messages_of_both_hands_by_name(tmp_path, left, right, blank):
    names = [n.replace("little", "pinky") for n in JOINT_NAMES]

    def named(joints):
        return dict(zip(names, joints.tolist(), strict=True))

    frames = [{"left": named(a), "right": named(b)} for a, b in zip(left, right, strict=True)]
    a, b = ht.load(write_json(tmp_path / "a.mcap", {"/hands": [blank, *frames]}))
    assert (a.hand, b.hand, len(a)) == ("left", "right", 13)
    np.testing.assert_allclose(b.joints[1:], right)


def test_log_time_out_of_range(tmp_path, right):
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("hand", "jsonschema", b"{}")
        channel = writer.register_channel("/hand", "json", schema)
        data = json.dumps({"joints": right[0].tolist()}).encode()
        writer.add_message(channel, 2**64 - 1, data, 0)
        writer.finish()
    with pytest.raises(ht.InputError, match="/hand, message 0: log time 18446744073709551615"):
        ht.load(tmp_path / "a.mcap")


def test_no_joint_messages(tmp_path):
    write_json(tmp_path / "a.mcap", {})
    with pytest.raises(ht.InputError, match="no messages in it"):
        ht.load(tmp_path / "a.mcap")
    with (tmp_path / "b.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(
            "/image", "cdr", writer.register_schema("i", "ros2msg", b"")
        )
        writer.add_message(channel, 1, b"123", 1)
        writer.finish()
    with pytest.raises(ht.InputError, match=r"no joint messages in it, topics are /image \(cdr\)"):
        ht.load(tmp_path / "b.mcap")


def write_own(path, hands, version="2", offset=0, change=None):
    """hands: {topic: (hand, name, time_ns, joints, confidence, truth)}; all else is zero."""
    hand_type, state_type = message_class("handtrack.Hand"), message_class("handtrack.State")
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=4096)
        writer.start()
        writer.add_metadata("handtrack", {"format_version": version, "time_offset_ns": str(offset)})
        schema = {
            name: writer.register_schema(name, "protobuf", descriptor_set(name))
            for name in ("handtrack.Hand", "handtrack.State")
        }
        for topic, (hand, name, time_ns, joints, confidence, truth) in hands.items():
            model = writer.register_channel(f"/{topic}/model", "protobuf", schema["handtrack.Hand"])
            states = writer.register_channel(
                f"/{topic}/state", "protobuf", schema["handtrack.State"]
            )
            side = hand if hand in ("left", "right") else "left"
            head = Head.of(
                ht.HandModel.default(side), name, {}, subject="A", has_truth=truth is not None
            )
            about = hand_type.FromString(encode_hand(head))
            about.hand = hand
            writer.add_message(model, int(time_ns[0]) - offset, about.SerializeToString(), 0)
            for i, time in enumerate(time_ns):
                state = state_type(time_ns=int(time), frame_index=100 + i)
                for field in ARRAYS:
                    if field.since <= int(version) and field.name != "truth":
                        getattr(state, field.name).extend(np.zeros(field.size))
                state.observed[:] = joints[i].ravel()
                state.confidence[:] = confidence[i]
                if truth is not None:
                    state.truth.extend(truth[i].ravel())
                if change is not None:
                    change(i, state)
                data = state.SerializeToString()
                writer.add_message(states, int(time) - offset, data, 0, sequence=i)
        writer.finish()
    return path


@pytest.mark.parametrize("version", ["1", "2"])
@pytest.mark.parametrize("first", [0, -(10**9), START])
def test_own_recording(tmp_path, left, right, version, first):
    observed = right.copy()
    observed[3] = np.nan
    observed[4, 7] = np.nan
    confidence = np.where(np.isnan(observed[..., 0]), 0, 0.75)
    time = first + STEP * np.arange(12)
    hands = {
        "left": ("left", "grab left", time, left, np.ones((12, 21)), None),
        "right": ("right", "grab right", time, observed, confidence, right),
    }
    path = write_own(tmp_path / "run.mcap", hands, version, min(0, first))
    a, b = ht.load(path)
    np.testing.assert_array_equal(a.joints, left)
    np.testing.assert_array_equal(b.joints, observed)
    np.testing.assert_array_equal(b.confidence, confidence)
    np.testing.assert_array_equal(b.truth, right)
    np.testing.assert_array_equal(b.time_ns, time)
    assert a.truth is None
    assert b.frame_index.tolist() == list(range(100, 112))
    assert [(s.hand, s.name, s.subject) for s in (a, b)] == [
        ("left", "grab left", "A"),
        ("right", "grab right", "A"),
    ]


def test_bad_own_recordings(tmp_path, right):
    confidence, time = np.ones((12, 21)), STEP * np.arange(12)
    hands = {"right": ("right", "a", time, right, confidence, right)}

    def cut(i, state):
        del state.observed[62:]

    def sometimes(i, state):
        if i == 5:
            del state.truth[:]

    for change, message in [
        (cut, "observed has 62 numbers, expected 63"),
        (sometimes, "truth has 0 numbers, expected 63"),
    ]:
        with pytest.raises(ht.InputError, match=message):
            ht.load(write_own(tmp_path / "a.mcap", hands, change=change))
    both = {"right": ("both", "a", time, right, confidence, None)}
    with pytest.raises(ht.InputError, match="/right/model: a both hand with a left hand's model"):
        ht.load(write_own(tmp_path / "a.mcap", both))
    with pytest.raises(ht.InputError, match="format version 3, this handtrack reads 1 and 2"):
        ht.load(write_own(tmp_path / "a.mcap", hands, version="3"))
    with pytest.raises(ht.InputError, match=r"without handtrack\.State messages"):
        ht.load(write_own(tmp_path / "a.mcap", {}))


@pytest.mark.parametrize("how", ["cut", "flipped"])
def test_damaged_files_are_refused(tmp_path, right, how):
    frames = [{"bone_data": bones(j, "Right")} for j in right]
    path = write_json(tmp_path / "a.mcap", {"/hand": frames}, chunk_size=4000)
    data = bytearray(path.read_bytes())
    half = len(data) // 2
    if how == "flipped":
        data[half] ^= 1
    path.write_bytes(data[:half] if how == "cut" else data)
    with pytest.raises(ht.InputError, match="damaged"):
        ht.load(path)


def test_messages_out_of_order_and_files_without_an_index(tmp_path, right):
    """Legal MCAP of other writers: no summary, no checksums, times in any order."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            enable_crcs=False,
            index_types=IndexType.NONE,
            repeat_channels=False,
            use_statistics=False,
            use_summary_offsets=False,
        )
        writer.start()
        channel = writer.register_channel("/hand", "json", 0)
        for i in (3, 0, 2, 1):
            data = json.dumps({"joints": right[i].tolist(), "hand": "right"}).encode()
            writer.add_message(channel, START + i * STEP, data, 0)
        writer.finish()
    (sequence,) = ht.load(path)
    np.testing.assert_array_equal(sequence.joints, right[:4])


def test_what_the_recorder_writes(tmp_path, left):
    track = make_track(left)
    write_mcap([track], tmp_path / "t.mcap")
    (sequence,) = ht.load(tmp_path / "t.mcap")
    np.testing.assert_array_equal(sequence.joints, track.observed)
    np.testing.assert_array_equal(sequence.confidence, track.confidence)
    np.testing.assert_array_equal(sequence.truth, track.truth)
    np.testing.assert_array_equal(sequence.time_ns, track.time_ns)
    np.testing.assert_array_equal(sequence.frame_index, track.frame_index)
    assert (sequence.hand, sequence.subject, sequence.name) == ("left", "A", "wave")


def make_track(joints):
    from handtrack.tracking.track import Track

    n = len(joints)
    observed = joints.copy()
    observed[2, 3] = np.nan
    pose = np.tile([1.0, 0, 0, 0], (n, 1))
    angles = np.zeros((n, 20))
    return Track(
        name="wave",
        hand="left",
        time_ns=-(10**9) + STEP * np.arange(n),
        frame_index=5 + np.arange(n),
        observed=observed,
        confidence=np.where(np.isnan(observed[..., 0]), 0, 0.5),
        truth=joints,
        angles_raw=angles,
        angles=angles,
        quaternion_raw=pose,
        quaternion=pose,
        translation_raw=np.zeros((n, 3)),
        translation=np.zeros((n, 3)),
        fitted_joints=joints,
        filtered_joints=joints,
        angle_variance=np.ones((n, 20)),
        objective=np.zeros(n),
        iterations=np.ones(n, np.int64),
        status=np.full(n, "fitted"),
        reason=np.full(n, ""),
        model=ht.HandModel.default("left"),
        subject="A",
    )
