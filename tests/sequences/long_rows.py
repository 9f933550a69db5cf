"""Rows of joints as text."""

import numpy as np

from handtrack.hand.skeleton import JOINT_NAMES

MEDIAPIPE = [
    n.upper() if n.startswith(("wrist", "thumb")) else n.upper().replace("_", "_FINGER_", 1)
    for n in JOINT_NAMES
]


UNITY = [
    n.replace("little", "pinky").replace("_", " ").title().replace(" ", "") for n in JOINT_NAMES
]


STYLES = {
    "numbers": [str(i) for i in range(21)],
    "from 1": [str(i + 1) for i in range(21)],
    "floats": [f"{i}.0" for i in range(21)],
    "joint_N": [f"joint_{i}" for i in range(21)],
    "ours": list(JOINT_NAMES),
    "mediapipe": MEDIAPIPE,
    "enum": [f"HandLandmark.{n}" for n in MEDIAPIPE],
    "number and name": [f"{i} {n}" for i, n in enumerate(MEDIAPIPE)],
    "unity": UNITY,
}


def rows(joints, names, frames=None, hand=None):
    """One tuple for each joint: frame, hand, name, x, y, z."""
    numbers = range(len(joints)) if frames is None else frames
    return [
        (frame, hand, name, *(f"{v:.6f}" for v in point))
        for frame, of in zip(numbers, joints, strict=True)
        for name, point in zip(names, of, strict=True)
    ]


def text(head, lines):
    return "\n".join([head, *(",".join(str(c) for c in line if c is not None) for line in lines)])


def same(sequence, truth):
    np.testing.assert_allclose(sequence.joints, truth, atol=1e-6)
