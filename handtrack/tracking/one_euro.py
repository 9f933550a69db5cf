"""The One-Euro filter of poses (Casiez, Roussel and Vogel 2012)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES
from handtrack.kernels.one_euro import STATE, steady_frames
from handtrack.kernels.workspace import unfitted
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.kalman import Steadied, none_final

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
        limits = model.limits
        self._skeleton = model.rest_joints, model.axes, model.thumb_twist
        self._limits = limits.lower, limits.upper
        self._coast_ns = int(coast_s * 1e9)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._state = np.zeros(1, STATE)

    def advance(self, frames: Frames) -> Steadied:
        """As `KalmanFilter.advance`."""
        out, known = unfitted(len(frames.raw)), np.zeros(len(frames.raw), dtype=np.bool_)
        steady_frames(
            self._state,
            self._skeleton,
            self._limits,
            (CUTOFF, BETA, SPEED_CUTOFF),
            self._coast_ns,
            frames.times_ns,
            frames.raw,
            out,
            known,
        )
        return out, known

    def finish(self) -> Steadied:
        """As `KalmanFilter.finish`."""
        self.reset()
        return none_final()

    def rest(self) -> Iterator[Steadied]:
        """As `KalmanFilter.rest`."""
        yield self.finish()
