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

from handtrack.fitting import bcd, frames, lanes
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Point = tuple[float, float, float]
Place = tuple[Point, Point]
"""The wrist, and a point before it where the fingertips of a flat hand are [m]."""
_REACH_M = 0.15

REJECTED = lanes.UNDERDETERMINED + 1
"""State of a frame that was fitted but is not believed; the other states are in `lanes`."""

# Distances in metres or in multiples of the usual noise (deviation per coordinate), whichever is
# more. A joint that the fit leaves further off than the first is looked at, one that is
# further off than the second from a fit without it is an outlier.
_LOOK_M, _LOOK = 0.030, 3.3
_OUTLIER_M, _OUTLIER = 0.065, 6.0
# more outliers in a frame than this, and it is no matter of single joints
_MOST = 5
# noise of a frame that is too much: by itself, and if the hand would also have jumped
_BAD_M, _BAD = 0.012, 3.0
_JUMPY_M, _JUMPY = 0.006, 1.5
# a jump: more than a hand does in most sequences; and more than any hand can
_STEP_M, _SPEED = 0.02, 0.8
_FAR_M, _IMPOSSIBLE = 0.10, 12.0
# the noise before anything is known [m], and what a frame makes up of it later on
_FIRST_NOISE_M, _GAIN = 0.010, 0.03
# a share of the cost at which another pose is another basin
_BETTER = 0.5
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


PLAIN = Verdict(np.zeros(N_JOINTS, dtype=np.bool_))
PLAIN.rejected.flags.writeable = False


class Gate:
    """Fits frames, and decides what of them is to be believed. It remembers what is usual."""

    def __init__(self, program: bcd.Program, model: HandModel, min_joints: int, patience_s: float):
        """Args:
        program, model, min_joints: how frames are fitted.
        patience_s: after so long without a frame to believe, they are taken as they are [s].
        """
        self._program, self._model, self._min_joints = program, model, min_joints
        self._patience_ns = int(patience_s * 1e9)
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._noise, self._frames = _FIRST_NOISE_M, 1
        # where the hand was when a frame was last believed
        self._place: Place | None = None
        self._time_ns = 0
        # since when no frame was believed
        self._doubt_ns: int | None = None
        # how many frames are fitted before they are looked at
        self._stretch = _LONGEST

    def run(
        self,
        results: bcd.Results,
        times_ns: list[int] | tuple[int, ...],
        observed: Array,
        w: Array,
        keep: Array,
    ) -> list[Verdict]:
        """Fit frames, each from the one before; as `Results.run`, with doubts.

        Args:
            results: of T frames, overwritten. A frame that is not believed has the state REJECTED
                and else the values of one that was not fitted.
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
            some = results.part(part)
            before = keep.copy()
            some.run(
                self._program,
                self._model,
                observed[part],
                w[part],
                keep,
                self._model.mean_angles,
                self._min_joints,
            )
            i = self._first_doubtful(some, times_ns[part])
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
        self, results: bcd.Results, times_ns: list[int] | tuple[int, ...]
    ) -> int | None:
        """The first frame to be looked at; those before it are taken as believed."""
        rows = results.rows[:, frames.OUT_OBJECTIVE : frames.OUT_STATE].tolist()
        worst, roots = results.worst.tolist(), results.roots.tolist()
        for t, (objective, _, seen) in enumerate(rows):
            if math.isnan(objective):
                continue
            noise, place = _noise(objective, seen), _place(roots[t])
            if worst[t] > self._look or self._too_noisy(noise, place, times_ns[t]) is not None:
                return t
            self._believe(noise, place, times_ns[t])
        return None

    def _believe(self, noise: float, place: Place, time_ns: int) -> None:
        self._frames += 1
        self._noise += max(1.0 / self._frames, _GAIN) * (noise - self._noise)
        self._place, self._time_ns = place, time_ns
        self._doubt_ns = None

    def _too_noisy(self, noise: float, place: Place, time_ns: int) -> str | None:
        """Why a frame with this noise and this place of the hand is not to be believed."""
        usual = f"fit error {1e3 * noise:.0f} mm, usually {1e3 * self._noise:.0f} mm"
        if noise > max(_BAD_M, _BAD * self._noise):
            return usual
        if self._place is None or time_ns - self._time_ns > self._patience_ns:
            return None
        dt = 1e-9 * (time_ns - self._time_ns)
        moved = _moved(place, self._place)
        jumped = f"jump of {1e3 * moved:.0f} mm in {1e3 * dt:.0f} ms"
        if moved > _FAR_M + _IMPOSSIBLE * dt:
            return jumped
        if moved > _STEP_M + _SPEED * dt and noise > max(_JUMPY_M, _JUMPY * self._noise):
            return f"{jumped}, {usual}"
        return None

    def _resolve(
        self, results: bcd.Results, t: int, time_ns: int, observed: Array, w: Array, keep: Array
    ) -> Verdict:
        """Fit a doubtful frame as it should be, or reject it; keep is what was before it."""
        full = len(results.covariance) > 0
        first, cold = keep, keep.copy()
        cold[frames.MEMORY] = min(cold[frames.MEMORY], frames.LOST)
        was_fitted = keep[frames.MEMORY] == frames.FITTED
        # perhaps the pose before is in the wrong basin: from the mean pose as well, with all
        # joints, as leaving some out could explain that away
        anew = was_fitted and self._better(observed, w, cold, float(results.objective[t]))
        if anew:
            first = cold
        best = self._weeded(observed, w, first, full)
        why = self._too_noisy(best.noise, best.place, time_ns)
        if was_fitted and not anew and (why is not None or best.worst > self._look):
            other = self._weeded(observed, w, cold, full)
            if other.objective < _BETTER * best.objective:
                best, anew = other, True
                why = self._too_noisy(best.noise, best.place, time_ns)
        reason = best.reason
        if anew:
            reason = _joined("another pose fits better: found anew", reason)
        if why is not None:
            # what fits as usual, and was not there the frame before, may be anywhere
            usual = best.noise <= max(_JUMPY_M, _JUMPY * self._noise)
            lost = keep[frames.MEMORY] < frames.FITTED
            patient = self._doubt_ns is None or time_ns - self._doubt_ns < self._patience_ns
            if patient and not (usual and lost):
                self._doubt_ns = time_ns if self._doubt_ns is None else self._doubt_ns
                keep[frames.MEMORY] = min(keep[frames.MEMORY], frames.LOST)
                _reject(results, t)
                w[:] = 0.0
                return Verdict(PLAIN.rejected, f"rejected: {why}")
            anew = True
            if not usual:
                # from now on this is how it is
                self._noise, self._frames = best.noise, 1
            reason = _joined(f"found anew: {why}", reason)
        results.rows[t] = best.results.rows[0]
        if full:
            results.covariance[t] = best.results.covariance[0]
        results.rows[t, frames.OUT_ANEW] = float(anew)
        w[:], keep[:] = best.w, best.keep
        self._believe(best.noise, best.place, time_ns)
        return Verdict(best.rejected, reason, anew)

    def _better(self, observed: Array, w: Array, cold: Array, objective: float) -> bool:
        """Whether a cold start of a frame is in a better basin than a fit with this objective."""
        return self._fit(observed, w, cold, False).objective < _BETTER * objective

    @property
    def _look(self) -> float:
        return max(_LOOK_M, _LOOK * self._noise)

    def _weeded(self, observed: Array, w: Array, keep: Array, full: bool) -> _Fitted:
        """The fit without the joints that are outliers.

        Joints are taken away from the worst on, and come back where the fit without them, or
        the last one, has them near.
        """
        outlier = max(_OUTLIER_M, _OUTLIER * self._noise)
        used = w.copy()
        best = first = self._fit(observed, used, keep, full)
        cleared = w <= 0.0
        off: dict[int, float] = {}
        while True:
            distance = np.where(cleared | (used <= 0.0), 0.0, best.distance(observed))
            j = int(distance.argmax())
            if distance[j] <= self._look:
                break
            if len(off) == _MOST or (used > 0.0).sum() <= self._min_joints:
                # it is not a matter of single joints
                return first
            used[j] = 0.0
            without = self._fit(observed, used, keep, full)
            innovation = float(without.distance(observed)[j])
            if innovation > outlier:
                off[j], best = innovation, without
            else:
                used[j], cleared[j] = w[j], True
        last = best.distance(observed)
        back = [j for j in off if last[j] <= outlier]
        if back:
            used[back] = w[back]
            best = self._fit(observed, used, keep, full)
        rejected = np.zeros(N_JOINTS, dtype=np.bool_)
        rejected[[j for j in off if j not in back]] = True
        texts = [
            f"{JOINT_NAMES[j]} rejected, {1e3 * off[j]:.0f} mm off"
            for j in sorted(off)
            if rejected[j]
        ]
        return best._replace(rejected=rejected, reason=", ".join(texts))

    def _fit(self, observed: Array, w: Array, keep: Array, full: bool) -> _Fitted:
        results, kept = bcd.Results(1, full), keep.copy()
        targets, weights = observed[None].copy(), w[None].copy()
        start, least = self._model.mean_angles, self._min_joints
        results.run(self._program, self._model, targets, weights, kept, start, least)
        return _Fitted(results, weights[0], kept)


class _Fitted(NamedTuple):
    """A way to fit a frame: results of one frame, weights used, and what is kept after it."""

    results: bcd.Results
    w: Array
    keep: Array
    rejected: Mask = PLAIN.rejected
    reason: str = ""

    @property
    def objective(self) -> float:
        return float(self.results.objective[0])

    @property
    def noise(self) -> float:
        return _noise(self.objective, float(self.results.rows[0, frames.OUT_SEEN]))

    @property
    def worst(self) -> float:
        return float(self.results.worst[0])

    @property
    def place(self) -> Place:
        return _place(self.results.roots[0].tolist())

    def distance(self, observed: Array) -> Array:
        """(21,) of the joints seen to their fitted ones [m]; 0 where missing."""
        off = self.results.joints[0] - observed
        squared = (off * off).sum(-1)
        return np.sqrt(np.where(squared >= 0.0, squared, 0.0))


def _place(root: list[float]) -> Place:
    """Where a hand is, from its rotation (9,) and translation (3,)."""
    wrist = root[9], root[10], root[11]
    x, y, z = root[0], root[3], root[6]
    return wrist, (wrist[0] + _REACH_M * x, wrist[1] + _REACH_M * y, wrist[2] + _REACH_M * z)


def _moved(a: Place, b: Place) -> float:
    """About how far a hand's joints have moved [m], but for their own bending."""
    wrist = math.dist(a[0], b[0])
    return max(wrist, 0.5 * (wrist + math.dist(a[1], b[1])))


def _noise(objective: float, seen: float) -> float:
    """Deviation of the joints per coordinate [m] that a fit's residual shows.

    Few joints do not have 26 unknowns to explain them away: each leaves one at least.
    """
    return math.sqrt(objective / max(3.0 * seen - bcd.N_POSE, seen))


def _joined(*texts: str) -> str:
    return "; ".join(text for text in texts if text)


def _reject(results: bcd.Results, t: int) -> None:
    """Make frame t one that was not fitted."""
    row = results.rows[t]
    seen = row[frames.OUT_SEEN]
    row[:] = np.nan
    row[frames.OUT_VARIANCE : frames.OUT_WORST] = np.inf
    row[frames.OUT_SEEN], row[frames.OUT_STATE] = seen, REJECTED
    row[frames.OUT_SWEEPS] = row[frames.OUT_STEPS] = row[frames.OUT_ANEW] = 0.0


def _forget_after(results: bcd.Results, last: int, before: Array, keep: Array) -> None:
    """Make keep what it was after frame `last` of the results (-1: before them)."""
    keep[:] = before
    fitted = np.flatnonzero(~np.isnan(results.objective[: last + 1]))
    if fitted.size:
        row = results.rows[fitted[-1]]
        keep[: frames.KEEP_ROOT] = row[frames.OUT_ANGLES : frames.OUT_ROOT]
        keep[frames.KEEP_ROOT : frames.MEMORY] = row[frames.OUT_ROOT : frames.OUT_QUATERNION]
        keep[frames.MEMORY] = frames.FITTED
    if last >= 0 and (not fitted.size or fitted[-1] < last):
        keep[frames.MEMORY] = min(keep[frames.MEMORY], frames.LOST)
