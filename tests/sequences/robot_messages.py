"""Messages of ROS with hands in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.hand.rotations import matrix_to_quaternion, vector_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES
from tools.make.robot_logs import (
    START,
    STEP,
)

FRAMES = 12


POSE_ARRAY = "geometry_msgs/msg/PoseArray"


MARKERS = "visualization_msgs/msg/MarkerArray"


TF = "tf2_msgs/msg/TFMessage"


def moving(hand: str) -> np.ndarray:
    """(12, 21, 3) of a hand that bends [m]."""
    model = ht.HandModel.default(hand)
    bend = np.linspace(0, 1, FRAMES)[:, None] * np.tile([0.8, 0.05, 0.9, 0.6], 5)
    return model.joints(model.limits.clamp(bend), None, [0.1, 0.2, 0.5])


LEFT, RIGHT = moving("left"), moving("right")


def ros(schema: str, message: Any, text: bytes = b"") -> tuple[str, str, str, bytes, Any]:
    return schema, "ros2msg", "cdr", text, message


def both(path: Path) -> tuple[ht.Sequence, ht.Sequence]:
    found = ht.load(path)
    assert [s.hand for s in found] == ["left", "right"]
    for sequence in found:
        np.testing.assert_array_equal(sequence.time_ns, START + np.arange(FRAMES) * STEP)
    return found[0], found[1]


def chain(joints: np.ndarray, side: str) -> list[tuple[str, str, Any, Any]]:
    """Frames of joints, each in the one before, all turned against one another."""
    turn = {0: vector_to_matrix(np.array([0.3, -0.4, 0.5]))}
    frames: list[tuple[str, str, Any, Any]] = []

    def xyzw(matrix: np.ndarray) -> np.ndarray:
        return np.roll(matrix_to_quaternion(matrix), -1)

    frames.append(("headset", f"{side}_{JOINT_NAMES[0]}", joints[0], xyzw(turn[0])))
    for j in range(1, 21):
        above = 0 if j % 4 == 1 else j - 1
        own = vector_to_matrix(np.array([0.1 * j, 0.2, -0.05 * j]))
        turn[j] = turn[above] @ own
        place = turn[above].T @ (joints[j] - joints[above])
        names = f"{side}_{JOINT_NAMES[above]}", f"{side}_{JOINT_NAMES[j]}"
        frames.append((*names, place, xyzw(own)))
    return frames
