"""Kalman filters of poses: with white noise of the joints, and with noise that lasts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.fitting import solver
from handtrack.fitting.settings import LOSSES
from handtrack.hand.model import HandModel
from handtrack.kernels import drift_loop, drift_smoother, filter_loop, smoother
from handtrack.kernels.filter_state import (
    DRIFTING,
    FILTER,
    KEPT,
    KEPT_DRIFTING,
    NOTE,
    NOTHING,
    FilterNumbers,
)
from handtrack.kernels.pose_information import information
from handtrack.kernels.workspace import RESULT, Records, unfitted
from handtrack.tracking import process_noise
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.process_noise import LASTS_S
from handtrack.tracking.settings import TrackerSettings

Array = NDArray[np.float64]
Steadied = tuple[Records, NDArray[np.bool_]]
"""Poses, quaternions and joints of n frames, UNFITTED where nothing is known; and which are."""

# what a new frame makes up of the running noise of the joints, at least
_NOISE_GAIN = 0.02


class KalmanFilter:
    """Filters poses frame by frame: each result is of the frame itself.

    The state holds 26 pose numbers (angles, a small turn of the world on the left of the
    rotation, translation) and their velocities, with their full covariance. The turn's reference
    is moved along, so that there is no wrap-around. A frame is measured with the information of
    its joints, the Gauss-Newton Hessian (26 x 26) over the joints' noise: what was seen poorly is
    trusted less. Coupled, its pose is the one that fits the joints and the prediction best,
    under the limits (maximum a posteriori); else it is the raw fit.

    Attributes:
        numbers: how frames are filtered.
        process, grid: the motion's noise, and factors on it that are tried (see `filter_frames`).
        state: (1,) what is remembered.
    """

    # what holds the state, and what a smoother needs of a frame; the compiled functions
    record, kept = FILTER, KEPT
    _filter = staticmethod(filter_loop.filter_frames)
    smooth = staticmethod(smoother.smooth_frames)
    smooth_lagged = staticmethod(smoother.lag_frames)

    def __init__(self, model: HandModel, settings: TrackerSettings):
        """Args:
        model: the hand.
        settings: how to track: the filter, the fit's noise and loss, and `coast_s`.
        """
        self._hand = solver.constants(model)
        factor = settings.filter.process_noise
        self.numbers = FilterNumbers(
            coupled=int(settings.filter.couple),
            follow=int(factor == "auto"),
            noise=settings.fit.noise_m2,
            gain=_NOISE_GAIN,
            coast_ns=settings.coast_ns,
            forget_s=process_noise.MEMORY_S,
            loss=LOSSES.index(settings.fit.robust),
            spread2=(1e-3 * settings.fit.spread_mm) ** 2,
        )
        density = process_noise.DENSITY if factor == "auto" else process_noise.scaled(factor)
        self.process = process_noise.process(density)
        self.grid = process_noise.tried()
        self._none_kept = np.zeros(0, self.kept)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.state = np.zeros(1, self.record)

    def advance(self, frames: Frames) -> Steadied:
        """Take in the next frames.

        Args:
            frames: with their raw fits.

        Returns:
            rows like them of the frames whose pose is final, in order, UNFITTED where nothing
            is known; and which of them are known.
        """
        out, notes = self.run(frames, None)
        return out, notes["kind"] != NOTHING

    def finish(self) -> Steadied:
        """The frames that are still to come; the filter is as new then."""
        self.reset()
        return none_final()

    def rest(self) -> Iterator[Steadied]:
        """As `finish`, some frames at a time."""
        yield self.finish()

    @property
    def with_model(self) -> tuple[Any, int, tuple[Any, ...]]:
        """What every compiled function takes of the filter: hand, solver, FilterNumbers."""
        return self._hand, information.address, tuple(self.numbers)

    def run(self, frames: Frames, kept: Records | None) -> tuple[Records, Records]:
        """Rows (T,) and notes (T,), as `filter_frames` has them."""
        n = len(frames.raw)
        out, notes = unfitted(n), np.zeros(n, NOTE)
        self._filter(
            self.state,
            *self.with_model,
            (self.process, self.grid),
            *frames,
            out,
            notes,
            int(kept is not None),
            self._none_kept if kept is None else kept,
        )
        return out, notes


class DriftingFilter(KalmanFilter):
    """As `KalmanFilter`, where some of the joints' noise lasts (see `kernels.drift`).

    Attributes:
        landmarks: whether the hand has landmarks that are no joints.
    """

    record, kept = DRIFTING, KEPT_DRIFTING
    _filter = staticmethod(drift_loop.filter_drifting_frames)
    smooth = staticmethod(drift_smoother.smooth_drifting_frames)
    smooth_lagged = staticmethod(drift_smoother.lag_drifting_frames)

    def __init__(self, model: HandModel, settings: TrackerSettings, corrected: bool = False):
        """As `KalmanFilter`.

        Args:
            model, settings: as there.
            corrected: a profile corrects the joints.
        """
        super().__init__(model, settings)
        said = settings.filter.noise_colour
        # landmarks that are no joints: what they are off by turns with the fingers
        self.landmarks = model.has_landmarks
        self.numbers = self.numbers._replace(
            share=-1.0,
            moving=1.0 if self.landmarks else -1.0,
            lasts_s=LASTS_S if isinstance(said, str) else float(said),
            corrected=int(corrected and not settings.fit.noise_m2),
        )


def none_final() -> Steadied:
    """What `advance` returns where no frame is final."""
    return np.empty(0, RESULT), np.empty(0, dtype=np.bool_)
