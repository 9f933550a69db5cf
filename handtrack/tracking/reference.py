"""The Kalman filter of poses with its prediction and update by filterpy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.fitting.frames import OUT_SIZE
from handtrack.fitting.information import information
from handtrack.tracking import kalman_kernel as kernels
from handtrack.tracking import process_kernel as rows
from handtrack.tracking.kalman import Frames, KalmanFilter, Kept
from handtrack.tracking.process_noise import N_POSE

Array = NDArray[np.float64]

_MEASURED = np.hstack([np.eye(N_POSE), np.zeros((N_POSE, N_POSE))])
_POSE, _SPEED = slice(0, N_POSE), slice(N_POSE, 2 * N_POSE)


class FilterPyFilter(KalmanFilter):
    """As `KalmanFilter`, many times slower; for comparison.

    The state that filterpy sees is the distance from the reference pose, and the velocities.
    """

    def reset(self) -> None:
        from filterpy.kalman import KalmanFilter as FilterPy  # 1.3 s to import

        super().reset()
        self._filter: Any = FilterPy(dim_x=2 * N_POSE, dim_z=N_POSE)
        self._filter.H = _MEASURED

    def _run(self, frames: Frames, kept: Kept | None) -> tuple[Array, Array]:
        n = len(frames.raw)
        out, notes = np.full((n, OUT_SIZE), np.nan), np.zeros((n, 3))
        for t in range(n):
            shown = (frames.joints[t], frames.weights[t], frames.raw[t], notes[t])
            arrays = None if kept is None else tuple(a[t] for a in kept.arrays)
            self._frame(int(frames.times_ns[t]), shown, out[t], arrays)
        return out, notes

    def _frame(
        self,
        now: int,
        shown: tuple[Array, Array, Array, Array],
        out: Array,
        kept: tuple[Array, ...] | None,
    ) -> None:
        x, _, p, v = self._state[:4]
        with_model = (self._state, information.address, self._settings)
        motion = (self._process, self._grid)
        if kernels.before_frame(*with_model, *motion, now, *shown):
            self._get(x, p)
            self._filter.predict(F=_transition(v), Q=_noise(v))
            self._put(x, p)
        if kept is not None:
            transition, pose, prior, _, _ = kept
            transition[:] = v[rows.F01 : rows.Q11 + 1]
            pose[:] = x[: rows.VELOCITY]
            prior[0], prior[1] = p[kernels.A], p[kernels.B]
            kept[3][:], kept[4][:] = 0.0, 0.0
        if kernels.measure(*with_model, *shown):
            # what is best with the prediction, as if measured without it
            r = np.linalg.inv(p[kernels.S])
            z = v[rows.D].copy()
            if self._settings[0]:
                z += r @ v[rows.LD]
            self._get(x, p)
            self._filter.update(z[:, None], R=r)
            v[rows.D] = moved = self._put(x, p)
            log = -np.linalg.slogdet(p[kernels.A])[1]
            if not self._settings[0]:
                # as in `kalman_kernel.update`
                log += z @ p[kernels.LAMBDA] @ (moved - z)
            shown[3][kernels.LIKELIHOOD] -= 0.5 * log
            if kept is not None:
                kept[3][:] = self._filter.SI
                kept[4][:] = self._filter.SI @ z
        kernels.after_frame(*with_model, *motion, shown[2], out, shown[3])

    def _get(self, x: Array, p: Array) -> None:
        """Give filterpy the state, as it counts it."""
        self._filter.x = np.concatenate([np.zeros(N_POSE), x[rows.VELOCITY :][:N_POSE]])[:, None]
        a, b, c = p[kernels.A], p[kernels.B], p[kernels.C]
        self._filter.P = np.block([[a, b], [b.T, c]])

    def _put(self, x: Array, p: Array) -> Array:
        """Take filterpy's state over; returns by how much the pose moved."""
        moved = self._filter.x[:, 0]
        kernels.shift_pose(x, moved[_POSE].copy())
        x[rows.VELOCITY :][:N_POSE] = moved[_SPEED]
        # filterpy lets rounding make its covariance less symmetric with every frame
        covariance = 0.5 * (self._filter.P + self._filter.P.T)
        p[kernels.A], p[kernels.B] = covariance[_POSE, _POSE], covariance[_POSE, _SPEED]
        p[kernels.C] = covariance[_SPEED, _SPEED]
        return np.asarray(moved[_POSE])


def _transition(v: Array) -> Array:
    f01, f11 = np.diag(v[rows.F01]), np.diag(v[rows.F11])
    return np.block([[np.eye(N_POSE), f01], [np.zeros((N_POSE, N_POSE)), f11]])


def _noise(v: Array) -> Array:
    q00, q01, q11 = (np.diag(v[rows.SPREAD] * v[row]) for row in (rows.Q00, rows.Q01, rows.Q11))
    return np.block([[q00, q01], [q01, q11]])
