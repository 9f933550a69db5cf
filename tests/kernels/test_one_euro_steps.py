"""What the one-euro filter does with poses, each part in plain Python."""

from __future__ import annotations

import numpy as np
from plain import plain, record
from scipy.spatial.transform import Rotation

from handtrack.kernels import one_euro


def test_a_step_between_poses_turns_the_world_whatever_the_rotations():
    rng = np.random.default_rng(8)
    for _ in range(20):
        poses, turns = [record(one_euro.POSE) for _ in range(2)], Rotation.random(2, rng=rng)
        for pose, turn in zip(poses, turns, strict=True):
            pose.angles[:], pose.translation[:] = rng.normal(size=20), rng.normal(size=3)
            pose.rotation[:] = turn.as_matrix()
        d = np.zeros(26)
        plain(one_euro.step_between)(*poses, d)
        np.testing.assert_allclose(d[:20], poses[1].angles - poses[0].angles)
        turned = Rotation.from_rotvec(d[20:23]) * turns[0]
        np.testing.assert_allclose(turned.as_matrix(), poses[1].rotation, atol=1e-9)
        np.testing.assert_allclose(poses[0].translation + d[23:], poses[1].translation)
