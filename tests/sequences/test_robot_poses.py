"""Logs of robots: poses in JSON, in the tree of frames, and more."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robot_messages import FRAMES, LEFT, MARKERS, POSE_ARRAY, RIGHT, TF, both, chain, ros
from screens import lacking

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers.robot_logs import decode
from tools.make.robot_logs import (
    HUMBLE,
    START,
    STEP,
    CdrOut,
    Topics,
    foxglove_frames,
    foxglove_poses_json,
    marker_array,
    pose_array,
    protobuf,
    tf_message,
    write_log,
)


def test_foxglove_poses_in_json(tmp_path: Path) -> None:
    topics: Topics = {
        f"/{side}": (
            *("foxglove.PosesInFrame", "jsonschema", "json", b"{}"),
            lambda time, i, j=j: foxglove_poses_json(time, j[i]),
        )
        for side, j in (("left", LEFT), ("right", RIGHT))
    }
    left, right = both(write_log(tmp_path / "x.mcap", topics, FRAMES))
    np.testing.assert_allclose(left.joints, LEFT)
    np.testing.assert_allclose(right.joints, RIGHT)


def test_our_own_recordings_are_not_taken_for_robots(tmp_path: Path, sample: ht.Sequence) -> None:
    track = ht.track(sample.frames(0, 10), ht.HandModel.default(), calibrate="none")
    ht.write_mcap(track, tmp_path / "x.mcap")
    (found,) = ht.load(tmp_path / "x.mcap")
    np.testing.assert_array_equal(found.joints, track.observed)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap", "ros1"])
def test_ros_bags(tmp_path: Path, storage: str) -> None:
    try:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        lacking("rosbags", "it writes and reads the bags")
    kind = "geometry_msgs/msg/PoseArray"
    path = tmp_path / ("hands.bag" if storage == "ros1" else "hands")
    if storage == "ros1":
        store = get_typestore(Stores.ROS1_NOETIC)
        writer: Any = rosbag1.Writer(path)
    else:
        store = get_typestore(Stores.ROS2_HUMBLE)
        plugin = rosbag2.StoragePlugin[storage.upper()]
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    with writer:
        channels = {
            side: writer.add_connection(f"/{side}_hand/poses", kind, typestore=store)
            for side in ("left", "right")
        }
        for i in range(FRAMES):
            for side, joints in (("left", LEFT), ("right", RIGHT)):
                time = START + i * STEP
                data = pose_array(time, joints[i])
                if storage == "ros1":
                    message = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(data, kind)
                    header = store.types["std_msgs/msg/Header"](
                        seq=i, stamp=message.header.stamp, frame_id="world"
                    )
                    again = store.types[kind](header=header, poses=message.poses)
                    data = bytes(store.serialize_ros1(again, kind))
                writer.write(channels[side], time, data)
    left, right = both(path)
    np.testing.assert_allclose(left.joints, LEFT)
    np.testing.assert_allclose(right.joints, RIGHT)
    assert left.name.startswith("hands")
    if storage == "sqlite3":
        (db3,) = path.glob("*.db3")
        assert len(ht.load(db3)) == 2
        data = db3.read_bytes()
        db3.write_bytes(data[: len(data) // 2])
        with pytest.raises(HandtrackError, match="bag is damaged"):
            ht.load(path)
        (path / "metadata.yaml").unlink()
        with pytest.raises(HandtrackError, match=r"its metadata\.yaml is not beside"):
            ht.load(db3)


def test_logs_without_hands_say_what_there_is(tmp_path: Path) -> None:
    topics: Topics = {
        "/goals": ros(POSE_ARRAY, lambda time, i: pose_array(time, np.zeros((7, 3)))),
        "/tf": ros(TF, lambda time, i: tf_message(time, [("a", "b", [0, 0, 0], (0, 0, 0, 1))])),
    }
    with pytest.raises(HandtrackError, match=r"no hand .* /goals \(7 poses\); /tf \(frames\)"):
        ht.load(write_log(tmp_path / "x.mcap", topics, 3))


def test_damaged_messages_are_told(tmp_path: Path) -> None:
    whole = {
        (POSE_ARRAY, "cdr", b""): pose_array(START, RIGHT[0]),
        (MARKERS, "cdr", HUMBLE): marker_array(
            START, [("right", j, RIGHT[0, j]) for j in range(21)]
        ),
        (TF, "cdr", b""): tf_message(START, chain(RIGHT[0], "right")),
        (
            *("foxglove.FrameTransforms", "protobuf"),
            protobuf("foxglove.FrameTransforms"),
        ): foxglove_frames(START, chain(RIGHT[0], "right")),
    }
    rng = np.random.default_rng(1)
    told = 0
    for (schema, encoding, text), data in whole.items():
        for _ in range(300):
            broken = bytearray(data[: rng.integers(len(data))] if rng.random() < 0.5 else data)
            for at in rng.integers(0, max(len(broken), 1), 6):
                broken[at : at + 1] = bytes([int(rng.integers(256))])
            try:
                list(decode([bytes(broken)], schema, encoding, text))
            except (ValueError, TypeError, KeyError, IndexError, OverflowError, struct.error):
                told += 1
    assert told > 300
    topics: Topics = {"/right": ros(POSE_ARRAY, lambda time, i: pose_array(time, RIGHT[i])[:90])}
    with pytest.raises(HandtrackError, match="/right, message 0 is no geometry_msgs"):
        ht.load(write_log(tmp_path / "x.mcap", topics, 3))


@pytest.mark.parametrize("spread", [0, 500_000])
@pytest.mark.parametrize("schema", ["PoseStamped", "PointStamped"])
@pytest.mark.parametrize("name", ["/{side}_hand/{joint}", "/hands/{side}/{joint}/pose"])
def test_a_topic_for_each_joint(tmp_path: Path, schema: str, spread: int, name: str) -> None:
    # joints of one frame have a stamp each, or one together; one is not seen in a frame
    def message(joints: np.ndarray, j: int) -> Any:
        def of(time: int, i: int) -> bytes:
            out = CdrOut().header(time + j * spread, "world")
            turn = (0.0, 0.0, 0.6, 0.8) if schema == "PoseStamped" else ()
            return bytes(out.put("d", *map(float, (*joints[i, j], *turn))).data)

        return of

    topics: Topics = {
        name.format(side=side, joint=joint): ros(f"geometry_msgs/msg/{schema}", message(joints, j))
        for side, joints in (("left", LEFT), ("right", RIGHT))
        for j, joint in enumerate(JOINT_NAMES)
    }
    found = ht.load(write_log(tmp_path / "x.mcap", topics, FRAMES))
    assert [s.hand for s in found] == ["left", "right"]
    for sequence, joints in zip(found, (LEFT, RIGHT), strict=True):
        np.testing.assert_allclose(sequence.joints, joints)
        assert np.diff(sequence.time_ns) == pytest.approx(STEP)


def bridged(kind: str, time: int) -> list[dict[str, Any]]:
    """Both hands' messages of one moment, as rosbridge sends them."""
    i = (time - START) // STEP
    header = {"stamp": {"sec": time // 10**9, "nanosec": time % 10**9}, "frame_id": "world"}
    sent = []
    for side, joints in (("left", LEFT), ("right", RIGHT)):
        at = [dict(zip("xyz", map(float, p), strict=True)) for p in joints[i]]
        poses = [{"position": p, "orientation": dict.fromkeys("xyzw", 0.5)} for p in at]
        names = [f"{side}_{joint}" for joint in JOINT_NAMES]
        if kind == "poses":
            sent.append((f"/{side}_hand", {"header": header, "poses": poses}))
        elif kind == "markers":
            markers = [
                {"header": header, "ns": n, "id": j, "type": 2, "action": 0, "pose": poses[j]}
                for j, n in enumerate(names)
            ]
            sent.append((f"/{side}/markers", {"markers": markers}))
        elif kind == "tf":
            turned = [{"translation": p, "rotation": dict.fromkeys("xyzw", 0.5)} for p in at]
            frames = [
                {"header": header, "child_frame_id": n, "transform": t}
                for n, t in zip(names, turned, strict=True)
            ]
            sent.append(("/tf", {"transforms": frames}))
        else:
            ones = {"pose": poses, "point": at, "unstamped": poses}[kind]
            key = "point" if kind == "point" else "pose"
            said = {} if kind == "unstamped" else {"header": header}
            sent += [(f"/{n}", {**said, key: p}) for n, p in zip(names, ones, strict=True)]
    return [{"op": "publish", "topic": topic, "msg": msg} for topic, msg in sent]


@pytest.mark.parametrize("kind", ["poses", "markers", "tf", "pose", "point", "unstamped"])
def test_rosbridge(tmp_path: Path, kind: str) -> None:
    sent = [m for i in range(FRAMES) for m in bridged(kind, START + i * STEP)]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, sent)))
    (tmp_path / "a.json").write_text(json.dumps(sent))
    for name in ("a.jsonl", "a.json"):
        if kind == "unstamped":
            left, right = ht.load(tmp_path / name)
            assert [left.hand, right.hand] == ["left", "right"]
        else:
            left, right = both(tmp_path / name)
        np.testing.assert_allclose(left.joints, LEFT)
        np.testing.assert_allclose(right.joints, RIGHT)


def test_stamps_beyond_64_bits_are_told(tmp_path: Path) -> None:
    for kind in ("pose", "tf", "poses", "markers"):
        sent = [m for i in range(FRAMES) for m in bridged(kind, START + i * STEP)]
        text = "\n".join(map(json.dumps, sent))
        path = tmp_path / "a.jsonl"
        path.write_text(text.replace(f'"sec": {START // 10**9}', f'"sec": {10**30}'))
        with pytest.raises(HandtrackError, match="stamp is beyond 64 bits"):
            ht.load(path)
