"""What other programs find in a file: Foxglove's messages and ROS 2's, decoded independently."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from made_tracks import make_track
from recording_checks import decoder, messages

from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import ANGLE_NAMES, PART_JOINT, PART_NAMES
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Event, Track

Messages = dict[str, list[tuple[int, Any, bytes]]]


@pytest.fixture
def found(recording: Path) -> Messages:
    return messages(recording)


def decoded(found: Messages, topic: str) -> list[Any]:
    make = decoder(found[topic][0][1])
    return [make.FromString(data) for _, _, data in found[topic]]


def test_topics_and_schemas(found: Messages, track: Track) -> None:
    counts = {topic: len(rows) for topic, rows in found.items()}
    n = len(track)
    known = int((track.status != "lost").sum())
    assert counts == {
        "/right/model": 1,
        "/right/state": n,
        "/right/event": 2,
        "/right/observed": n,
        "/right/fitted": n,
        "/right/mesh": n,
        "/right/skin": 1,
        "/right/transforms": known,
        "/right/joint_states": n,
        "/right/robot_description": 1,
        "/right/log": 4,
    }
    schemas = {topic.rpartition("/")[2]: rows[0][1] for topic, rows in found.items()}
    assert {name: schema.name for name, schema in schemas.items()} == {
        "model": "handtrack.Hand",
        "state": "handtrack.State",
        "event": "handtrack.Event",
        "observed": "foxglove.PointCloud",
        "fitted": "foxglove.PointCloud",
        "mesh": "foxglove.PointCloud",
        "skin": "foxglove.SceneUpdate",
        "transforms": "foxglove.FrameTransforms",
        "joint_states": "sensor_msgs/msg/JointState",
        "robot_description": "std_msgs/msg/String",
        "log": "foxglove.Log",
    }
    assert schemas["joint_states"].encoding == "ros2msg"
    assert schemas["robot_description"].encoding == "ros2msg"
    assert {s.encoding for s in schemas.values()} == {"protobuf", "ros2msg"}
    for topic, rows in found.items():
        if topic.rpartition("/")[2] in ("state", "observed", "mesh", "joint_states"):
            assert [time for time, _, _ in rows] == track.time_ns.tolist()


def test_without_mesh_or_without_skin(tmp_path: Path) -> None:
    for skin, mesh in ((True, False), (False, True)):
        path = write_mcap(make_track(5, skin=skin), tmp_path / "x.mcap", mesh=mesh)
        assert not {"/right/mesh", "/right/skin"} & set(messages(path))


def test_state_for_a_reader_who_knows_only_the_schema(found: Messages, track: Track) -> None:
    states = decoded(found, "/right/state")
    for i in (0, 21, 59):
        state = states[i]
        assert state.frame_index == track.frame_index[i]
        assert state.time_ns == track.time_ns[i]
        assert (state.status, state.reason) == (track.status[i], track.reason[i])
        for name in ("observed", "truth", "fitted_joints"):
            np.testing.assert_array_equal(
                np.array(getattr(state, name)).reshape(21, 3), getattr(track, name)[i]
            )
        for name in ("confidence", "angles", "angles_raw", "quaternion", "angle_variance"):
            np.testing.assert_array_equal(getattr(state, name), getattr(track, name)[i])
        assert state.sweeps == track.iterations[i]


def test_model_for_a_reader_who_knows_only_the_schema(found: Messages, track: Track) -> None:
    (hand,) = decoded(found, "/right/model")
    assert (hand.hand, hand.sequence_name, hand.subject) == ("right", "sample", "nobody")
    np.testing.assert_array_equal(
        np.array(hand.model.rest_joints).reshape(21, 3), track.model.rest_joints
    )
    np.testing.assert_array_equal(np.array(hand.model.faces).reshape(-1, 3), track.model.faces)


@pytest.mark.parametrize("topic", ["observed", "fitted", "mesh"])
def test_point_clouds(topic: str, found: Messages, track: Track) -> None:
    expected = {
        "observed": track.observed,
        "fitted": track.fitted_joints,
        "mesh": track.vertices(),
    }[topic]
    for i, cloud in enumerate(decoded(found, f"/right/{topic}")):
        assert cloud.frame_id == "world"
        assert cloud.timestamp.seconds * 10**9 + cloud.timestamp.nanos == track.time_ns[i]
        assert cloud.point_stride == 12
        assert [(f.name, f.offset, f.type) for f in cloud.fields] == [
            ("x", 0, 7),
            ("y", 4, 7),
            ("z", 8, 7),
        ]
        assert cloud.pose.orientation.w == 1
        points = np.frombuffer(cloud.data, "<f4").reshape(-1, 3)
        if np.isnan(expected[i]).any(-1).all():
            assert len(points) == 0
        else:
            np.testing.assert_array_equal(points, expected[i].astype(np.float32))


def test_transforms_lead_from_the_world_to_every_part(found: Messages, track: Track) -> None:
    known = np.flatnonzero(track.status != "lost")
    rotations = track.model.rotations(track.angles[known])
    root = quaternion_to_matrix(track.quaternion[known])
    for i, message in enumerate(decoded(found, "/right/transforms")):
        frames = {"world": (np.eye(3), np.zeros(3))}
        for transform in message.transforms:
            turn, move = frames[transform.parent_frame_id]
            q, t = transform.rotation, transform.translation
            local = quaternion_to_matrix(np.array([q.w, q.x, q.y, q.z]))
            child = (turn @ local, turn @ np.array([t.x, t.y, t.z]) + move)
            frames[transform.child_frame_id] = child
            stamp = transform.timestamp
            assert stamp.seconds * 10**9 + stamp.nanos == track.time_ns[known[i]]
        assert set(frames) == {"world", "right", *(f"right/{name}" for name in PART_NAMES)}
        for part, name in enumerate(PART_NAMES):
            turn, at = frames[f"right/{name}"]
            np.testing.assert_allclose(turn, root[i] @ rotations[i, part], atol=1e-12)
            joint = track.filtered_joints[known[i], PART_JOINT[part]]
            np.testing.assert_allclose(at, joint, atol=1e-12)
        np.testing.assert_allclose(frames["right"][1], track.translation[known[i]])


def test_a_robot_whose_capsules_are_the_bones(found: Messages, track: Track) -> None:
    ((time, schema, data),) = found["/right/robot_description"]
    assert (time, schema.data) == (0, b"string data\n")
    assert data[:4] == b"\0\1\0\0"
    assert int.from_bytes(data[4:8], "little") == len(data) - 8
    assert data.endswith(b"</robot>\0")
    robot = ElementTree.fromstring(data[8:-1])
    frames = {"right", *(f"right/{name}" for name in PART_NAMES)}
    assert [link.get("name") for link in robot.iter("link")][1:] == sorted(
        frames - {"right"}, key=lambda name: PART_NAMES.index(name[6:])
    )
    (message, *_) = decoded(found, "/right/transforms")
    parents = {t.child_frame_id: t.parent_frame_id for t in message.transforms}
    for joint in robot.iter("joint"):
        child, parent = joint.find("child"), joint.find("parent")
        assert child is not None
        assert parent is not None
        assert parents[child.get("link", "")] == parent.get("link")
    # each capsule is two balls and the tube between: from a part's joint along its bone
    rest = track.model.rest_joints
    for part, joint in enumerate(PART_JOINT):
        shapes = robot.findall(f"link[@name='right/{PART_NAMES[part]}']/visual")
        assert len(shapes) == (3 if part else 12)
        for k in range(0, len(shapes), 3):
            begin, end = (
                np.array(shapes[k + i].find("origin").get("xyz").split(), float) for i in (0, 1)
            )
            np.testing.assert_array_equal(begin, 0)
            bone = rest[(5, 9, 13, 17)[k // 3] if part == 0 else joint + 1] - rest[joint]
            assert 0.4 * np.linalg.norm(bone) < np.linalg.norm(end)
            np.testing.assert_allclose(np.cross(bone, end), 0, atol=1e-9)
            assert end @ bone > 0


class Cdr:
    """Little-endian CDR, just enough for a JointState."""

    def __init__(self, data: bytes) -> None:
        assert data[:4] == b"\x00\x01\x00\x00"
        self.data, self.at = data[4:], 0

    def number(self, kind: str) -> Any:
        size = struct.calcsize(kind)
        self.at += -self.at % size
        (value,) = struct.unpack_from(f"<{kind}", self.data, self.at)
        self.at += size
        return value

    def text(self) -> str:
        size = self.number("I")
        value = self.data[self.at : self.at + size]
        self.at += size
        assert value.endswith(b"\0")
        return value[:-1].decode()

    def numbers(self) -> list[float]:
        return [self.number("d") for _ in range(self.number("I"))]


def test_joint_states(found: Messages, track: Track) -> None:
    for i, (_, _, data) in enumerate(found["/right/joint_states"]):
        cdr = Cdr(data)
        assert cdr.number("i") * 10**9 + cdr.number("I") == track.time_ns[i]
        assert cdr.text() == ""
        assert [cdr.text() for _ in range(cdr.number("I"))] == list(ANGLE_NAMES)
        np.testing.assert_array_equal(cdr.numbers(), track.angles[i])
        assert (cdr.numbers(), cdr.numbers()) == ([], [])
        assert cdr.at == len(cdr.data)


def test_ros_reads_them(found: Messages, track: Track) -> None:
    """By a reader that is not ours: RViz cannot run here."""
    typesys = pytest.importorskip("rosbags.typesys")
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for i, (time, _, data) in enumerate(found["/right/joint_states"]):
        state = types.deserialize_cdr(data, "sensor_msgs/msg/JointState")
        assert state.name == list(ANGLE_NAMES)
        np.testing.assert_array_equal(state.position, track.angles[i])
        assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == time
    ((_, _, data),) = found["/right/robot_description"]
    robot = types.deserialize_cdr(data, "std_msgs/msg/String")
    assert ElementTree.fromstring(robot.data).tag == "robot"


def test_log_lines(found: Messages) -> None:
    lines = [(line.level, line.message) for line in decoded(found, "/right/log")]
    assert lines == [
        (2, "frame 100: predicted: first frame"),
        (2, "frame 101: fitted"),
        # an event says it already: no second line for the change of status
        (3, "hand lost: no joints"),
        (2, "hand found again after 6 frames"),
    ]


def test_changes_of_status_that_no_event_tells(track: Track, tmp_path: Path) -> None:
    quiet = dataclasses.replace(track, events=())
    found = messages(write_mcap(quiet, tmp_path / "x.mcap", mesh=False))
    lines = [(line.level, line.message) for line in decoded(found, "/right/log")]
    assert lines[2:] == [
        (3, "frame 120: lost: 0 of 21 joints observed, 4 are needed"),
        (2, "frame 126: fitted"),
    ]


def test_negative_times_are_shifted(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    track = make_track(10, start_ns=-5_000_000_000, lost=slice(3, 5))
    early = Event(-7_000_000_000, "info", "before the first frame")
    track = dataclasses.replace(track, events=(*track.events, early))
    path = write_mcap(track, tmp_path / "x.mcap")
    with path.open("rb") as stream:
        record = next(make_reader(stream).iter_metadata())
    offset = int(record.metadata["time_offset_ns"])
    assert offset == -7_000_000_000
    found = messages(path)
    assert [t + offset for t, _, _ in found["/right/state"]] == track.time_ns.tolist()
    assert found["/right/event"][0][0] == 0
    cloud = decoded(found, "/right/fitted")[0]
    assert cloud.timestamp.seconds == 2


def test_messages_of_several_hands_are_in_order_of_time(
    two_hands: list[Track], tmp_path: Path
) -> None:
    from mcap.reader import make_reader

    path = write_mcap(two_hands, tmp_path / "x.mcap", mesh=False)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        times = [m.log_time for _, _, m in reader.iter_messages(log_time_order=False)]
        summary = reader.get_summary()
    assert times == sorted(times)
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(times)
    assert {c.topic.split("/")[1] for c in summary.channels.values()} == {"right", "left"}


def test_seeking_by_the_index(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    track = make_track(300)
    path = write_mcap(track, tmp_path / "x.mcap")
    first, last = int(track.time_ns[100]), int(track.time_ns[130])
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        rows = list(reader.iter_messages("/right/state", starting_at=first, ending_before=last))
    assert [m.log_time for _, _, m in rows] == track.time_ns[100:130].tolist()
