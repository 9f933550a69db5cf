"""Filters that wait for the frames after: with a fixed lag, and over the whole sequence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.kernels import motion_evidence as motion
from handtrack.kernels.filter_state import NOTE, NOTHING
from handtrack.kernels.joint_noise import LEAST_NOISE
from handtrack.kernels.workspace import UNFITTED, unfitted
from handtrack.tracking import process_noise
from handtrack.tracking.filter_input import Frames, LongFrames
from handtrack.tracking.kalman import DriftingFilter, KalmanFilter, Steadied, none_final
from handtrack.tracking.process_noise import N_POSE, lasting_share
from handtrack.tracking.settings import TrackerSettings

Array = NDArray[np.float64]

# frames that are smoothed at once, and those after them that are looked at as well [frames]
_WINDOW, _BEYOND = 1024, 256
# for how long a smoother that follows the motion's noise remembers it [s]
_FORGET_S = 0.5
# stretches that the motion's noise is learnt from, and their length [frames]
_STRETCHES, _STRETCH = 3, 300


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
        notes = self._kalman.run(frames, kept[len(self._kept) :])[1]
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
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._kalman.reset()
        self._inputs = LongFrames()

    def advance(self, frames: Frames) -> Steadied:
        """As `KalmanFilter.advance`; no frame is final."""
        self._inputs.append(frames)
        return none_final()

    def finish(self) -> Steadied:
        """As `KalmanFilter.finish`."""
        parts = [none_final(), *self.rest()]
        if len(parts) == 2:
            return parts[1]
        out, known = (np.concatenate(x) for x in zip(*parts, strict=True))
        return out, known

    def rest(self) -> Iterator[Steadied]:
        """As `finish`, a window at a time."""
        inputs = self._inputs
        if not len(inputs):
            return
        kalman, forget_s, share = self._white, self._white.numbers.forget_s, 0.0
        if (drifting := self._drifting) is not None:
            share, moving = lasting_share(inputs, drifting.numbers.lasts_s)
            if share > 0.0:
                kalman, forget_s = drifting, _FORGET_S
        self._kalman, given, process = kalman, kalman.numbers, kalman.process
        shown, noise = inputs.column("noise"), given.noise
        if not noise and np.isfinite(shown).any():
            noise = max(float(np.nanmedian(shown)), LEAST_NOISE)
        follow = self._learn and share > 0.0
        reached = _within_reach(inputs.times_ns, np.isfinite(shown), given.coast_ns)
        learnt: dict[str, Any] = {"noise": noise, "follow": int(follow), "forget_s": forget_s}
        if drifting is not None and kalman is drifting:
            learnt |= {"share": share, "moving": 1.0 if drifting.landmarks else moving}
        try:
            kalman.numbers = given._replace(coast_ns=2 * given.coast_ns, **learnt)
            if self._learn and not follow:
                kalman.process = process_noise.process(self._learnt(inputs))
            done = 0
            for out, known in self._smoothed(inputs):
                known &= reached[done : done + len(known)]
                done += len(known)
                out[~known] = UNFITTED
                yield out, known
        finally:
            # as new, whatever stopped it (Ctrl-C, no memory)
            kalman.numbers, kalman.process = given, process
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
            self._kalman.process = process_noise.process(climber.density)
            likelihood, evidence = 0.0, np.zeros((2, N_POSE))
            for begin in begins:
                self._kalman.reset()
                part = inputs.part(slice(int(begin), int(begin) + _STRETCH))
                notes = self._kalman.run(part, kept)[1]
                motion.add_evidence(notes, kept[: len(notes)], work, evidence)
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
                notes[place] = kalman.run(given.part(place), kept[place])[1]
                if b == last:
                    at_last = kalman.state.copy()
            out = unfitted(last - begin)
            kalman.smooth(*kalman.with_model, 0, last - begin, notes, kept[: end - begin], out)
            kalman.state = at_last
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
