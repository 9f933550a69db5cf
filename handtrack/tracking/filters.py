"""Filters that steady poses over time. They sit outside the fit's loop.

A filter sees one measured pose per frame with its covariance, and gives a filtered one. The
26 numbers of a pose are ordered: 20 angles, rotation (as a turn in the world, on the left of
the rotation matrix), translation.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.hand.limits import Limits
from handtrack.hand.rotations import matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES

Array = NDArray[np.float64]

FILTERS = ("none", "kalman")

# standard deviation of the acceleration that the hand is expected to have
ANGLE_ACCELERATION = 40.0  # rad/s^2, a finger
TURN_ACCELERATION = 20.0  # rad/s^2, the whole hand
TRANSLATION_ACCELERATION = 5.0  # m/s^2

_N = N_ANGLES + 6
_TURN = slice(N_ANGLES, N_ANGLES + 3)
_SHIFT = slice(N_ANGLES + 3, _N)


class Pose(NamedTuple):
    """angles (20,) [rad], rotation (3, 3) root to world, translation (3,) [m]."""

    angles: Array
    rotation: Array
    translation: Array


class PoseFilter(Protocol):
    """What every filter does, frame by frame."""

    def reset(self) -> None:
        """Forget everything."""

    def step(self, dt: float, pose: Pose | None, covariance: Array | None) -> Pose | None:
        """Advance by dt [s] and take in a measured pose, if there is one.

        Args:
            dt: time since the last step [s]; of no meaning in the first step.
            pose: as fitted, or None where nothing was.
            covariance: (26, 26) of the measured pose.

        Returns:
            The filtered pose; the predicted one where none was measured; None where the
            filter knows nothing yet.
        """


class NoFilter:
    """Passes poses through and predicts nothing."""

    def reset(self) -> None: ...

    def step(self, dt: float, pose: Pose | None, covariance: Array | None) -> Pose | None:
        return pose


class KalmanPoseFilter:
    """Constant velocity for the angles and for the root, by filterpy.

    The state holds the 26 pose numbers and their velocities. The rotation's part of it is a
    small turn away from a reference that is moved along after each step, so there is no
    wrap-around. Filtered angles are brought back inside the limits.
    """

    def __init__(self, limits: Limits, process_noise: float = 1.0):
        """Args:
        limits: of the angles.
        process_noise: factor on the expected accelerations.

        Raises:
            SettingsError: the factor is not positive and finite.
        """
        if not 0 < process_noise < np.inf:
            raise SettingsError(f"process noise is {process_noise}, expected a positive number")
        self._limits = limits
        acceleration = np.empty(_N)
        acceleration[:N_ANGLES] = ANGLE_ACCELERATION
        acceleration[_TURN] = TURN_ACCELERATION
        acceleration[_SHIFT] = TRANSLATION_ACCELERATION
        self._spread = (process_noise * acceleration) ** 2
        self._h = np.hstack([np.eye(_N), np.zeros((_N, _N))])
        self._kf: Any = None
        self._reference = np.eye(3)

    def reset(self) -> None:
        self._kf = None

    def step(self, dt: float, pose: Pose | None, covariance: Array | None) -> Pose | None:
        if self._kf is None:
            if pose is None or covariance is None:
                return None
            return self._begin(pose, covariance)
        kf = self._kf
        kf.predict(F=self._transition(dt), Q=self._process(dt))
        self._rebase()
        if pose is not None and covariance is not None:
            z = np.empty((_N, 1))
            z[:N_ANGLES, 0] = pose.angles
            z[_TURN, 0] = matrix_to_vector(pose.rotation @ self._reference.T)
            z[_SHIFT, 0] = pose.translation
            # what nothing observes is not measured
            known = np.flatnonzero(np.isfinite(np.diagonal(covariance)))
            kf.update(z[known], R=covariance[np.ix_(known, known)], H=self._h[known])
            self._rebase()
        return self._pose()

    def _begin(self, pose: Pose, covariance: Array) -> Pose:
        from filterpy.kalman import KalmanFilter  # 1.3 s to import

        kf = KalmanFilter(dim_x=2 * _N, dim_z=_N)
        kf.x[:N_ANGLES, 0] = pose.angles
        kf.x[_SHIFT, 0] = pose.translation
        known = np.isfinite(np.diagonal(covariance))
        kf.P[:_N, :_N] = np.where(known & known[:, None], covariance, np.eye(_N))
        # the velocity may be whatever a quarter of a second of acceleration gives
        kf.P[_N:, _N:] = np.diag(self._spread) * 0.25**2
        self._reference = pose.rotation.copy()
        self._kf = kf
        return pose

    def _pose(self) -> Pose:
        x = self._kf.x[:, 0]
        return Pose(self._limits.clamp(x[:N_ANGLES]), self._reference.copy(), x[_SHIFT].copy())

    def _rebase(self) -> None:
        """Move the turn that the state holds into the reference."""
        x = self._kf.x
        self._reference = vector_to_matrix(x[_TURN, 0]) @ self._reference
        x[_TURN] = 0.0

    @staticmethod
    def _transition(dt: float) -> Array:
        f = np.eye(2 * _N)
        f[np.arange(_N), np.arange(_N) + _N] = dt
        return f

    def _process(self, dt: float) -> Array:
        """White noise in the acceleration, integrated over the step."""
        i = np.arange(_N)
        q = np.zeros((2 * _N, 2 * _N))
        q[i, i] = self._spread * dt**4 / 4
        q[i, i + _N] = q[i + _N, i] = self._spread * dt**3 / 2
        q[i + _N, i + _N] = self._spread * dt**2
        return q


def make_filter(name: str, limits: Limits, process_noise: float = 1.0) -> PoseFilter:
    """The filter of that name.

    Raises:
        SettingsError: there is none; the message lists those there are.
    """
    if name == "none":
        return NoFilter()
    if name == "kalman":
        return KalmanPoseFilter(limits, process_noise)
    raise SettingsError(f"filter {name!r} is unknown, expected one of {', '.join(FILTERS)}")
