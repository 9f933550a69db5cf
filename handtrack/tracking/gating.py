"""Which joints and which frames to believe.

A detector that errs errs by much: one joint is 0.1 to 0.3 m off for a frame, or the whole hand
has the wrong depth, and so the wrong size. What gives it away is the fit: a hand with constant
bones cannot follow. Where a fit leaves a joint far off, the frame is fitted again without that
joint, from the pose before; a joint that then lies far from where the hand puts it is an outlier
(this is its innovation, with the other joints' help: fast motion of the whole hand does not count
against it). Where the joints as a whole fit badly, and more so if the hand would have jumped,
the frame is not used at all. Frames without doubt cost nothing but a few comparisons.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.fitting import solver
from handtrack.fitting.result import N_POSE
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.kernels import workspace
from handtrack.kernels.workspace import Records
from handtrack.tracking.outliers import NONE, Attempt, Mask, Weeder, known_lengths
from handtrack.tracking.settings import TrackerSettings

Array = NDArray[np.float64]
Point = tuple[float, float, float]
Place = tuple[Point, Point]
"""The wrist, and a point before it where the fingertips of a flat hand are [m]."""
REJECTED = workspace.UNDERDETERMINED + 1
"""State of a frame that was fitted but is not believed; the others are in `kernels.workspace`."""

# Distances in metres or in multiples of the usual noise (deviation per coordinate), whichever is
# more. A joint that the fit leaves further off than the first is looked at, one that is
# further off than the second from a fit without it is an outlier.
_LOOK_M, _LOOK = 0.030, 3.3
_OUTLIER_M, _OUTLIER = 0.065, 6.0
# noise of a frame that is too much: by itself, and if the hand would also have jumped
_BAD_M, _BAD = 0.012, 3.0
_JUMPY_M, _JUMPY = 0.006, 1.5
# a jump: more than a hand does in most sequences; and more than any hand can
_STEP_M, _SPEED = 0.02, 0.8
_FAR_M, _IMPOSSIBLE = 0.10, 12.0
# what a joint may move by itself while the hand is not fitted [m/s]
_JOINT_SPEED = 3.0
# doubts in a frame
_NOT, _BADLY, _TOO_FAST, _JUMPED_BADLY = range(4)
# the noise before anything is known [m], and what a frame makes up of it later on
_FIRST_NOISE_M, _GAIN = 0.010, 0.03
# a share of the cost at which another pose is another basin
_BETTER = 0.5
# how far the fingertips of a flat hand are from its wrist [m]
_REACH_M = 0.15
# frames that are fitted at once: few where doubts are frequent, as those after one are in vain
_SHORTEST, _LONGEST = 4, 256


class Verdict(NamedTuple):
    """What is to be said of a frame that is not plainly fitted.

    Attributes:
        rejected: (21,) joints that were seen and not used.
        reason: what was done and why, "" for nothing.
        restart: whether the hand was found anew, so that its motion so far means nothing.
    """

    rejected: Mask
    reason: str = ""
    restart: bool = False


PLAIN = Verdict(NONE)


class Gate:
    """Fits frames, and decides what of them is to be believed. It remembers what is usual."""

    def __init__(self, program: solver.Program, model: HandModel, settings: TrackerSettings):
        """Args:
        program, model: how frames are fitted.
        settings: for `min_joints`, and for `coast_s`: after so long without a frame to believe,
            they are taken as they are.
        """
        self._program, self._model, self._min_joints = program, model, settings.min_joints
        self._weeder = Weeder(program, model, settings.min_joints)
        self._patience_ns = settings.coast_ns
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._noise, self._frames = _FIRST_NOISE_M, 1
        # where the hand was when a frame was last believed
        self._last: tuple[solver.Results, int] | None = None
        self._place: Place | None = None
        self._time_ns = 0
        # since when no frame was believed
        self._doubt_ns: int | None = None
        # how many frames are fitted before they are looked at
        self._stretch = _LONGEST

    def run(
        self,
        results: solver.Results,
        times_ns: list[int] | tuple[int, ...],
        observed: Array,
        w: Array,
        keep: Records,
    ) -> list[Verdict]:
        """Fit frames, each from the one before; as `Results.run`, with doubts.

        Args:
            results: of T frames, without covariances, overwritten. A frame that is not believed
                has the state REJECTED and else the values of one that was not fitted.
            times_ns: (T,) [ns].
            observed, w: (T, 21, 3) [m] and (T, 21); missing joints are made clear in them, and
                the weights of rejected joints, and of all joints of rejected frames, become 0.
            keep: as for `Results.run`.

        Raises:
            InputError: as `Results.run`.
        """
        verdicts = [PLAIN] * len(times_ns)
        start = 0
        while start < len(times_ns):
            part = slice(start, start + self._stretch)
            frames_of = (results, times_ns, observed, w)
            if start > 0 or part.stop < len(times_ns):
                frames_of = results.part(part), times_ns[part], observed[part], w[part]
            some, times, joints, weights = frames_of
            before = keep.tobytes()
            mean, least = self._model.mean_angles, self._min_joints
            some.run(self._program, self._model, joints, weights, keep, mean, least)
            i = self._first_doubtful(some, times, joints, weights)
            if i is None:
                start, self._stretch = part.stop, min(2 * self._stretch, _LONGEST)
                continue
            # the frames after it started from a doubtful pose: they are fitted again
            _forget_after(some, i - 1, before, keep)
            t = start + i
            verdicts[t] = self._resolve(results, t, times_ns[t], observed[t], w[t], keep)
            start, self._stretch = t + 1, _SHORTEST
        return verdicts

    def _first_doubtful(
        self,
        results: solver.Results,
        times_ns: list[int] | tuple[int, ...],
        observed: Array,
        w: Array,
    ) -> int | None:
        """The first frame to be looked at; those before it are taken as believed."""
        rows = results.rows
        seen, worst, roots = rows["seen"].tolist(), rows["worst"].tolist(), rows["root"].tolist()
        for t, objective in enumerate(rows["objective"].tolist()):
            if math.isnan(objective):
                if seen[t] > 0 and self._strays(observed[t], w[t], times_ns[t]).any():
                    return t
                continue
            noise, place = _noise_left(objective, seen[t]), _place_of(roots[t])
            if worst[t] > self._look or self._doubt(noise, place, times_ns[t]):
                return t
            self._believe(results, t, noise, place, times_ns[t])
        return None

    def _believe(
        self, results: solver.Results, t: int, noise: float, place: Place, time_ns: int
    ) -> None:
        self._frames += 1
        self._noise += max(1.0 / self._frames, _GAIN) * (noise - self._noise)
        self._last, self._place, self._time_ns = (results, t), place, time_ns
        self._doubt_ns = None

    def _doubt(self, noise: float, place: Place, time_ns: int) -> int:
        """Whether a frame with this noise and this place of the hand is to be believed."""
        if noise > max(_BAD_M, _BAD * self._noise):
            return _BADLY
        if self._place is None or time_ns - self._time_ns > self._patience_ns:
            return _NOT
        dt = 1e-9 * (time_ns - self._time_ns)
        moved = _moved_by(place, self._place)
        if moved > _FAR_M + _IMPOSSIBLE * dt:
            return _TOO_FAST
        if moved > _STEP_M + _SPEED * dt and noise > max(_JUMPY_M, _JUMPY * self._noise):
            return _JUMPED_BADLY
        return _NOT

    def _why(self, doubt: int, noise: float, place: Place, time_ns: int) -> str:
        """A doubt in words."""
        badly = f"fit error {1e3 * noise:.0f} mm, usually {1e3 * self._noise:.0f} mm"
        if doubt == _BADLY or self._place is None:
            return badly
        moved, dt = _moved_by(place, self._place), 1e-9 * (time_ns - self._time_ns)
        jumped = f"jump of {1e3 * moved:.0f} mm in {1e3 * dt:.0f} ms"
        return jumped if doubt == _TOO_FAST else f"{jumped}, {badly}"

    def _strays(self, observed: Array, w: Array, time_ns: int) -> Mask:
        """(21,) which of a few joints, that are not enough for a fit, are where none can be."""
        if self._last is None or time_ns - self._time_ns > self._patience_ns:
            return NONE
        results, t = self._last
        marks = results.part(slice(t, t + 1)).landmarks(self._model)[0]
        distance = known_lengths(observed - marks)
        reach = self._outlier + _JOINT_SPEED * 1e-9 * (time_ns - self._time_ns)
        return np.asarray((w > 0.0) & (distance > reach))

    def _resolve(
        self,
        results: solver.Results,
        t: int,
        time_ns: int,
        observed: Array,
        w: Array,
        keep: Records,
    ) -> Verdict:
        """Fit a doubtful frame as it should be, or reject it; keep is what was before it."""
        if math.isnan(results.objective[t]):
            strays = self._strays(observed, w, time_ns)
            w[strays] = 0.0
            strays.flags.writeable = False
            solver.forget(keep)
            names = ", ".join(JOINT_NAMES[j] for j in np.flatnonzero(strays))
            return Verdict(strays, f"{names} rejected, too far from the last pose")
        first, cold = keep, keep.copy()
        solver.forget(cold)
        was_fitted = keep["memory"][0] == workspace.FITTED
        # perhaps the pose before is in the wrong basin: from the mean pose as well, with all
        # joints, as leaving some out could explain that away
        anew = was_fitted and self._better(observed, w, cold, float(results.objective[t]))
        if anew:
            first = cold
        best = self._weeder.weeded(observed, w, first, self._look, self._outlier)
        noise, place = _standing(best)
        doubt = self._doubt(noise, place, time_ns)
        if was_fitted and not anew and (doubt or best.worst > self._look):
            other = self._weeder.weeded(observed, w, cold, self._look, self._outlier)
            if other.objective < _BETTER * best.objective:
                best, anew = other, True
                noise, place = _standing(best)
                doubt = self._doubt(noise, place, time_ns)
        reason = best.reason
        if anew:
            reason = _joined("another pose fits better: found anew", reason)
        if doubt:
            why = self._why(doubt, noise, place, time_ns)
            # what fits as usual, and was not there the frame before, may be anywhere
            usual = doubt == _TOO_FAST and noise <= max(_JUMPY_M, _JUMPY * self._noise)
            patient = self._doubt_ns is None or time_ns - self._doubt_ns < self._patience_ns
            if patient and not (usual and not was_fitted):
                self._doubt_ns = time_ns if self._doubt_ns is None else self._doubt_ns
                solver.forget(keep)
                _reject(results, t)
                w[:] = 0.0
                return Verdict(NONE, f"rejected: {why}")
            anew = True
            if not usual:
                # from now on this is how it is
                self._noise, self._frames = noise, 1
            reason = _joined(f"found anew: {why}", reason)
        results.rows[t] = best.results.rows[0]
        results.rows["anew"][t] = anew
        w[:], keep[:] = best.w, best.keep
        self._believe(results, t, noise, place, time_ns)
        return Verdict(best.rejected, reason, anew)

    def _better(self, observed: Array, w: Array, cold: Records, objective: float) -> bool:
        """Whether a cold start of a frame is in a better basin than a fit with this objective."""
        return self._weeder.fit(observed, w, cold).objective < _BETTER * objective

    @property
    def _look(self) -> float:
        return max(_LOOK_M, _LOOK * self._noise)

    @property
    def _outlier(self) -> float:
        return max(_OUTLIER_M, _OUTLIER * self._noise)


def _noise_left(objective: float, seen: float) -> float:
    """Deviation of the joints per coordinate [m] that a fit's residual shows.

    Few joints do not have 26 unknowns to explain them away: each leaves one at least.
    """
    return math.sqrt(objective / max(3.0 * seen - N_POSE, seen))


def _place_of(root: list[float]) -> Place:
    """Where a hand is, from its rotation (9,) and translation (3,)."""
    wrist = root[9], root[10], root[11]
    x, y, z = root[0], root[3], root[6]
    return wrist, (wrist[0] + _REACH_M * x, wrist[1] + _REACH_M * y, wrist[2] + _REACH_M * z)


def _moved_by(a: Place, b: Place) -> float:
    """About how far a hand's joints have moved [m], but for their own bending."""
    wrist = math.dist(a[0], b[0])
    return max(wrist, 0.5 * (wrist + math.dist(a[1], b[1])))


def _standing(of: Attempt) -> tuple[float, Place]:
    """The noise that the fit of a frame leaves, and where it has the hand."""
    noise = _noise_left(of.objective, float(of.results.rows["seen"][0]))
    return noise, _place_of(of.results.roots[0].tolist())


def _joined(*texts: str) -> str:
    return "; ".join(text for text in texts if text)


def _reject(results: solver.Results, t: int) -> None:
    """Make frame t one that was not fitted."""
    seen = results.rows["seen"][t]
    results.rows[t] = workspace.UNFITTED
    results.rows["seen"][t], results.rows["state"][t] = seen, REJECTED


def _forget_after(results: solver.Results, last: int, before: bytes, keep: Records) -> None:
    """Make keep what it was after frame `last` of the results (-1: before them)."""
    keep[:] = np.frombuffer(before, keep.dtype)
    fitted = np.flatnonzero(~np.isnan(results.objective[: last + 1]))
    if fitted.size:
        row = results.rows[fitted[-1]]
        keep[0] = row["angles"], row["root"], workspace.FITTED
    if last >= 0 and (not fitted.size or fitted[-1] < last):
        solver.forget(keep)
