"""The hand's chains with free constants: bases, bones and axes, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import BASES, N_JOINTS

if TYPE_CHECKING:
    from handtrack.kernels.kinematics import Placed

Array = NDArray[np.float64]

# constants of a finger: base 3, three bones 3 each, then two for each of its four axes
SIZE = 20
AXES = 12


@dataclass(frozen=True, eq=False)
class Chains:
    """Five fingers of a saddle and two hinges each (Li et al. 2021, eq. 1, 2, 4, 5).

    A finger's 20 constants: its base (3) and its three bones at rest (3 each) less the
    prior's [m], then for each axis how far it is moved along the two directions of its
    `charts` before it is brought back to unit length. Zeros are the prior hand.

    Attributes:
        wrist: (3,) where the prior's root frame has it.
        base: (5, 3) from there, bones: (5, 3, 3), axes: (5, 4, 3) of the prior, in the root frame.
        charts: (5, 4, 2, 3) directions at right angles to each axis.
        twist: the thumb's inner turn for each radian of its abduction.
        limits: of the angles.
        neutral: (5, 4) angles that are expected [rad].
        loose: (4,) standard deviations about them [rad].
        strict: standard deviation of angles outside their limits [rad].
    """

    wrist: Array
    base: Array
    bones: Array
    axes: Array
    charts: Array
    twist: float
    limits: Limits
    neutral: Array
    loose: Array
    strict: float

    @staticmethod
    def of(model: HandModel, loose: Array, strict: float) -> Chains:
        """The chains of a model.

        The first direction of an axis turns it about the finger (a twist), the second towards
        the bone that it moves (a tilt).
        """
        fingers = model.rest_joints[1:].reshape(5, 4, 3)
        bones = np.diff(fingers, axis=1)
        axes = model.axes.reshape(5, 4, 3)
        along = bones[:, [0, 0, 1, 2]]
        twist = np.cross(along, axes)
        twist /= np.linalg.norm(twist, axis=-1, keepdims=True)
        tilt = np.cross(axes, twist)
        neutral = model.mean_angles.reshape(5, 4)
        return Chains(
            model.rest_joints[0],
            model.rest_joints[BASES] - model.rest_joints[0],
            bones,
            axes,
            np.stack([twist, tilt], 2),
            model.thumb_twist,
            model.limits,
            neutral,
            loose,
            strict,
        )

    def constants(self, shared: Array) -> tuple[Array, Array, Array]:
        """Bases (5, 3), bones (5, 3, 3) and unit axes (5, 4, 3) of constants (5, 20)."""
        moved = self._moved_axes(shared)
        return (
            self.base + shared[:, :3],
            self.bones + shared[:, 3:12].reshape(5, 3, 3),
            moved / np.linalg.norm(moved, axis=-1, keepdims=True),
        )

    def shared_of(self, model: HandModel) -> Array:
        """(5, 20) constants of a hand with the same wrist and axes."""
        out = np.zeros((5, SIZE))
        out[:, :3] = model.rest_joints[BASES] - self.wrist - self.base
        bones = np.diff(model.rest_joints[1:].reshape(5, 4, 3), axis=1)
        out[:, 3:AXES] = (bones - self.bones).reshape(5, 9)
        return out

    def _moved_axes(self, shared: Array) -> Array:
        return np.asarray(
            self.axes + np.einsum("fac,facx->fax", shared[:, AXES:].reshape(5, 4, 2), self.charts)
        )

    def points(self, shared: Array, local: Array) -> Array:
        """(T, 5, 4, 3) joints of the fingers, base to tip, for angles (T, 5, 4)."""
        return _fingers(self._placed(shared, local))

    def _placed(self, shared: Array, local: Array) -> Placed:
        """The hand with these constants, its wrist at the origin."""
        from handtrack.kernels.kinematics import place_poses

        base, bones, axes = self.constants(shared)
        rest = np.zeros((N_JOINTS, 3))
        rest[1:] = np.concatenate([base[:, None], bones], 1).cumsum(1).reshape(-1, 3)
        return place_poses(rest, axes.reshape(-1, 3), self.twist, local.reshape(len(local), -1))

    def linearised(self, shared: Array, local: Array) -> tuple[Array, Array, Array]:
        """Points, and their derivatives (T, 5, 4, 3, 4) by angles and (..., 20) by constants."""
        placed = self._placed(shared, local)
        points, n = _fingers(placed), len(local)
        turned = placed.parts[:, 1:].reshape(n, 5, 3, 3, 3)
        turning = placed.axes.reshape(n, 5, 4, 3)
        axes = self.constants(shared)[2]
        by_angle = np.zeros((n, 5, 4, 3, 4))
        by_shared = np.zeros((n, 5, 4, 3, SIZE))
        by_shared[..., :3] = np.eye(3)
        for i in range(3):
            by_shared[:, :, i + 1 :, :, 3 + 3 * i : 6 + 3 * i] = turned[:, :, None, i]
        # what has turned each axis, and the ways that it can move
        unturned = np.broadcast_to(np.eye(3), (n, 5, 3, 3))
        before = (unturned, about_axis(axes[:, 0], local[..., 0]), turned[:, :, 0], turned[:, :, 1])
        charts = self._charts(shared)
        for a in range(4):
            joint = max(a - 1, 0)
            q = points[:, :, joint + 1 :] - points[:, :, joint : joint + 1]
            by_angle[:, :, joint + 1 :, :, a] = np.cross(turning[:, :, None, a], q)
            turn = _turn_by_axis(axes[:, a], local[..., a], charts[:, a])
            turn = (before[a] @ turn).swapaxes(-1, -2)
            moved = np.cross(turn[:, :, None], q[..., None, :]).swapaxes(-1, -2)
            by_shared[:, :, joint + 1 :, :, AXES + 2 * a : AXES + 2 * a + 2] = moved
        return points, by_angle, by_shared

    def _charts(self, shared: Array) -> Array:
        """(5, 4, 3, 2) how each unit axis moves with its two constants."""
        moved = self._moved_axes(shared)
        length = np.linalg.norm(moved, axis=-1)[..., None, None]
        unit = moved / length[..., 0]
        flat = np.eye(3) - unit[..., :, None] * unit[..., None, :]
        return np.asarray(flat @ self.charts.swapaxes(-1, -2) / length)

    def moved(self, local: Array, step: Array) -> Array:
        """Angles after a step."""
        return local + step

    def pull(self, local: Array) -> tuple[float, Array, Array]:
        """Angles are drawn to the expected ones, and strongly back inside their limits."""
        away = local - self.neutral
        loose = 1.0 / np.square(self.loose)
        flat = local.reshape(-1, 20)
        outside = (flat - self.limits.clamp(flat)).reshape(local.shape)
        strict = 1.0 / self.strict**2
        cost = float((loose * away * away).sum() + strict * np.square(outside).sum())
        return cost, loose * away + strict * outside, loose + strict * (outside != 0)


def _fingers(placed: Placed) -> Array:
    return placed.joints[..., 1:, :].reshape(-1, 5, 4, 3)


def _turn_by_axis(axis: Array, angle: Array, move: Array) -> Array:
    """(T, 5, 3, 2) small turns on the left of exp(axis angle) as the axis moves.

    Turning the axis n by a = n x d makes of R = exp(n phi) exp(a) R exp(-a), that is R after a
    turn by a - R a = sin(phi) d + (1 - cos(phi)) n x d.

    Args:
        axis: (5, 3); angle: (T, 5) [rad]; move: (5, 3, 2) moves d at right angles to the axis.
    """
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.asarray(s * move + (1.0 - c) * np.cross(axis[:, :, None], move, axis=1))
