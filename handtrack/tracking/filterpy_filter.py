"""The Kalman filter of poses with its prediction and update by filterpy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import N_ANGLES
from handtrack.kernels import filter_loop as kernels
from handtrack.kernels.filter_state import NOTE
from handtrack.kernels.workspace import Records, unfitted
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.kalman import KalmanFilter
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

    def run(self, frames: Frames, kept: Records | None) -> tuple[Records, Records]:
        n = len(frames.raw)
        out, notes = unfitted(n), np.zeros(n, NOTE)
        for t in range(n):
            one = slice(t, t + 1)
            shown = (frames.joints[t], frames.weights[t], frames.raw[one], notes[one])
            self._frame(int(frames.times_ns[t]), shown, out[one], None if kept is None else kept[t])
        return out, notes

    def _frame(
        self, now: int, shown: tuple[Array, Array, Records, Records], out: Records, kept: Any
    ) -> None:
        s: Any = self.state[0]
        with_model, motion = (self.state, *self.with_model), (self.process, self.grid)
        if kernels.before_frame(*with_model, motion, now, *shown):
            self._get(s)
            self._filter.predict(F=_transition(s), Q=_noise(s))
            self._put(s)
        if kept is not None:
            for name in _PREDICTED:
                kept[name] = s[name]
            kept["information"], kept["pull"] = 0.0, 0.0
            kept["prior"] = np.diag(s["pose_pose"])[:N_ANGLES]
            kept["cross"] = np.diag(s["pose_speed"])[:N_ANGLES]
            kept["gain"] = 0.0
        if kernels.measure(*with_model, *shown):
            # what is best with the prediction, as if measured without it
            r = np.linalg.inv(s["system"])
            z = s["distance"].copy()
            if self.numbers.coupled:
                z += r @ s["pull"]
            self._get(s)
            self._filter.update(z[:, None], R=r)
            s["distance"] = moved = self._put(s)
            log = -np.linalg.slogdet(s["pose_pose"])[1]
            if not self.numbers.coupled:
                # as in `kalman.update`
                log += z @ s["precision"] @ (moved - z)
            shown[3]["likelihood"] -= 0.5 * log
            if kept is not None:
                kept["information"] = self._filter.SI
                kept["pull"] = self._filter.SI @ z
                taken = kept["prior"] - np.diag(s["pose_pose"])[:N_ANGLES]
                kept["gain"] = np.maximum(taken, 0.0) / kept["prior"] ** 2
        kernels.after_frame(*with_model, motion, shown[2], out, shown[3])

    def _get(self, s: Any) -> None:
        """Give filterpy the state, as it counts it."""
        self._filter.x = np.concatenate([np.zeros(N_POSE), s["velocity"]])[:, None]
        cross = s["pose_speed"]
        self._filter.P = np.block([[s["pose_pose"], cross], [cross.T, s["speed_speed"]]])

    def _put(self, s: Any) -> Array:
        """Take filterpy's state over; returns by how much the pose moved."""
        moved = self._filter.x[:, 0]
        kernels.shift_pose(self.state, moved[_POSE].copy())
        s["velocity"] = moved[_SPEED]
        # filterpy lets rounding make its covariance less symmetric with every frame
        covariance = 0.5 * (self._filter.P + self._filter.P.T)
        s["pose_pose"], s["pose_speed"] = covariance[_POSE, _POSE], covariance[_POSE, _SPEED]
        s["speed_speed"] = covariance[_SPEED, _SPEED]
        return np.asarray(moved[_POSE])


_MOTION = ("f01", "f11", "q00", "q01", "q11")
_PREDICTED = (*_MOTION, "angles", "rotation", "translation", "pose_pose", "pose_speed")


def _transition(s: Any) -> Array:
    f01, f11 = np.diag(s["f01"]), np.diag(s["f11"])
    return np.block([[np.eye(N_POSE), f01], [np.zeros((N_POSE, N_POSE)), f11]])


def _noise(s: Any) -> Array:
    q00, q01, q11 = (np.diag(s["density"] * s[name]) for name in ("q00", "q01", "q11"))
    return np.block([[q00, q01], [q01, q11]])
