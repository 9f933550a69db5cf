"""How far errors that last put a hand's angles and joints off: a detector's own, and the shape's.

A residual shows what is new in every frame. It does not show where a detector's landmarks lie
aside for a whole sequence, nor a bone that was taken for longer than it is: the pose gives way.
Both are known only as people and profiles spread. Through the fit's own gain
A = (J^T J)^-1 J^T they become deviations of the pose:

    x^ - x = A (e + S d),    e ~ N(0, E),    d ~ N(0, C)

with e the landmarks' lasting errors (`detectors.profile.Noise`: what is constant and what fades,
neighbours in a finger related, and the size of a hand that one camera sees breathe), d the rest
joints' own, S what they do to the joints of a pose. The mean over a sequence's poses is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.profile import Noise
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ARRIVING, N_ANGLES, N_JOINTS, PARENTS

Array = NDArray[np.float64]

_STEP = 1e-5
# strays are so many deviations off; a profile's deviations are without them
_STRAY = 6.0
# curvature of what no landmark shows [m^2/rad^2]
_TRACE = 1e-8


@dataclass(frozen=True, eq=False)
class Lasting:
    """Deviations that no residual shows.

    Attributes:
        angles: (20,) [rad].
        joints: (21,) of joint centres, per coordinate [m]; of one camera about the hand's middle:
            where the hand is, how it is turned, and its size are left out.
    """

    angles: Array
    joints: Array


def lasting_errors(
    model: HandModel, noise: Noise, rest_covariance: Array, angles: Array
) -> Lasting:
    """What lasts in the poses of a sequence.

    Args:
        model: the hand with the detector's landmarks.
        noise: the detector's.
        rest_covariance: (63, 63) of the hand's rest joints about the true ones [m^2].
        angles: (n, 20) some of the sequence's poses [rad].
    """
    landmarks, centres = pose_jacobians(model, angles)
    shape = _by_rest_joints(model, angles)
    points = model.landmarks(angles)
    normal = landmarks.swapaxes(1, 2) @ landmarks
    k = np.arange(normal.shape[-1])
    normal[:, k, k] += _TRACE
    gain = np.linalg.solve(normal, landmarks.swapaxes(1, 2))
    seen = noise_covariance(noise)[None].repeat(len(angles), 0)
    about = (points - points.mean(1, keepdims=True)).reshape(len(angles), -1)
    seen += noise.scale**2 * about[:, :, None] * about[:, None, :]
    both = seen + shape @ rest_covariance @ shape.swapaxes(1, 2)
    variance = np.einsum("nij,njk,nik->ni", gain[:, :N_ANGLES], both, gain[:, :N_ANGLES]).mean(0)
    # no angle is farther off than anything within its limits
    widest = (model.limits.upper - model.limits.lower) ** 2 / 12
    held = variance * widest / (variance + widest)

    own = centres @ gain
    by_noise, by_shape = own, shape - own @ shape
    if noise.scale > 0:
        left = _without_placing(model.joints(angles))
        by_noise, by_shape = left @ by_noise, left @ by_shape
    spread = np.einsum("nij,njk,nik->ni", by_noise, seen, by_noise)
    spread += np.einsum("nij,jk,nik->ni", by_shape, rest_covariance, by_shape)
    joints = spread.mean(0).reshape(N_JOINTS, 3).mean(1)
    return Lasting(np.sqrt(held), np.sqrt(joints))


def noise_covariance(noise: Noise) -> Array:
    """(63, 63) of what lasts in landmarks and of strays [m^2], alike in all directions."""
    related = np.eye(N_JOINTS)
    finger = np.abs(np.arange(4)[:, None] - np.arange(4))
    for f in range(5):
        part = slice(1 + 4 * f, 5 + 4 * f)
        related[part, part] = noise.finger**finger
    each = related * noise.lasting[:, None] * noise.lasting
    strays = 1.0 + noise.outliers * (_STRAY**2 - 1.0)
    return np.asarray(strays * np.kron(each, np.eye(3)))


def pose_jacobians(model: HandModel, angles: Array) -> tuple[Array, Array]:
    """(n, 63, 26) how landmarks and joints move with a pose: angles, turn, shift; root frame."""
    n = len(angles)
    steps = np.concatenate([_STEP * np.eye(N_ANGLES), -_STEP * np.eye(N_ANGLES)])
    moved = angles[:, None] + steps
    out = []
    for place in (model.landmarks, model.joints):
        near = place(moved).reshape(n, 2, N_ANGLES, 3 * N_JOINTS)
        by_angle = ((near[:, 0] - near[:, 1]) / (2 * _STEP)).swapaxes(1, 2)
        x = place(angles)
        turn = np.zeros((n, N_JOINTS, 3, 3))
        turn[..., 0, 1], turn[..., 0, 2] = x[..., 2], -x[..., 1]
        turn[..., 1, 0], turn[..., 1, 2] = -x[..., 2], x[..., 0]
        turn[..., 2, 0], turn[..., 2, 1] = x[..., 1], -x[..., 0]
        shift = np.broadcast_to(np.eye(3), (n, N_JOINTS, 3, 3)).reshape(n, 3 * N_JOINTS, 3)
        out.append(np.concatenate([by_angle, turn.reshape(n, 3 * N_JOINTS, 3), shift], 2))
    return out[0], out[1]


def _by_rest_joints(model: HandModel, angles: Array) -> Array:
    """(n, 63, 63) how the joints of poses move with the rest joints."""
    n = len(angles)
    turn = model.rotations(angles)[:, ARRIVING]
    out = np.zeros((n, N_JOINTS, 3, N_JOINTS, 3))
    out[:, 0, :, 0] = np.eye(3)
    for j in range(1, N_JOINTS):
        p = int(PARENTS[j])
        out[:, j] = out[:, p]
        out[:, j, :, j] += turn[:, j]
        out[:, j, :, p] -= turn[:, j]
    return out.reshape(n, 3 * N_JOINTS, 3 * N_JOINTS)


def _without_placing(joints: Array) -> Array:
    """(n, 63, 63) what a common shift, turn and change of size leave of moves of joints."""
    n = len(joints)
    x = joints - joints.mean(1, keepdims=True)
    basis = np.zeros((n, N_JOINTS, 3, 7))
    basis[..., :3] = np.eye(3)
    for i, axis in enumerate(np.eye(3)):
        basis[..., 3 + i] = np.cross(axis, x)
    basis[..., 6] = x
    q = np.linalg.qr(basis.reshape(n, 3 * N_JOINTS, -1))[0]
    return np.asarray(np.eye(3 * N_JOINTS) - q @ q.swapaxes(1, 2))
