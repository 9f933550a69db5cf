"""Local axes from a rest skeleton: right where they are known, the same in any frame."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.errors import ModelError
from handtrack.hand.axes import local_axes, palm_frame
from handtrack.hand.skeleton import ANGLE_JOINT, ORDERS

HANDS = ("right", "left")


def between(a, b):
    return np.rad2deg(np.arccos(np.clip((a * b).sum(-1), -1, 1)))


@pytest.mark.parametrize("hand", HANDS)
def test_axes_of_the_free_hand(hand):
    """Its fingers' axes were laid by hand; the thumb's are those of its geometry."""
    model = ht.HandModel.default(hand)
    off = between(local_axes(model.rest_joints, hand), model.axes)
    assert off[4:].max() < 5
    assert off[:4].max() < 0.01
    assert between(palm_frame(model.rest_joints, hand), np.eye(3)).max() < 6


@pytest.mark.parametrize("hand", HANDS)
def test_axes_move_with_the_hand_and_not_with_its_size(hand):
    joints = ht.HandModel.default(hand).rest_joints
    turn = Rotation.random(random_state=1).as_matrix()
    moved = 3.7 * joints @ turn.T + [1, 2, 3]
    assert np.abs(local_axes(moved, hand) - local_axes(joints, hand) @ turn.T).max() < 1e-12


def test_left_axes_are_those_of_the_mirror_image():
    joints = ht.HandModel.default("right").rest_joints
    mirror = np.array([1, -1, 1])
    # a mirrored rotation turns the other way about the mirrored axis
    assert (
        np.abs(local_axes(joints * mirror, "left") + local_axes(joints, "right") * mirror).max()
        < 1e-12
    )


@pytest.mark.parametrize("hand", HANDS)
def test_axes_are_across_the_bones_they_turn(hand):
    rng = np.random.default_rng(0)
    joints = ht.HandModel.default(hand).rest_joints + rng.normal(0, 0.002, (21, 3))
    axes = local_axes(joints, hand)
    bones = joints[ANGLE_JOINT + 1] - joints[ANGLE_JOINT]
    assert np.abs((axes * bones).sum(1)).max() < 1e-12
    assert np.abs(np.linalg.norm(axes, axis=1) - 1).max() < 1e-12
    saddle = axes.reshape(5, 4, 3)
    assert np.abs((saddle[:, 0] * saddle[:, 1]).sum(1)).max() < 1e-12


def test_a_finger_that_rests_bent_bends_in_its_own_plane():
    """The plane of a bent finger counts; sideways and backward bends do not."""
    model = ht.HandModel.default("right")
    joints = model.rest_joints
    own = np.array([0.0, 1.0, 0.4]) / np.hypot(1, 0.4)
    bent = joints.copy()
    for sign, expected in ((1, True), (-1, False)):
        for i, degrees in ((6, 40), (7, 30)):
            turn = Rotation.from_rotvec(sign * np.deg2rad(degrees) * own).as_matrix()
            bent[i + 1 : 9] = bent[i] + (bent[i + 1 : 9] - bent[i]) @ turn.T
        before = between(local_axes(joints, "right")[6], own)
        after = between(local_axes(bent, "right")[6], own)
        assert bool(after < 0.7 * before) is expected
        bent = joints.copy()


def test_axes_of_real_hands(shared_data):
    """Bent fingers of 55 poses made by hand turn about the axes, brought along by the bones."""
    for hand in HANDS:
        data = np.load(shared_data / "poses" / f"{hand}.npz")
        joints = data["xyz_mm"][:, list(ORDERS["webxr"])] / 1000.0
        off = {"thumb": [], "fingers": []}
        for pose in joints:
            axes = local_axes(pose, hand)  # the poses' own proximal bones and palm
            for f in range(5):
                bones = np.diff(pose[4 * f + 1 : 4 * f + 5], axis=0)
                bones /= np.linalg.norm(bones, axis=1, keepdims=True)
                bend = np.cross(bones[:2], bones[1:])
                for i in (0, 1):
                    if np.linalg.norm(bend[i]) > 0.4:
                        found = between(bend[i] / np.linalg.norm(bend[i]), axes[4 * f + 2 + i])
                        off["fingers" if f else "thumb"].append(found)
        assert len(off["thumb"]) > 40
        assert len(off["fingers"]) > 200
        assert np.median(off["fingers"]) < 12
        assert np.median(off["thumb"]) < 12


def test_a_palm_without_width_is_refused():
    joints = ht.HandModel.default("right").rest_joints.copy()
    joints[5] = joints[17]
    with pytest.raises(ModelError, match="no width"):
        local_axes(joints, "right")
    joints = ht.HandModel.default("right").rest_joints.copy()
    joints[7] = joints[6]
    with pytest.raises(ModelError, match="joint 7 has no length"):
        local_axes(joints, "right")
