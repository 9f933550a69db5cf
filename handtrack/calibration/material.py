"""The frames of a clip that a calibration looks at, as joint centres."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import Poses
from handtrack.calibration.noise import smoothed, white_noise
from handtrack.files.long_arrays import evenly, rows_of
from handtrack.fitting import solver
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

MIN_SEEN = 12
"""A frame with fewer joints says too little of the hand's shape."""
MOST = 3000
"""Of a longer clip so many frames are looked at, evenly spread."""
# a frame is a stray where its residual is so many times the median one
_STRAY = 3.0
# and a misfit of this is still the hand that is not found yet [m]
_GOOD = 5e-3


LONG, _PIECE = 16_000, 500
"""Of a clip with more frames than that so many are looked at at all, in pieces evenly spread."""


def excerpt(sequence: Sequence) -> Sequence:
    """The sequence, or of a long one pieces of `_PIECE` frames, `LONG` in all, evenly spread."""
    n = len(sequence)
    if n <= LONG:
        return sequence
    begins = np.linspace(0, n - _PIECE, LONG // _PIECE).astype(np.int64)
    keep = (begins[:, None] + np.arange(_PIECE)).ravel()
    if not np.isfinite(rows_of(sequence.joints, keep)).any():
        return sequence
    return replace(sequence, truth=None).at(keep)


@dataclass(frozen=True, eq=False)
class Material:
    """Joints of a clip that are fit for use.

    Attributes:
        joints: (T, 21, 3) as seen, or with less noise [m]; NaN = missing.
        weights: (T, 21), 0 where missing.
        noise: of the joints as seen, per coordinate [m].
        left: noise of these joints [m].
        dense: no usable frame between was left out.
        time_ns: (T,).
    """

    joints: Array
    weights: Array
    noise: float
    left: float
    dense: bool
    time_ns: NDArray[np.int64]

    @staticmethod
    def of(sequence: Sequence, smooth: bool = True) -> Material:
        """The usable frames of a sequence, at most `MOST`, smoothed if that is wanted."""
        joints, noise = sequence.joints, white_noise(sequence.joints)
        left = noise
        if smooth:
            joints, left = smoothed(sequence.time_ns, joints, noise)
        usable = np.flatnonzero(np.isfinite(joints[..., 0]).sum(1) >= MIN_SEEN)
        keep = evenly(usable, MOST)
        joints = joints[keep]
        weights = np.where(np.isfinite(joints[..., 0]), sequence.confidence[keep], 0.0)
        time_ns = sequence.time_ns[keep]
        return Material(joints, weights, noise, left, len(keep) == len(usable), time_ns)

    def __len__(self) -> int:
        return len(self.joints)

    def fitted(self, model: HandModel) -> solver.Results:
        """The model fitted to all frames."""
        results = solver.Results(len(self), full=False)
        results.run(
            solver.Program(),
            model,
            self.joints.copy(),
            self.weights.copy(),
            solver.start_at(model),
            model.mean_angles,
            alone=not self.dense,
        )
        return results


def sound(results: solver.Results, weights: Array) -> NDArray[np.int64]:
    """Frames that are fitted, and not very much worse than most.

    Args:
        results: fits of all frames.
        weights: (T, 21) of their joints.

    Returns:
        Their indices, increasing.
    """
    spread = results.objective / np.maximum(weights.sum(1), 1e-9)
    good = np.isfinite(spread)
    if good.any():
        good &= spread <= _STRAY**2 * np.median(spread[good]) + _GOOD**2
    return np.flatnonzero(good)


def chosen(results: solver.Results, weights: Array, most: int) -> NDArray[np.int64]:
    """Frames to calibrate from, none of those that fit badly.

    Half of them are those whose poses differ most from each other, which inform most; half
    are evenly spread, since poses that differ most are also those with the worst errors.

    Args:
        results: fits of all frames.
        weights: (T, 21) of their joints.
        most: how many frames at most.

    Returns:
        Their indices, increasing.
    """
    index = sound(results, weights)
    if len(index) <= most:
        return index
    # the pose farthest from all taken so far comes next
    poses = results.angles[index]
    taken = [int(np.square(poses - poses.mean(0)).sum(1).argmin())]
    apart = np.square(poses - poses[taken[0]]).sum(1)
    while len(taken) < most // 2:
        taken.append(int(apart.argmax()))
        apart = np.minimum(apart, np.square(poses - poses[taken[-1]]).sum(1))
    others = np.setdiff1d(np.arange(len(index)), taken)
    even = evenly(others, most - len(taken))
    return np.sort(index[np.concatenate([taken, even])])


def poses_of(model: HandModel, results: solver.Results, index: NDArray[np.int64]) -> Poses:
    """The fitted poses of some frames."""
    rotation = results.roots[index, :9].reshape(-1, 3, 3)
    wrist = results.roots[index, 9:] + rotation @ model.rest_joints[0]
    return Poses(results.angles[index].reshape(-1, 5, 4).copy(), rotation, wrist)


def centred(model: HandModel, sequence: Sequence) -> Sequence:
    """A sequence with each joint moved from the landmark to the joint, as the fitted hand has it.

    Args:
        model: the hand with its `landmark_offsets`.
        sequence: the landmarks; frames that cannot be fitted lose their joints.
    """
    results = solver.Results(len(sequence), full=False)
    results.run(
        solver.Program(),
        model,
        np.array(sequence.joints),
        np.array(sequence.confidence),
        solver.start_at(model),
        model.mean_angles,
    )
    turned = model.landmarks_from_joints(results.angles, results.roots[:, :9].reshape(-1, 3, 3))
    return replace(sequence, joints=sequence.joints - turned, truth=None)
