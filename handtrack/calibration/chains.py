"""The hand's chains with free constants: bases, bones and axes, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import turning
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import BASES

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

    def _moved_axes(self, shared: Array) -> Array:
        return np.asarray(
            self.axes + np.einsum("fac,facx->fax", shared[:, AXES:].reshape(5, 4, 2), self.charts)
        )

    def points(self, shared: Array, local: Array) -> Array:
        """(T, 5, 4, 3) joints of the fingers, base to tip, for angles (T, 5, 4)."""
        return self._chain(shared, local)[0]

    def _chain(self, shared: Array, local: Array) -> tuple[Array, ...]:
        base, bones, axes = self.constants(shared)
        single = about_axis(axes, local)
        saddle = single[..., 0, :, :] @ single[..., 1, :, :]
        if self.twist:
            bone = bones[0, 0] / np.linalg.norm(bones[0, 0])
            saddle[:, 0] = saddle[:, 0] @ about_axis(bone, self.twist * local[:, 0, 1])
        first = saddle @ single[..., 2, :, :]
        second = first @ single[..., 3, :, :]
        turned = np.stack([saddle, first, second], 2)
        points = np.empty((*local.shape[:2], 4, 3))
        points[..., 0, :] = base
        points[..., 1:, :] = np.einsum("tfixy,fiy->tfix", turned, bones)
        return points.cumsum(2), single, turned, axes, bones

    def linearised(self, shared: Array, local: Array) -> tuple[Array, Array, Array]:
        """Points, and their derivatives (T, 5, 4, 3, 4) by angles and (..., 20) by constants."""
        points, single, turned, axes, bones = self._chain(shared, local)
        saddle, first = turned[:, :, 0], turned[:, :, 1]
        n = len(points)
        by_angle = np.zeros((n, 5, 4, 3, 4))
        by_shared = np.zeros((n, 5, 4, 3, SIZE))
        by_shared[..., :3] = np.eye(3)
        for i in range(3):
            by_shared[:, :, i + 1 :, :, 3 + 3 * i : 6 + 3 * i] = turned[:, :, None, i]
        # each axis where the rotations before it have brought it, and the joint it passes
        before = (None, single[:, :, 0], saddle, first)
        charts = self._charts(shared)
        for a in range(4):
            joint = max(a - 1, 0)
            q = points[:, :, joint + 1 :] - points[:, :, joint : joint + 1]
            outer = before[a]
            axis = np.broadcast_to(axes[:, a], (n, 5, 3))
            if outer is not None:
                axis = np.einsum("tfxy,tfy->tfx", outer, axis)
                q_in = q @ outer
            else:
                q_in = q
            speed = axis
            if a == 1 and self.twist:
                bone = bones[0, 0] / np.linalg.norm(bones[0, 0])
                speed = axis.copy()
                speed[:, 0] += self.twist * (saddle[:, 0] @ bone)
            by_angle[:, :, joint + 1 :, :, a] = np.cross(speed[:, :, None], q)
            # v is what the axis turns, before it turns it
            v = np.einsum("tfyx,tfjy->tfjx", single[:, :, a], q_in)
            moved = _by_axis(axes[:, a], local[..., a], v) @ charts[None, :, None, a]
            if outer is not None:
                moved = outer[:, :, None] @ moved
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


def _by_axis(axis: Array, angle: Array, v: Array) -> Array:
    """(T, 5, J, 3, 3) derivative of exp(axis angle) v by the axis (Rodrigues' formula).

    Args:
        axis: (5, 3); angle: (T, 5) [rad]; v: (T, 5, J, 3).
    """
    c = 1.0 - np.cos(angle)[..., None, None, None]
    s = np.sin(angle)[..., None, None, None]
    n = np.broadcast_to(axis[:, None], v.shape)
    along = (n * v).sum(-1)[..., None, None]
    outer = n[..., :, None] * v[..., None, :]
    return np.asarray(s * turning(v) + c * (along * np.eye(3) + outer))
