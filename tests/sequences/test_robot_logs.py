"""Robots' logs: every kind holds the joints that were written; damage is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robot_messages import FRAMES, LEFT, MARKERS, POSE_ARRAY, RIGHT, TF, both, chain, ros

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES, ORDERS
from tools.make.robot_logs import (
    HUMBLE,
    Topics,
    foxglove_frames,
    isaac_record,
    marker_array,
    pose_array,
    protobuf,
    tf_message,
    write_log,
)


def openxr(joints: np.ndarray) -> np.ndarray:
    """(T, 26, 3) with a palm and metacarpals between."""
    out = np.repeat(joints[:, :1] + [0.01, 0.0, 0.0], 26, axis=1)
    out[:, list(ORDERS["openxr"])] = joints
    return out


def test_isaac_teleop(tmp_path: Path) -> None:
    pytest.importorskip("flatbuffers")
    hands = {"left": openxr(LEFT).astype(np.float32), "right": openxr(RIGHT).astype(np.float32)}
    hands["right"][3, 10] = np.nan
    topics: Topics = {
        f"hands/{side}_hand": (
            *("core.HandPoseRecord", "flatbuffer", "flatbuffer", b"bfbs"),
            lambda time, i, p=places: isaac_record(time, None if i == 5 else p[i]),
        )
        for side, places in hands.items()
    }
    left, right = both(write_log(tmp_path / "x.mcap", topics, FRAMES))
    assert np.isnan(left.joints[5]).all()
    assert np.isnan(right.joints[3, 8]).all()
    keep = np.arange(FRAMES) != 5
    np.testing.assert_allclose(left.joints[keep], LEFT[keep], atol=1e-6)
    np.testing.assert_allclose(right.joints[4], RIGHT[4], atol=1e-6)


@pytest.mark.parametrize("count", [21, 26])
def test_pose_arrays(tmp_path: Path, count: int) -> None:
    places = {"left": LEFT, "right": RIGHT}
    if count == 26:
        places = {side: openxr(joints) for side, joints in places.items()}
    topics: Topics = {
        f"/tracking/{side}_hand": ros(
            POSE_ARRAY, lambda time, i, j=j: pose_array(time, j[i] if i != 4 else j[i][:0])
        )
        for side, j in places.items()
    }
    topics["/robot/goals"] = ros(POSE_ARRAY, lambda time, i: pose_array(time, np.zeros((7, 3))))
    left, right = both(write_log(tmp_path / "x.mcap", topics, FRAMES))
    assert np.isnan(left.joints[4]).all()
    keep = np.arange(FRAMES) != 4
    np.testing.assert_allclose(left.joints[keep], LEFT[keep])
    np.testing.assert_allclose(right.joints[keep], RIGHT[keep])


@pytest.mark.parametrize("new", [True, False])
def test_markers_by_name_and_by_number(tmp_path: Path, new: bool) -> None:
    order = np.random.default_rng(0).permutation(21)

    def named(time: int, i: int) -> bytes:
        spheres = [(f"{s}_{JOINT_NAMES[j]}", 0, p[i, j]) for s, p in hands for j in order]
        return marker_array(time, spheres, new=new)

    def numbered(time: int, i: int) -> bytes:
        spheres = [(f"{s}_hand", int(j) + 1, p[i, j]) for s, p in hands for j in order]
        return marker_array(time, spheres, new=new)

    hands = [("left", LEFT), ("right", RIGHT)]
    for name, message in (("named", named), ("numbered", numbered)):
        text = HUMBLE if new else b"string text"
        topics: Topics = {"/hands": ros(MARKERS, message, text)}
        left, right = both(write_log(tmp_path / f"{name}.mcap", topics, FRAMES))
        np.testing.assert_allclose(left.joints, LEFT)
        np.testing.assert_allclose(right.joints, RIGHT)


@pytest.mark.parametrize("kind", [TF, "foxglove_msgs/msg/FrameTransforms", "foxglove"])
def test_named_frames(tmp_path: Path, kind: str) -> None:
    # the headset stands in the world, and moves
    def all_frames(time: int, i: int) -> list[tuple[str, str, Any, Any]]:
        world = [("world", "headset", [0.1 * i, 0, 0], (0, 0, 0, 1))]
        return world + chain(LEFT[i], "left") + chain(RIGHT[i], "right")

    if kind != "foxglove":
        entry = ros(kind, lambda time, i: tf_message(time, all_frames(time, i)))
    else:
        name = "foxglove.FrameTransforms"
        entry = (
            *(name, "protobuf", "protobuf", protobuf(name)),
            lambda time, i: foxglove_frames(time, all_frames(time, i)),
        )
    left, right = both(write_log(tmp_path / "x.mcap", {"/tf": entry}, FRAMES))
    moved = np.arange(FRAMES)[:, None, None] * [0.1, 0, 0]
    np.testing.assert_allclose(left.joints, LEFT + moved, atol=1e-9)
    np.testing.assert_allclose(right.joints, RIGHT + moved, atol=1e-9)


def test_frames_that_go_in_a_circle_are_told(tmp_path: Path) -> None:
    def message(time: int, i: int) -> bytes:
        frames = chain(RIGHT[i], "right")
        return tf_message(time, [("right_index_tip", "headset", [0, 0, 0], (0, 0, 0, 1)), *frames])

    with pytest.raises(HandtrackError, match="frames above it"):
        ht.load(write_log(tmp_path / "x.mcap", {"/tf": ros(TF, message)}, 3))
