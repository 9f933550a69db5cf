"""Poses, objectives and derivatives for the tests of the fitter, written apart from it.

Forward kinematics are a product of exponentials in NumPy and SciPy: from the tip inwards every
angle turns what lies beyond its joint about its axis at rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_JOINT

Array = np.ndarray
N_POSE = 26
SADDLES = np.array([[0, 1], [4, 5], [8, 9], [12, 13], [16, 17]])
HINGES = np.setdiff1d(np.arange(20), SADDLES)


# ---- poses ----


@dataclass(frozen=True)
class Poses:
    """n random poses; joints are the truth with noise."""

    angles: Array
    rotation: Array
    translation: Array
    truth: Array
    joints: Array


def some_poses(
    model: HandModel, n: int, sigma: float = 0.0, seed: int = 0, margin: float = 0.0
) -> Poses:
    """Valid poses with random rotations; with a margin they keep that share from the limits."""
    rng = np.random.default_rng(seed)
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper, (n, 20)))
    angles[:, SADDLES] *= 1 - margin
    middle = (limits.lower + limits.upper)[HINGES] / 2
    angles[:, HINGES] = middle + (1 - margin) * (angles[:, HINGES] - middle)
    rotation = Rotation.random(n, rng=rng).as_matrix()
    translation = rng.normal(0.0, 0.5, (n, 3))
    truth = model.joints(angles, rotation, translation)
    return Poses(angles, rotation, translation, truth, truth + rng.normal(0, sigma, truth.shape))


def distances(a: Array, b: Array) -> Array:
    return np.linalg.norm(a - b, axis=-1)


def beyond(a: int) -> range:
    """The joints that angle a moves."""
    k = int(ANGLE_JOINT[a])
    return range(k + 1, (k - 1) // 4 * 4 + 5)


def ellipse_value(limits: Limits, angles: Array) -> Array:
    """(..., 5) left side of eq. 3 for each saddle."""
    pairs = angles[..., SADDLES]
    star = np.where(pairs < 0, limits.lower[SADDLES], limits.upper[SADDLES])
    return np.square(pairs / star).sum(-1)


# ---- kinematics and derivatives by finite differences ----


def forward(model: HandModel, angles: Array, twist: float = 0.0) -> Array:
    """(n, 21, 3) joints of angles (n, 20); the thumb's base also turns about its own bone."""
    rest, axes = model.rest_joints, model.axes
    out = np.repeat(rest[None], len(angles), 0)
    for a in range(19, -1, -1):  # abduction comes after flexion in the order, so it acts first
        k, moved = int(ANGLE_JOINT[a]), beyond(a)
        r = Rotation.from_rotvec(axes[a] * angles[:, a : a + 1])
        for j in moved:
            out[:, j] = rest[k] + r.apply(out[:, j] - rest[k])
    if twist:
        # R_in R_k (thumb): R_in turns about the bone where R_k has brought it
        bone = out[:, 2] - out[:, 1]
        bone /= np.linalg.norm(bone, axis=-1, keepdims=True)
        r_in = Rotation.from_rotvec(bone * (twist * angles[:, 1:2]))
        for j in beyond(0):
            out[:, j] = rest[1] + r_in.apply(out[:, j] - rest[1])
    return out


def moved_joints(
    model: HandModel, angles: Array, rotation: Array, translation: Array, steps: Array, twist=0.0
) -> Array:
    """(n, 21, 3) joints after steps (n, 26): angles, then R exp(omega) and t + R v."""
    joints = forward(model, angles + steps[:, :20], twist)
    turned = Rotation.from_matrix(rotation) * Rotation.from_rotvec(steps[:, 20:23])
    shift = translation + steps[:, 23:] @ rotation.T
    return np.einsum("nij,nkj->nki", turned.as_matrix(), joints) + shift[:, None]


def jacobian(model, angles, rotation, translation, twist=0.0, h: float = 1e-5) -> Array:
    """(63, 26) of the joints, by central differences."""
    steps = h * np.concatenate([np.eye(N_POSE), -np.eye(N_POSE)])
    joints = moved_joints(model, angles, rotation, translation, steps, twist).reshape(-1, 63)
    return (joints[:N_POSE] - joints[N_POSE:]).T / (2 * h)


def objective(model: HandModel, fit, joints: Array, weights: Array | None = None) -> float:
    """Eq. 6 at a fit, from its angles, rotation and translation alone."""
    placed = forward(model, fit.angles[None])[0] @ fit.rotation.T + fit.translation
    d2 = np.square(placed - joints).sum(-1)
    w = np.ones(21) if weights is None else weights
    return float((w * d2)[np.isfinite(d2) & (w > 0)].sum())
