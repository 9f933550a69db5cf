"""The tracker: frame by frame, each fit starting from the one before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import __version__
from handtrack.errors import InputError, SettingsError
from handtrack.fitting import bcd
from handtrack.fitting.calibrate import calibrate as calibrate_hand
from handtrack.fitting.calibrate import scale_to
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_quaternion
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.filters import Pose, make_filter
from handtrack.tracking.track import Event, Track

Array = NDArray[np.float64]

MIN_JOINTS = 6
"""A frame with fewer joints is lost: it says too little of the hand."""
COAST_S = 0.3
"""How long a filter may predict frames that cannot be fitted."""

# how much of the noise estimate each new frame makes up
_NOISE_GAIN = 0.1
# no measurement is better than a tenth of a millimetre
_NOISE_FLOOR = 1e-8


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """What the tracker says of one frame; fields as in Track, for a single frame."""

    time_ns: int
    observed: Array
    confidence: Array
    angles_raw: Array
    angles: Array
    quaternion_raw: Array
    quaternion: Array
    translation_raw: Array
    translation: Array
    fitted_joints: Array
    filtered_joints: Array
    angle_variance: Array
    objective: float
    sweeps: int
    status: str
    reason: str


class Tracker:
    """Tracks one hand, one frame at a time.

    Every fit starts from the last raw fit; after frames that were lost it starts again, from
    the mean pose and from the last pose, and keeps the better. The filter sits outside the
    fit's loop. Giving the frames of a sequence one by one is the same as `track`.
    """

    def __init__(
        self,
        model: HandModel,
        filter: str = "none",
        update: bcd.Update = "exact",
        min_joints: int = MIN_JOINTS,
        coast_s: float = COAST_S,
        process_noise: float = 1.0,
    ):
        """Args:
        model: the hand to fit.
        filter: "none" or "kalman".
        update: as in `handtrack.fit`.
        min_joints: a frame with fewer observed joints is not fitted.
        coast_s: how long a filter predicts where nothing is fitted [s].
        process_noise: factor on the accelerations that the filter expects.

        Raises:
            SettingsError: a value makes no sense.
        """
        if update not in bcd.UPDATES:
            raise SettingsError(f"update {update!r} is unknown, expected exact or li2021")
        if not 3 <= min_joints <= N_JOINTS:
            raise SettingsError(f"min_joints is {min_joints}, expected 3..21")
        if not coast_s >= 0:
            raise SettingsError(f"coast_s is {coast_s}, expected at least 0 s")
        self.model = model
        self.settings: dict[str, Any] = {
            "filter": filter,
            "update": update,
            "min_joints": min_joints,
            "coast_s": coast_s,
            "process_noise": process_noise,
        }
        self._filter = make_filter(filter, model.limits, process_noise)
        self.reset()

    def reset(self) -> None:
        """Forget all frames seen, as if the tracker were new."""
        self._filter.reset()
        self._last: bcd.Fit | None = None
        self._warm = False
        self._time_ns: int | None = None
        self._fitted_ns: int | None = None
        self._noise: float | None = None

    def step(
        self, joints: ArrayLike, time_ns: int, confidence: ArrayLike | None = None
    ) -> TrackedFrame:
        """Track the next frame.

        Args:
            joints: (21, 3) in the world [m]; NaN = missing. A frame without any joint is an
                ordinary input.
            time_ns: its time [ns], after the last frame's.
            confidence: (21,) weights in 0..1; 1 by default.

        Returns:
            Poses, errors, status and reason of this frame.

        Raises:
            InputError: wrong shapes or values, or time that does not increase.
        """
        observed = np.array(joints, dtype=np.float64)
        if observed.shape != (N_JOINTS, 3):
            raise InputError(f"joints have shape {observed.shape}, expected (21, 3)")
        time_ns = int(time_ns)
        if self._time_ns is not None and time_ns <= self._time_ns:
            raise InputError(
                f"time does not increase: the last frame was at {self._time_ns * 1e-9:.6f} s,"
                f" this one is at {time_ns * 1e-9:.6f} s"
            )
        w = np.ones(N_JOINTS) if confidence is None else np.array(confidence, dtype=np.float64)
        observed[np.isnan(observed).any(1)] = np.nan
        w[np.isnan(observed[:, 0])] = 0.0
        result, reason = self._fit(observed, w)
        dt = 0.0 if self._time_ns is None else (time_ns - self._time_ns) * 1e-9
        self._time_ns = time_ns
        pose = covariance = None
        if result is not None:
            pose = Pose(result.angles, result.rotation, result.translation)
            self._last, self._warm, self._fitted_ns = result, True, time_ns
            if self.settings["filter"] != "none":
                covariance = self._covariance(result, w)
            status = "fitted"
        elif self._fitted_ns is not None and time_ns - self._fitted_ns <= self._coast_ns:
            self._warm = False
            status = "predicted"
        else:
            self._warm = False
            self._filter.reset()
            status = "lost"
        filtered = self._filter.step(dt, pose, covariance)
        if filtered is None:
            status = "lost"
        return self._frame(time_ns, observed, w, result, filtered, status, reason)

    @property
    def _coast_ns(self) -> int:
        return int(self.settings["coast_s"] * 1e9)

    def _fit(self, observed: Array, w: Array) -> tuple[bcd.Fit | None, str]:
        seen = int((w > 0).sum())
        least = self.settings["min_joints"]
        if seen < least:
            return None, f"{seen} of 21 joints observed, {least} needed"
        update = self.settings["update"]
        starts: list[bcd.Fit | None] = [self._last]
        if not self._warm and self._last is not None:
            starts.append(None)
        fits = [bcd.fit(self.model, observed, start=s, weights=w, update=update) for s in starts]
        best = min(fits, key=lambda f: f.objective)
        if best.status == "underdetermined":
            return None, "the observed joints lie on a line"
        return best, "" if best.status == "converged" else best.status

    def _covariance(self, result: bcd.Fit, w: Array) -> Array:
        """(26, 26) of the fitted pose, at the noise that the residuals of late show."""
        free = max(3 * int((w > 0).sum()) - N_ANGLES - 6, 1)
        noise = max(result.objective / free, _NOISE_FLOOR)
        if self._noise is not None:
            noise = self._noise + _NOISE_GAIN * (noise - self._noise)
        self._noise = noise
        return bcd.covariance(self.model, result, w, noise)

    def _frame(
        self,
        time_ns: int,
        observed: Array,
        w: Array,
        result: bcd.Fit | None,
        filtered: Pose | None,
        status: str,
        reason: str,
    ) -> TrackedFrame:
        nothing = Pose(np.full(N_ANGLES, np.nan), np.full((3, 3), np.nan), np.full(3, np.nan))
        no_joints = np.full((N_JOINTS, 3), np.nan)
        raw = nothing
        if result is not None:
            raw = Pose(result.angles, result.rotation, result.translation)
        pose = nothing if filtered is None else filtered
        q_raw = matrix_to_quaternion(raw.rotation)
        same = pose is raw or filtered is None or self.settings["filter"] == "none"
        return TrackedFrame(
            time_ns=time_ns,
            observed=observed,
            confidence=w,
            angles_raw=raw.angles,
            angles=pose.angles,
            quaternion_raw=q_raw,
            quaternion=q_raw if same else matrix_to_quaternion(pose.rotation),
            translation_raw=raw.translation,
            translation=pose.translation,
            fitted_joints=no_joints if result is None else result.joints,
            filtered_joints=(
                (no_joints if result is None else result.joints)
                if same
                else self.model.joints(*pose)
            ),
            angle_variance=np.full(N_ANGLES, np.inf) if result is None else result.variance,
            objective=float("nan") if result is None else result.objective,
            sweeps=0 if result is None else result.sweeps,
            status=status,
            reason=reason,
        )


def track(
    sequence: Sequence,
    model: HandModel | None = None,
    calibrate: bool = True,
    filter: str = "none",
    update: bcd.Update = "exact",
    min_joints: int = MIN_JOINTS,
    coast_s: float = COAST_S,
    process_noise: float = 1.0,
    progress: Callable[[int], None] | None = None,
) -> Track:
    """Track a whole sequence.

    Args:
        sequence: the joints of one hand.
        model: the hand; the free default hand of the sequence's side if left out.
        calibrate: take bone lengths and palm from the sequence; else the model is only
            scaled to it.
        filter, update, min_joints, coast_s, process_noise: as in `Tracker`.
        progress: called with the number of frames done, after each one.

    Returns:
        The track, with the hand as calibrated.

    Raises:
        InputError: model and sequence are of different hands, or the sequence shows no bone.
        SettingsError: a setting makes no sense.
    """
    if model is None:
        model = HandModel.default(sequence.hand)
    elif model.hand != sequence.hand:
        raise InputError(
            f"the model is a {model.hand} hand, the sequence a {sequence.hand} one",
            sequence.source or None,
        )
    calibration = (calibrate_hand if calibrate else scale_to)(model, sequence)
    tracker = Tracker(calibration.model, filter, update, min_joints, coast_s, process_noise)
    frames = []
    events = [Event(int(sequence.time_ns[0]), "warning", note) for note in sequence.notes]
    before = ""
    for t in range(len(sequence)):
        frame = tracker.step(sequence.joints[t], int(sequence.time_ns[t]), sequence.confidence[t])
        frames.append(frame)
        if frame.status != before:
            level = "info" if frame.status == "fitted" else "warning"
            text = f"{frame.status}: {frame.reason}" if frame.reason else frame.status
            events.append(Event(frame.time_ns, level, text))
            before = frame.status
        if progress is not None:
            progress(t + 1)
    settings = {
        **tracker.settings,
        "calibrate": calibrate,
        "limits": model.limits.name,
        "model": model.name,
    }
    return _assemble(sequence, calibration.model, settings, frames, tuple(events))


def _assemble(
    sequence: Sequence,
    model: HandModel,
    settings: dict[str, Any],
    frames: list[TrackedFrame],
    events: tuple[Event, ...],
) -> Track:
    def stack(name: str) -> Any:
        return np.array([getattr(frame, name) for frame in frames])

    return Track(
        name=sequence.name,
        hand=sequence.hand,
        time_ns=sequence.time_ns,
        frame_index=sequence.frame_index,
        observed=sequence.joints,
        confidence=sequence.confidence,
        truth=sequence.truth,
        **{
            name: stack(name)
            for name in (
                "angles_raw",
                "angles",
                "quaternion_raw",
                "quaternion",
                "translation_raw",
                "translation",
                "fitted_joints",
                "filtered_joints",
                "angle_variance",
                "objective",
                "sweeps",
                "status",
                "reason",
            )
        },
        model=model,
        settings=settings,
        version=__version__,
        source=sequence.source,
        subject=sequence.subject,
        events=events,
    )
