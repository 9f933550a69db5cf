"""Kalman filters of poses: causal, with a fixed lag, and over the whole sequence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.fitting import solver
from handtrack.fitting.settings import LOSSES
from handtrack.hand.model import HandModel
from handtrack.kernels import drift_loop, drift_smoother, filter_loop, smoother
from handtrack.kernels import evidence as motion
from handtrack.kernels.covariance import information
from handtrack.kernels.filter_state import (
    DRIFTING,
    FILTER,
    KEPT,
    KEPT_DRIFTING,
    NOTE,
    NOTHING,
    FilterNumbers,
)
from handtrack.kernels.kalman import LEAST_NOISE
from handtrack.kernels.workspace import RESULT, UNFITTED, Records, unfitted
from handtrack.tracking import process_noise
from handtrack.tracking.filter_input import Frames, LongFrames
from handtrack.tracking.process_noise import LASTS_S, N_POSE, lasting_share
from handtrack.tracking.settings import TrackerSettings

Array = NDArray[np.float64]
Steadied = tuple[Records, NDArray[np.bool_]]
"""Poses, quaternions and joints of n frames, UNFITTED where nothing is known; and which are."""

# what a new frame makes up of the running noise of the joints, at least
_NOISE_GAIN = 0.02
# frames that are smoothed at once, and those after them that are looked at as well [frames]
_WINDOW, _BEYOND = 1024, 256
# for how long a smoother that follows the motion's noise remembers it [s]
_FORGET_S = 0.5
# stretches that the motion's noise is learnt from, and their length [frames]
_STRETCHES, _STRETCH = 3, 300


class KalmanFilter:
    """Filters poses frame by frame: each result is of the frame itself.

    The state holds 26 pose numbers (angles, a small turn of the world on the left of the
    rotation, translation) and their velocities, with their full covariance. The turn's reference
    is moved along, so that there is no wrap-around. A frame is measured with the information of
    its joints, the Gauss-Newton Hessian (26 x 26) over the joints' noise: what was seen poorly is
    trusted less. Coupled, its pose is the one that fits the joints and the prediction best,
    under the limits (maximum a posteriori); else it is the raw fit.
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
        self._settings = FilterNumbers(
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
        self._process = process_noise.process(density)
        self._grid = process_noise.tried()
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._state = np.zeros(1, self.record)

    def advance(self, frames: Frames) -> Steadied:
        """Take in the next frames.

        Args:
            frames: with their raw fits.

        Returns:
            rows like them of the frames whose pose is final, in order, UNFITTED where nothing
            is known; and which of them are known.
        """
        out, notes = self._run(frames, None)
        return out, notes["kind"] != NOTHING

    def finish(self) -> Steadied:
        """The frames that are still to come; the filter is as new then."""
        self.reset()
        return _no_frames()

    def rest(self) -> Iterator[Steadied]:
        """As `finish`, some frames at a time."""
        yield self.finish()

    @property
    def with_model(self) -> tuple[Any, int, tuple[Any, ...]]:
        """What every compiled function takes of the filter: hand, solver, FilterNumbers."""
        return self._hand, information.address, tuple(self._settings)

    def _run(self, frames: Frames, kept: Records | None) -> tuple[Records, Records]:
        """Rows (T,) and notes (T,), as `filter_frames` has them."""
        n = len(frames.raw)
        out, notes = unfitted(n), np.zeros(n, NOTE)
        self._filter(
            self._state,
            *self.with_model,
            (self._process, self._grid),
            *frames,
            out,
            notes,
            int(kept is not None),
            np.zeros(0, self.kept) if kept is None else kept,
        )
        return out, notes


class DriftingFilter(KalmanFilter):
    """As `KalmanFilter`, where some of the joints' noise lasts (see `kernels.drift`).

    Attributes:
        share: of the noise, how much lasts; negative to follow it.
        moving: what part of the residuals is not their mean; negative to follow it.
        landmarks: whether the hand has landmarks that are no joints.
        lasts_s: for how long, to 1/e [s].
        corrected: whether a profile corrects the joints, and nobody has said their noise.
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
        self.corrected = corrected and not settings.fit.noise_m2
        said = settings.filter.noise_colour
        # landmarks that are no joints: what they are off by turns with the fingers
        self.landmarks = model.has_landmarks
        self.share, self.moving = -1.0, 1.0 if self.landmarks else -1.0
        self.lasts_s = LASTS_S if isinstance(said, str) else float(said)

    @property
    def with_model(self) -> tuple[Any, int, tuple[Any, ...]]:
        """As `KalmanFilter`."""
        settings = self._settings._replace(
            share=self.share,
            moving=self.moving,
            lasts_s=self.lasts_s,
            corrected=int(self.corrected),
        )
        return self._hand, information.address, tuple(settings)


def _no_frames() -> Steadied:
    return np.empty(0, RESULT), np.empty(0, dtype=np.bool_)


class FixedLagFilter:
    """A Kalman filter whose results are smoothed by the frames after them: they come later."""

    def __init__(self, kalman: KalmanFilter, lag: int):
        """Args:
        kalman: the filter.
        lag: how many frames later the results come.
        """
        self._kalman, self.lag = kalman, lag
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._kalman.reset()
        self._kept, self._notes = np.zeros(0, self._kalman.kept), np.zeros(0, NOTE)

    def advance(self, frames: Frames) -> Steadied:
        """As `KalmanFilter.advance`."""
        kept = np.concatenate([self._kept, np.zeros(len(frames.raw), self._kalman.kept)])
        notes = self._kalman._run(frames, kept[len(self._kept) :])[1]
        notes = np.concatenate([self._notes, notes])
        ready = max(len(notes) - self.lag, 0)
        out = unfitted(ready)
        self._kalman.smooth_lagged(*self._kalman.with_model, self.lag, notes, kept, out)
        self._kept, self._notes = kept[ready:], notes[ready:]
        return out, notes["kind"][:ready] != NOTHING

    def finish(self) -> Steadied:
        """As `KalmanFilter.finish`."""
        notes, kept = self._notes, self._kept
        out = unfitted(len(notes))
        self._kalman.smooth(*self._kalman.with_model, 0, len(notes), notes, kept, out)
        self.reset()
        return out, notes["kind"] != NOTHING

    def rest(self) -> Iterator[Steadied]:
        """As `finish`, some frames at a time."""
        yield self.finish()


class Smoother:
    """Rauch, Tung and Striebel's smoother: results come when the sequence is finished.

    The joints' noise, and the motion's unless it is given, are learnt from the whole sequence;
    where noise lasts, the motion's is followed: one for all frames would take bursts of noise
    for motion.
    A gap is bridged from both its sides: it may last twice as long as a filter coasts. Long
    sequences are smoothed in windows that look far beyond their end.
    """

    def __init__(
        self,
        kalman: KalmanFilter,
        settings: TrackerSettings,
        drifting: DriftingFilter | None = None,
    ):
        """Args:
        kalman: the filter.
        settings: how to track.
        drifting: the filter where the joints' noise lasts; None to take it for white.
        """
        self._white, self._drifting = kalman, drifting
        self._kalman, self._learn = kalman, settings.filter.process_noise == "auto"
        self._process, self._settings = kalman._process, kalman._settings
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._kalman.reset()
        self._inputs = LongFrames()

    def advance(self, frames: Frames) -> Steadied:
        """As `KalmanFilter.advance`; no frame is final."""
        self._inputs.append(frames)
        return _no_frames()

    def finish(self) -> Steadied:
        """As `KalmanFilter.finish`."""
        parts = [_no_frames(), *self.rest()]
        if len(parts) == 2:
            return parts[1]
        out, known = (np.concatenate(x) for x in zip(*parts, strict=True))
        return out, known

    def rest(self) -> Iterator[Steadied]:
        """As `finish`, a window at a time."""
        inputs = self._inputs
        if not len(inputs):
            return
        settings = self._settings
        noise, forget_s = settings.noise, settings.forget_s
        shown = inputs.column("noise")
        if not noise and np.isfinite(shown).any():
            noise = max(float(np.nanmedian(shown)), LEAST_NOISE)
        share = 0.0
        if self._drifting is not None:
            share, moving = lasting_share(inputs, self._drifting.lasts_s)
            self._drifting.share = share
            if not self._drifting.landmarks:
                self._drifting.moving = moving
        follow = self._learn and share > 0.0
        if self._drifting is not None and share > 0.0:
            self._kalman, forget_s = self._drifting, _FORGET_S
        kalman = self._kalman
        reached = _within_reach(inputs.times_ns, np.isfinite(shown), settings.coast_ns)
        try:
            kalman._settings = settings._replace(
                follow=int(follow), noise=noise, coast_ns=2 * settings.coast_ns, forget_s=forget_s
            )
            if self._learn and not follow:
                kalman._process = process_noise.process(self._learnt(inputs))
            done = 0
            for out, known in self._smoothed(inputs):
                known &= reached[done : done + len(known)]
                done += len(known)
                out[~known] = UNFITTED
                yield out, known
        finally:
            # as new, whatever stopped it (Ctrl-C, no memory)
            kalman._process, kalman._settings = self._process, self._settings
            self.reset()
            self._kalman = self._white

    def _learnt(self, inputs: LongFrames) -> Array:
        """(26,) densities that make stretches of the sequence the likeliest."""
        n = len(inputs)
        count = min(_STRETCHES, -(-n // _STRETCH))
        begins = np.linspace(0, max(n - _STRETCH, 0), count).astype(int)
        climber, work = process_noise.Climber(), np.zeros((motion.MATRICES, N_POSE, N_POSE))
        kept = np.zeros(min(n, _STRETCH), self._kalman.kept)
        while True:
            self._kalman._process = process_noise.process(climber.density)
            likelihood, evidence = 0.0, np.zeros((2, N_POSE))
            for begin in begins:
                self._kalman.reset()
                part = inputs.part(slice(int(begin), int(begin) + _STRETCH))
                notes = self._kalman._run(part, kept)[1]
                motion.motion_evidence(notes, kept[: len(notes)], work, evidence)
                likelihood += float(notes["likelihood"].sum())
            if not climber.step(likelihood, evidence):
                return climber.best

    def _smoothed(self, inputs: LongFrames) -> Iterator[Steadied]:
        n = len(inputs)
        kalman = self._kalman
        kalman.reset()
        kept = np.zeros(min(n, _WINDOW + _BEYOND), kalman.kept)
        for begin in range(0, n, _WINDOW):
            last, end = min(begin + _WINDOW, n), min(begin + _WINDOW + _BEYOND, n)
            notes, given = np.empty(end - begin, NOTE), inputs.part(slice(begin, end))
            for a, b in ((begin, last), (last, end)):
                place = slice(a - begin, b - begin)
                notes[place] = kalman._run(given.part(place), kept[place])[1]
                if b == last:
                    at_last = kalman._state.copy()
            out = unfitted(last - begin)
            kalman.smooth(*kalman.with_model, 0, last - begin, notes, kept[: end - begin], out)
            kalman._state = at_last
            yield out, notes["kind"][: last - begin] != NOTHING


def _within_reach(
    times_ns: NDArray[np.int64], fits: NDArray[np.bool_], coast_ns: int
) -> NDArray[np.bool_]:
    """(T,) which frames a smoother may speak of: in a gap between fits that it bridges, or no
    longer after the last fit than a filter coasts."""
    fitted = np.flatnonzero(fits)
    if not fitted.size:
        return np.zeros(len(times_ns), dtype=np.bool_)
    after = np.cumsum(fits)
    last = times_ns[fitted[np.maximum(after - 1, 0)]]
    following = times_ns[fitted[np.minimum(after, fitted.size - 1)]]
    bridged = (after < fitted.size) & (following - last <= 2 * coast_ns)
    return np.asarray((after > 0) & (bridged | (times_ns - last <= coast_ns)))
