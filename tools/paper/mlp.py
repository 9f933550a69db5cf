"""The perceptron of `baselines`: from 21 joints to the rotations of a hand's 16 parts.

As in IKNet (Zhou et al. 2020) it gets joints about the wrist, scaled to the hand's size, and the
bones' directions, and gives unit quaternions; six layers. Unlike IKNet it sees them in the palm's
frame, so that it need not learn how hands turn in the room. It has learned right hands from poses
inside the limits, of many proportions and with noise (train_mlp.py); left hands are mirrored.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_PARTS, PARENTS
from tools.paper.free_pose import FreeFit, accumulated, free_fit, joints_of

Array = NDArray[np.float64]

LAYERS = 6
WEIGHTS = "mlp_weights.npz"
_MIRROR = np.diag([1.0, 1.0, -1.0])


def features(joints: Array) -> Array:
    """(N, 123) what the network gets of joints (N, 21, 3) in the palm's frame: places about the
    wrist over the palm's length, and unit bones."""
    about = joints - joints[:, :1]
    palm = np.linalg.norm(about[:, [5, 9, 13, 17]], axis=-1).mean(1)
    bones = joints[:, 1:] - joints[:, PARENTS[1:]]
    bones = bones / np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), 1e-9)
    n = len(joints)
    scaled = about / np.maximum(palm, 1e-9)[:, None, None]
    return np.concatenate([scaled.reshape(n, -1), bones.reshape(n, -1)], 1)


def palm_frame(joints: Array) -> Array:
    """(N, 3, 3) axes of right hands, one a row: to the middle finger, to the thumb's side, out of
    the back."""
    x = joints[:, 9] - joints[:, 0]
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    z = np.cross(x, joints[:, 5] - joints[:, 17])
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], 1)


def predict(model: HandModel, joints: Array) -> FreeFit:
    """Rotations of complete joints (N, 21, 3), on the model's bones, laid on their middle."""
    left = model.hand == "left"
    seen = joints @ _MIRROR if left else joints
    frame = palm_frame(seen)
    x = features(np.einsum("nij,nkj->nki", frame, seen))
    layers = _weights()
    for i, (weight, bias) in enumerate(layers):
        x = x @ weight + bias
        if i < len(layers) - 1:
            x = np.maximum(x, 0.0)
    # the identity is what zeros mean
    q = x.reshape(-1, N_PARTS, 4) + np.array([1.0, 0, 0, 0])
    turns = quaternion_to_matrix(q)
    rotation, local = frame.swapaxes(1, 2) @ turns[:, 0], turns[:, 1:]
    if left:  # a mirrored turn in the mirrored axes of the left hand's rest pose
        flip = _rest_mirror(model)
        local = flip @ local @ flip
        rotation = _MIRROR @ rotation @ flip
    still = np.zeros((len(joints), 3))
    fitted = joints_of(model, *accumulated(model, local, rotation, still))
    return free_fit(model, joints, local, rotation, (joints - fitted).mean(1))


def _rest_mirror(model: HandModel) -> Array:
    """The reflection that brings a right hand's rest pose to the left's: across the palm."""
    return np.diag([1.0, -1.0, 1.0])


@cache
def _weights() -> list[tuple[Array, Array]]:
    """Matrix and bias of each layer."""
    path = Path(__file__).with_name(WEIGHTS)
    with path.open("rb") as stream, np.load(stream) as archive:
        return [
            (archive[f"w{i}"].astype(np.float64), archive[f"b{i}"].astype(np.float64))
            for i in range(LAYERS)
        ]
