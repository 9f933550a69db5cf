"""Forward kinematics of any poses against SciPy's rotations, multiplied out one by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.kernels.kinematics import Placed, place_poses

MODEL = HandModel.default("left")
TWIST = 0.7


def some_hand(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Joints at rest, the wrist away from the origin, and axes that are no hand's."""
    axes = MODEL.axes + rng.normal(0, 0.3, (20, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return MODEL.rest_joints + rng.normal(0, 0.01, (21, 3)), axes


def multiplied(rest: np.ndarray, axes: np.ndarray, twist: float, angles: np.ndarray) -> Placed:
    """The same by eq. 1, 2, 4 and 5; only the thumb (finger 0) has the inner turn."""
    joints, parts, turning = rest.copy(), np.tile(np.eye(3), (16, 1, 1)), axes.copy()
    for f in range(5):
        k, a = 4 * f + 1, 4 * f
        turn = [Rotation.from_rotvec(axes[a + i] * angles[a + i]) for i in range(4)]
        inner = twist if f == 0 else 0.0
        bone = rest[k + 1] - rest[k]
        bone /= np.linalg.norm(bone)
        whole = turn[0] * turn[1]
        turning[a + 1] = turn[0].apply(axes[a + 1]) + inner * whole.apply(bone)
        whole = whole * Rotation.from_rotvec(inner * angles[a + 1] * bone)
        for i in range(3):
            if i:
                turning[a + 1 + i] = whole.apply(axes[a + 1 + i])
                whole = whole * turn[1 + i]
            parts[3 * f + 1 + i] = whole.as_matrix()
            joints[k + i + 1] = joints[k + i] + whole.apply(rest[k + i + 1] - rest[k + i])
    return Placed(joints, parts, turning)


@pytest.mark.parametrize("reach", [1.0, 3.1, 60.0])
def test_poses_are_the_equations_multiplied_out(reach):
    rng = np.random.default_rng(0)
    rest, axes = some_hand(rng)
    angles = rng.uniform(-reach, reach, (2, 15, 20))
    for twist in (0.0, TWIST):
        found = place_poses(rest, axes, twist, angles)
        for i in np.ndindex(2, 15):
            for one, truth in zip(found, multiplied(rest, axes, twist, angles[i]), strict=True):
                assert np.allclose(one[i], truth, rtol=0, atol=1e-13)


def test_joints_move_about_the_axes():
    rng = np.random.default_rng(1)
    rest, axes = some_hand(rng)
    angles, h = rng.uniform(-1, 1, 20), 1e-6
    found = place_poses(rest, axes, TWIST, angles)
    for a in range(20):
        step = h * np.eye(20)[a]
        ahead, back = (place_poses(rest, axes, TWIST, angles + s).joints for s in (step, -step))
        about = found.joints[4 * (a // 4) + 1 + max(a % 4 - 1, 0)]
        below = np.arange(4 * (a // 4) + 2 + max(a % 4 - 1, 0), 4 * (a // 4) + 5)
        expected = np.zeros((21, 3))
        expected[below] = np.cross(found.axes[a], found.joints[below] - about)
        assert np.allclose((ahead - back) / (2 * h), expected, rtol=0, atol=1e-9)


def test_a_missing_angle_leaves_the_other_fingers():
    angles = np.zeros(20)
    angles[6] = np.nan
    joints = place_poses(MODEL.rest_joints, MODEL.axes, 0.0, angles).joints
    assert np.isnan(joints[[7, 8]]).all()
    assert np.array_equal(joints[9:], MODEL.rest_joints[9:])
    assert np.array_equal(joints[:5], MODEL.rest_joints[:5])
    angles = np.full((3, 20), np.nan)
    assert np.isnan(MODEL.joints(angles)[:, [2, 6, 10, 14, 18]]).all()


def test_the_arguments_are_left_alone():
    rng = np.random.default_rng(2)
    rest, axes = some_hand(rng)
    angles = rng.uniform(-9, 9, (4, 40))[:, ::2]
    before = rest.copy(), axes.copy(), angles.copy()
    place_poses(rest, axes, TWIST, angles)
    for old, new in zip(before, (rest, axes, angles), strict=True):
        assert np.array_equal(old, new)
    frozen = angles.copy()
    frozen.flags.writeable = False
    assert place_poses(rest, axes, TWIST, frozen).joints.flags.writeable
