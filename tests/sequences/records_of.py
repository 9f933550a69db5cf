"""Hands as records."""

import numpy as np

from handtrack.hand.skeleton import JOINT_NAMES


def objects(joints, **more):
    return [dict(zip("xyz", j, strict=True)) | more for j in joints.tolist()]


def named(joints, names=JOINT_NAMES):
    return dict(zip(names, joints.tolist(), strict=True))


def same(sequence, joints, first=0):
    np.testing.assert_allclose(sequence.joints[first:], joints, atol=1e-9)
