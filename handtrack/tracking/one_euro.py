"""The One-Euro filter of poses (Casiez, Roussel and Vogel 2012)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_quaternion, matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES
from handtrack.kernels.workspace import RESULT, unfitted
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.kalman import Steadied
from handtrack.tracking.process_noise import N_POSE

Array = NDArray[np.float64]

CUTOFF = np.array([4.0] * N_ANGLES + [6.0] * 6)
"""(26,) least cut-off frequencies of angles, turn and shift [Hz]."""
BETA = np.array([3.0] * N_ANGLES + [10.0] * 3 + [100.0] * 3)
"""(26,) gains by speed [Hz s/rad], [Hz s/m]."""
SPEED_CUTOFF = 1.0
"""Cut-off frequency of the speed [Hz]."""


class OneEuroFilter:
    """Low-pass filters of the pose numbers whose cut-off rises with their speed.

    Each new pose is a step away from the filtered one: of the angles, the turn that is left to
    make, and the shift; a share of it is taken. Where nothing is fitted the pose stays.
    """

    def __init__(self, model: HandModel, coast_s: float):
        """Args:
        model: the hand.
        coast_s: how long to hold a pose where nothing is fitted [s].
        """
        self._model, self._coast_ns = model, int(coast_s * 1e9)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._known = False
        self._fitted_ns = 0
        self._raw: np.void
        self._row: np.void
        self._raw = self._row = np.zeros(1, RESULT)[0]
        self._speed = np.zeros(N_POSE)

    def advance(self, frames: Frames) -> Steadied:
        """As `KalmanFilter.advance`."""
        times_ns, raw = frames.times_ns, frames.raw
        out, known = unfitted(len(raw)), np.zeros(len(raw), dtype=np.bool_)
        for t, row in enumerate(raw):
            since = int(times_ns[t]) - self._fitted_ns
            if self._known and since > self._coast_ns:
                self._known = False
            if row["anew"]:
                self._known = False
            if not np.isnan(row["noise"]):
                self._take(row, since * 1e-9)
                self._fitted_ns = int(times_ns[t])
            if self._known:
                out[t], known[t] = self._row, True
        return out, known

    def finish(self) -> Steadied:
        """As `KalmanFilter.finish`."""
        self.reset()
        return np.empty(0, RESULT), np.empty(0, dtype=np.bool_)

    def rest(self) -> Iterator[Steadied]:
        """As `KalmanFilter.rest`."""
        yield self.finish()

    def _take(self, row: np.void, dt: float) -> None:
        if not self._known:
            self._raw, self._row = row.copy(), row.copy()
            # it knows nothing of how near it is: the raw fit's variances stand
            self._row["variance"] = np.nan
            self._speed = np.zeros(N_POSE)
            self._known = True
            return
        speed = _step(self._raw, row) / dt
        self._speed += _share(SPEED_CUTOFF, dt) * (speed - self._speed)
        share = _share(CUTOFF + BETA * np.abs(self._speed), dt)
        step = share * _step(self._row, row)
        new = self._row.copy()
        angles, turn, shift = _pose(new)
        new["angles"] = self._model.limits.clamp(angles + step[:N_ANGLES])
        turn[:] = vector_to_matrix(step[N_ANGLES : N_ANGLES + 3]) @ turn
        shift += step[N_ANGLES + 3 :]
        new["quaternion"] = matrix_to_quaternion(turn)
        new["joints"] = self._model.joints(angles, turn, shift)
        self._raw, self._row = row.copy(), new


def _pose(row: np.void) -> tuple[Array, Array, Array]:
    """Angles, rotation and translation of a row, as views."""
    root = row["root"]
    return row["angles"], root[:9].reshape(3, 3), root[9:]


def _step(before: np.void, after: np.void) -> Array:
    """(26,) from one row's pose to another's: angles, turn of the world on the left, shift."""
    (angles, turn, shift), (angles_2, turn_2, shift_2) = _pose(before), _pose(after)
    return np.concatenate([angles_2 - angles, matrix_to_vector(turn_2 @ turn.T), shift_2 - shift])


def _share(cutoff: Array | float, dt: float) -> Array:
    """What a new sample makes up in exponential smoothing: 1 / (1 + tau / dt)."""
    return np.asarray(1.0 / (1.0 + 1.0 / (2.0 * np.pi * np.asarray(cutoff) * dt)))
