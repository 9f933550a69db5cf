"""Sparse bundle adjustment: constants of a hand together with its pose in every frame.

Unknowns are the hand's constants, and for each frame the root's rigid transform and the local
unknowns of five fingers. A finger's joints depend on its own constants and unknowns and on the
root alone, so every frame's normal equations are an arrowhead: the local unknowns are
eliminated finger by finger, then the root frame by frame, and what remains is one small dense
system for the constants. All of it is batched over frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import vector_to_matrix

Array = NDArray[np.float64]

# Levenberg-Marquardt: first damping, and its factors after a good and a bad step
_DAMPING = 1e-4
_EASE, _TIGHTEN = 0.2, 8.0
_HOPELESS = 1e8
# curvature of what nothing observes [1/m^2]: keeps it in place
_TRACE = 1e-3


class Hand(Protocol):
    """A parametrised hand in its root frame: constants (5, S), unknowns of T frames."""

    def points(self, shared: Array, local: Array) -> Array:
        """(T, 5, 4, 3) joints of the fingers, base to tip [m]."""

    def linearised(self, shared: Array, local: Array) -> tuple[Array, Array, Array]:
        """The points, and how they move: (T, 5, 4, 3), (T, 5, 4, 3, L), (T, 5, 4, 3, S)."""

    def moved(self, local: Array, step: Array) -> Array:
        """The unknowns after a step (T, 5, L)."""

    def pull(self, local: Array) -> tuple[float, Array, Array]:
        """Prior of the unknowns: cost, half its gradient and a curvature, (T, 5, L) each."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of T frames.

    Attributes:
        local: (T, 5, ...) unknowns of the fingers, as the hand has them.
        rotation: (T, 3, 3) root to world.
        translation: (T, 3) of the wrist [m].
    """

    local: Array
    rotation: Array
    translation: Array


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames that are to be explained, and by what.

    The hand's constants are `origin` + `basis` @ free, where `free` (n,) is common to all clips
    that are solved together. With n = 0 the constants are kept.

    Attributes:
        hand: the parametrised hand.
        targets: (T, 21, 3) joints in the world [m]; any finite value where missing.
        weights: (T, 21), 0 where missing.
        origin: (5, S).
        basis: (5 S, n).
        noise: standard deviation of the joints per coordinate [m].
        spread: distance at which the robust loss (Geman-McClure) bends [m]; inf for squares.
        worth: how much the clip counts against the prior of the constants, in 0..1: less than 1
            where its frames' errors are related.
    """

    hand: Hand
    targets: Array
    weights: Array
    origin: Array
    basis: Array
    noise: float
    spread: float = np.inf
    worth: float = 1.0

    def shared(self, free: Array) -> Array:
        """(5, S) the constants."""
        return np.asarray(self.origin + (self.basis @ free).reshape(self.origin.shape))

    def distances(self, free: Array, poses: Poses) -> Array:
        """(T, 21) distance of each joint to its target [m]."""
        return np.asarray(np.linalg.norm(self._residual(free, poses), axis=-1))

    def _residual(self, free: Array, poses: Poses) -> Array:
        """(T, 21, 3) model minus target, in the root frame."""
        return with_wrist(self.hand.points(self.shared(free), poses.local)) - self._seen(poses)

    def _seen(self, poses: Poses) -> Array:
        """The targets in the root frame."""
        return np.asarray((self.targets - poses.translation[:, None]) @ poses.rotation)

    def _cost(self, free: Array, poses: Poses) -> float:
        d2 = np.square(self._residual(free, poses)).sum(-1)
        s2 = self.spread**2
        data = float((self.weights * (d2 if np.isinf(s2) else s2 * d2 / (s2 + d2))).sum())
        return self.worth * (data / self.noise**2 + self.hand.pull(poses.local)[0])


@dataclass(frozen=True, eq=False)
class Solution:
    """An optimum.

    Attributes:
        free: (n,) how far the constants are moved.
        poses: of the frames of each clip.
        cost: value of the objective, in units of the noise.
        steps: steps taken.
        information: (n, n) what the data say of `free` [1/unit^2], poses eliminated, prior
            left out.
        variance: (T, 5, L) of the local unknowns of all clips, constants given.
    """

    free: Array
    poses: list[Poses]
    cost: float
    steps: int
    information: Array
    variance: Array


def solve(
    clips: Sequence[Clip],
    precision: Array,
    free: Array,
    poses: Sequence[Poses],
    max_steps: int = 50,
    tolerance: float = 1e-4,
) -> Solution:
    """Minimise the weighted (robust) squared distances plus the priors.

    Levenberg-Marquardt on iteratively reweighted squares; every step taken lowers the cost.

    Args:
        clips: what to explain.
        precision: (n, n) prior of the constants' moves, about zero [1/unit^2].
        free, poses: where to start.
        max_steps: steps tried at most.
        tolerance: stop when a step lowers the cost by less than this share.
    """

    def cost_of(free: Array, poses: Sequence[Poses]) -> float:
        parts = [clip._cost(free, p) for clip, p in zip(clips, poses, strict=True)]
        return float(sum(parts) + free @ precision @ free)

    poses = list(poses)
    cost = cost_of(free, poses)
    damping, steps = _DAMPING, 0
    systems = _systems(clips, free, poses)
    for _ in range(max_steps):
        trial, moved = _step(systems, precision, free, damping)
        lower = cost_of(trial, moved)
        if not lower < cost:
            damping = max(damping, 1e-6) * _TIGHTEN
            if damping > _HOPELESS:
                break
            continue
        gain, cost = cost - lower, lower
        free, poses = trial, moved
        systems = _systems(clips, free, poses)
        damping *= _EASE
        steps += 1
        if gain <= tolerance * cost:
            break
    information = sum((s.reduced(0.0).matrix for s in systems), np.zeros_like(precision))
    variance = np.concatenate([s.variance() for s in systems])
    return Solution(free, poses, cost, steps, information, variance)


def _systems(clips: Sequence[Clip], free: Array, poses: Sequence[Poses]) -> list[_System]:
    return [_System.of(clip, free, p) for clip, p in zip(clips, poses, strict=True)]


def _step(
    systems: list[_System], precision: Array, free: Array, damping: float
) -> tuple[Array, list[Poses]]:
    """Constants and poses after one damped step."""
    parts = [system.reduced(damping) for system in systems]
    matrix = sum((p.matrix for p in parts), np.zeros_like(precision))
    slope = sum((p.slope for p in parts), precision @ free)
    # nothing holds a constant that no joint shows and that has no prior
    matrix[np.diag_indices_from(matrix)] += damping * np.diagonal(matrix) + _TRACE
    change = np.asarray(-np.linalg.solve(matrix + precision, slope))
    return free + change, [s.moved(p, change) for s, p in zip(systems, parts, strict=True)]


@dataclass(frozen=True, eq=False)
class _Reduced:
    """A clip's normal equations without its poses.

    Attributes:
        matrix: (n, n); slope: (n,).
        gain: (T, 5, L, 7 + S) how local unknowns answer the root, the constants, the residual.
        reply: (T, 6, 5 S + 1) how the root answers the constants and the residual.
    """

    matrix: Array
    slope: Array
    gain: Array
    reply: Array


@dataclass(frozen=True, eq=False)
class _System:
    """A clip's linearised residuals, in units of the noise, weighted.

    Attributes:
        finger: (T, 5, 12, 6 + S + 1) by root and constants, and the residual.
        local: (T, 5, 12, L) by local unknowns.
        wrist: (T, 3, 7) by root, and the residual.
    """

    clip: Clip
    free: Array
    poses: Poses
    finger: Array
    local: Array
    wrist: Array

    @staticmethod
    def of(clip: Clip, free: Array, poses: Poses) -> _System:
        points, by_local, by_shared = clip.hand.linearised(clip.shared(free), poses.local)
        n, size = len(points), by_shared.shape[-1]
        residual = with_wrist(points) - clip._seen(poses)
        weights = clip.weights
        if np.isfinite(clip.spread):
            s2 = clip.spread**2
            weights = weights * np.square(s2 / (s2 + np.square(residual).sum(-1)))
        root = np.sqrt(clip.worth * weights) / clip.noise
        w = root[:, 1:].reshape(n, 5, 4, 1, 1)
        finger = np.empty((n, 5, 4, 3, 6 + size + 1))
        finger[..., :3] = turning(points)
        finger[..., 3:6] = np.eye(3)
        finger[..., 6:-1] = by_shared
        finger[..., -1] = residual[:, 1:].reshape(n, 5, 4, 3)
        finger *= w
        # the wrist is the root's origin: turning does not move it
        wrist = np.zeros((n, 3, 7))
        wrist[..., 3:6] = np.eye(3)
        wrist[..., 6] = residual[:, 0]
        wrist *= root[:, 0, None, None]
        local = (by_local * w).reshape(n, 5, 12, -1)
        return _System(clip, free, poses, finger.reshape(n, 5, 12, -1), local, wrist)

    def reduced(self, damping: float) -> _Reduced:
        """Local unknowns and root eliminated."""
        _, slope, curvature = self.clip.hand.pull(self.poses.local)
        slope, curvature = self.clip.worth * slope, self.clip.worth * curvature
        hll = _transposed(self.local) @ self.local
        k = np.arange(hll.shape[-1])
        hll[..., k, k] = hll[..., k, k] * (1.0 + damping) + curvature + _TRACE
        right = _transposed(self.local) @ self.finger
        right[..., -1] += slope
        gain = np.asarray(np.linalg.solve(hll, right))
        g = _transposed(self.finger) @ self.finger - _transposed(right) @ gain
        n, size = len(g), g.shape[-1] - 7
        wrist = _transposed(self.wrist) @ self.wrist
        hrr = g[..., :6, :6].sum(1) + wrist[:, :6, :6]
        d = np.arange(6)
        hrr[:, d, d] = hrr[:, d, d] * (1.0 + damping) + _TRACE
        cross = np.empty((n, 6, 5 * size + 1))
        cross[..., :-1] = g[:, :, :6, 6:-1].swapaxes(1, 2).reshape(n, 6, 5 * size)
        cross[..., -1] = g[..., :6, -1].sum(1) + wrist[:, :6, 6]
        reply = np.asarray(np.linalg.solve(hrr, cross))
        taken = cross.reshape(n * 6, -1)[:, :-1].T @ reply.reshape(n * 6, -1)
        hss, gs = -taken[:, :-1], -taken[:, -1]
        own = g[..., 6:-1, 6:].sum(0)
        for f in range(5):
            part = slice(f * size, (f + 1) * size)
            hss[part, part] += own[f, :, :-1]
            gs[part] += own[f, :, -1]
        m = self.clip.basis
        return _Reduced(m.T @ hss @ m, m.T @ gs, gain, reply)

    def variance(self) -> Array:
        """(T, 5, L) of the local unknowns, constants known; strays count as all joints do."""
        plain = _System.of(replace(self.clip, spread=np.inf, worth=1.0), self.free, self.poses)
        finger, local = plain.finger[..., :6], plain.local
        hll = _transposed(local) @ local
        k = np.arange(hll.shape[-1])
        hll[..., k, k] += _TRACE
        inverse = np.linalg.inv(hll)
        gain = inverse @ (_transposed(local) @ finger)
        wrist = plain.wrist[..., :6]
        root = (_transposed(finger) @ (finger - local @ gain)).sum(1) + _transposed(wrist) @ wrist
        root[:, np.arange(6), np.arange(6)] += _TRACE
        spread = gain @ np.linalg.inv(root)[:, None]
        return np.asarray(inverse[..., k, k] + (spread * gain).sum(-1))

    def moved(self, reduced: _Reduced, change: Array) -> Poses:
        """The poses that go with a change (n,) of the constants."""
        poses, (n, size) = self.poses, (len(self.local), self.finger.shape[-1] - 7)
        shared = self.clip.basis @ change
        turn = -(reduced.reply[..., :-1] @ shared) - reduced.reply[..., -1]
        moves = np.ones((n, 5, 7 + size))
        moves[..., :6] = turn[:, None]
        moves[..., 6:-1] = shared.reshape(5, size)
        local = -(reduced.gain @ moves[..., None])[..., 0]
        return Poses(
            self.clip.hand.moved(poses.local, local),
            poses.rotation @ vector_to_matrix(turn[:, :3]),
            poses.translation + (poses.rotation @ turn[:, 3:, None])[..., 0],
        )


def with_wrist(points: Array) -> Array:
    """(T, 21, 3) all joints, from those of the fingers (T, 5, 4, 3); the wrist is the origin."""
    out = np.zeros((len(points), 21, 3))
    out[:, 1:] = points.reshape(len(points), 20, 3)
    return out


def turning(points: Array) -> Array:
    """(..., 3, 3) matrices M with M w = w x point."""
    out = np.zeros((*points.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = points[..., 2], -points[..., 1]
    out[..., 1, 0], out[..., 1, 2] = -points[..., 2], points[..., 0]
    out[..., 2, 0], out[..., 2, 1] = points[..., 1], -points[..., 0]
    return out


def _transposed(a: Array) -> Array:
    return a.swapaxes(-1, -2)
