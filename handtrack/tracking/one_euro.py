"""The One-Euro filter of poses (Casiez, Roussel and Vogel 2012)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_quaternion, matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES
from handtrack.kernels import frame_loop as rows
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

_ANGLES = slice(rows.OUT_ANGLES, rows.OUT_ROOT)
_TURN = slice(rows.OUT_ROOT, rows.OUT_SHIFT)
_SHIFT = slice(rows.OUT_SHIFT, rows.OUT_QUATERNION)
_QUATERNION = slice(rows.OUT_QUATERNION, rows.OUT_JOINTS)
_JOINTS = slice(rows.OUT_JOINTS, rows.OUT_OBJECTIVE)


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
        self._raw, self._row = np.empty(rows.OUT_SIZE), np.empty(rows.OUT_SIZE)
        self._speed = np.zeros(N_POSE)

    def advance(self, frames: Frames) -> Steadied:
        """As `KalmanFilter.advance`."""
        times_ns, raw = frames.times_ns, frames.raw
        out, known = np.full_like(raw, np.nan), np.zeros(len(raw), dtype=np.bool_)
        for t, row in enumerate(raw):
            since = int(times_ns[t]) - self._fitted_ns
            if self._known and since > self._coast_ns:
                self._known = False
            if row[rows.OUT_ANEW] > 0.0:
                self._known = False
            if not np.isnan(row[rows.OUT_NOISE]):
                self._take(row, since * 1e-9)
                self._fitted_ns = int(times_ns[t])
            if self._known:
                out[t], known[t] = self._row, True
        return out, known

    def finish(self) -> Steadied:
        """As `KalmanFilter.finish`."""
        self.reset()
        return np.empty((0, rows.OUT_SIZE)), np.empty(0, dtype=np.bool_)

    def _take(self, row: Array, dt: float) -> None:
        if not self._known:
            self._raw, self._row = row.copy(), row.copy()
            self._speed = np.zeros(N_POSE)
            self._known = True
            return
        speed = _step(self._raw, row) / dt
        self._speed += _share(SPEED_CUTOFF, dt) * (speed - self._speed)
        share = _share(CUTOFF + BETA * np.abs(self._speed), dt)
        step = share * _step(self._row, row)
        new = self._row.copy()
        new[_ANGLES] = self._model.limits.clamp(new[_ANGLES] + step[:N_ANGLES])
        turn = vector_to_matrix(step[N_ANGLES : N_ANGLES + 3]) @ new[_TURN].reshape(3, 3)
        new[_TURN] = turn.ravel()
        new[_SHIFT] += step[N_ANGLES + 3 :]
        new[_QUATERNION] = matrix_to_quaternion(turn)
        new[_JOINTS] = self._model.joints(new[_ANGLES], turn, new[_SHIFT]).ravel()
        self._raw, self._row = row.copy(), new


def _step(before: Array, after: Array) -> Array:
    """(26,) from one row's pose to another's: angles, turn of the world on the left, shift."""
    a, b = before[_TURN].reshape(3, 3), after[_TURN].reshape(3, 3)
    turn = matrix_to_vector(b @ a.T)
    return np.concatenate([after[_ANGLES] - before[_ANGLES], turn, after[_SHIFT] - before[_SHIFT]])


def _share(cutoff: Array | float, dt: float) -> Array:
    """What a new sample makes up in exponential smoothing: 1 / (1 + tau / dt)."""
    return np.asarray(1.0 / (1.0 + 1.0 / (2.0 * np.pi * np.asarray(cutoff) * dt)))
