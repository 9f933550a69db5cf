"""The tracker: frame by frame, each fit starting from the one before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack import __version__
from handtrack.errors import InputError, SettingsError
from handtrack.fitting import bcd, lanes
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
# no measurement is better than a tenth of a millimetre, or a tenth of a degree
_NOISE_FLOOR = 1e-8
_ANGLE_FLOOR = 3e-6
_DIAGONAL = (np.arange(N_ANGLES), np.arange(N_ANGLES))
# frames that are fitted at once in a whole sequence
_CHUNK = 256

_NOTHING = Pose(np.full(N_ANGLES, np.nan), np.full((3, 3), np.nan), np.full(3, np.nan))


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
        self._program = bcd.Program(update)
        self._filter = make_filter(filter, model.limits, process_noise)
        self.reset()

    def reset(self) -> None:
        """Forget all frames seen, as if the tracker were new."""
        self._filter.reset()
        self._angles = self.model.mean_angles.copy()
        self._root = np.zeros(12)
        self._memory = 0
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
            confidence: (21,) weights, not negative; 1 by default.

        Returns:
            Poses, errors, status and reason of this frame.

        Raises:
            InputError: wrong shapes or values, or time that does not increase.
        """
        observed = np.array(joints, dtype=np.float64)
        if observed.shape != (N_JOINTS, 3):
            raise InputError(f"joints have shape {observed.shape}, expected (21, 3)")
        if np.isinf(observed).any():
            raise InputError("a joint is infinite, expected metres or NaN")
        w = np.ones(N_JOINTS) if confidence is None else np.array(confidence, dtype=np.float64)
        if w.shape != (N_JOINTS,) or not np.isfinite(w).all() or w.min() < 0:
            raise InputError("confidence must be 21 finite numbers, none negative")
        observed[np.isnan(observed).any(1)] = np.nan
        w[np.isnan(observed[:, 0])] = 0.0
        return self._advance(np.array([int(time_ns)]), observed[None], w[None])[0]

    def _advance(self, time_ns: NDArray[np.int64], observed: Array, w: Array) -> list[TrackedFrame]:
        """Track the next frames: (T,), (T, 21, 3) with NaN, (T, 21)."""
        if self._time_ns is not None and time_ns[0] <= self._time_ns:
            raise InputError(
                f"time does not increase: the last frame was at {self._time_ns * 1e-9:.6f} s,"
                f" this one is at {time_ns[0] * 1e-9:.6f} s"
            )
        results = bcd.Results(len(time_ns), full=self.settings["filter"] != "none")
        self._memory = results.run(
            self._program,
            self.model,
            np.nan_to_num(observed),
            w,
            self._angles,
            self._root,
            self._memory,
            self.settings["min_joints"],
        )
        quaternions = matrix_to_quaternion(results.roots[:, :9].reshape(-1, 3, 3))
        seen = (w > 0).sum(1)
        noise = bcd.residual_noise(results.objective, seen)
        variance = bcd.at_noise(results.variance[:, :N_ANGLES], noise[:, None])
        return [
            self._frame(
                int(time_ns[t]),
                observed[t],
                w[t],
                results,
                t,
                quaternions[t],
                variance[t],
                float(noise[t]),
                int(seen[t]),
            )
            for t in range(len(time_ns))
        ]

    def _frame(
        self,
        time_ns: int,
        observed: Array,
        w: Array,
        results: bcd.Results,
        t: int,
        quaternion: Array,
        variance: Array,
        noise: float,
        seen: int,
    ) -> TrackedFrame:
        state = int(results.state[t])
        fitted = bool(np.isfinite(results.objective[t]))
        reason = ""
        if state == lanes.TOO_FEW:
            reason = f"{seen} of 21 joints observed, {self.settings['min_joints']} needed"
        elif state == lanes.UNDERDETERMINED:
            reason = "the observed joints lie on a line"
        elif state != lanes.CONVERGED:
            reason = bcd.STATUS[state]
        raw = Pose(results.angles[t], results.roots[t, :9].reshape(3, 3), results.roots[t, 9:])
        filtered: Pose | None = raw
        if self.settings["filter"] != "none":
            filtered = self._filtered(time_ns, raw if fitted else None, results, t, noise)
        elif not fitted:
            filtered = None
        if fitted:
            status = "fitted"
        else:
            status = "lost" if filtered is None else "predicted"
            variance = np.full(N_ANGLES, np.inf)
        self._time_ns = time_ns
        joints = results.joints[t]
        if filtered is None:
            pose, q, filtered_joints = _NOTHING, np.full(4, np.nan), np.full((N_JOINTS, 3), np.nan)
        elif filtered is raw:
            pose, q, filtered_joints = raw, quaternion, joints
        else:
            pose = filtered
            q = matrix_to_quaternion(pose.rotation)
            filtered_joints = self.model.joints(*pose)
        return TrackedFrame(
            time_ns=time_ns,
            observed=observed,
            confidence=w,
            angles_raw=raw.angles,
            angles=pose.angles,
            quaternion_raw=quaternion,
            quaternion=q,
            translation_raw=raw.translation,
            translation=pose.translation,
            fitted_joints=joints,
            filtered_joints=filtered_joints,
            angle_variance=variance,
            objective=float(results.objective[t]),
            sweeps=int(results.iterations[t].sum()),
            status=status,
            reason=reason,
        )

    def _filtered(
        self, time_ns: int, raw: Pose | None, results: bcd.Results, t: int, noise: float
    ) -> Pose | None:
        """What the filter makes of a frame; None where it has coasted for too long."""
        covariance = None
        if raw is not None:
            self._fitted_ns = time_ns
            noise = max(noise, _NOISE_FLOOR)
            if self._noise is not None:
                noise = self._noise + _NOISE_GAIN * (noise - self._noise)
            self._noise = noise
            covariance = bcd.at_noise(results.covariance[t], noise)
            # an angle that a limit holds is not known to the last digit either
            covariance[_DIAGONAL] += _ANGLE_FLOOR
        elif self._fitted_ns is None or time_ns - self._fitted_ns > self._coast_ns:
            self._filter.reset()
            return None
        dt = 0.0 if self._time_ns is None else (time_ns - self._time_ns) * 1e-9
        return self._filter.step(dt, raw, covariance)

    @property
    def _coast_ns(self) -> int:
        return int(self.settings["coast_s"] * 1e9)


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
    on_part: Callable[[Track], None] | None = None,
) -> Track:
    """Track a whole sequence.

    Args:
        sequence: the joints of one hand.
        model: the hand; the free default hand of the sequence's side if left out.
        calibrate: take bone lengths and palm from the sequence; else the model is only
            scaled to it.
        filter, update, min_joints, coast_s, process_noise: as in `Tracker`.
        progress: called with the number of frames done, now and then.
        on_part: called with every stretch of frames as soon as it is final, in order: what it
            gets, one after another, is the track returned.

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
    settings = {
        **tracker.settings,
        "calibrate": calibrate,
        "limits": model.limits.name,
        "model": model.name,
    }

    def made(part: slice, frames: list[TrackedFrame], events: list[Event]) -> Track:
        return track_of_frames(
            frames,
            calibration.model,
            settings,
            name=sequence.name,
            frame_index=sequence.frame_index[part],
            truth=None if sequence.truth is None else sequence.truth[part],
            source=sequence.source,
            subject=sequence.subject,
            events=events,
        )

    frames: list[TrackedFrame] = []
    events = [Event(int(sequence.time_ns[0]), "warning", note) for note in sequence.notes]
    untold, status = list(events), ""
    for t in range(0, len(sequence), _CHUNK):
        part = slice(t, t + _CHUNK)
        new = tracker._advance(
            sequence.time_ns[part], sequence.joints[part], sequence.confidence[part]
        )
        told = status_events(new, status)
        frames += new
        events += told
        status = new[-1].status
        if on_part is not None:
            on_part(made(part, new, untold + told))
            untold = []
        if progress is not None:
            progress(len(frames))
    return made(slice(None), frames, events)


def status_events(frames: list[TrackedFrame], before: str = "") -> list[Event]:
    """An event for every change of status; `before` is the status before the first frame."""
    events = []
    for frame in frames:
        if frame.status != before:
            level = "info" if frame.status == "fitted" else "warning"
            text = f"{frame.status}: {frame.reason}" if frame.reason else frame.status
            events.append(Event(frame.time_ns, level, text))
            before = frame.status
    return events


def track_of_frames(
    frames: list[TrackedFrame],
    model: HandModel,
    settings: Mapping[str, Any],
    *,
    name: str,
    frame_index: ArrayLike,
    truth: Array | None = None,
    source: str = "",
    subject: str = "",
    events: Iterable[Event] = (),
) -> Track:
    """The Track that frames make, one or more, in order of time.

    Args:
        frames: as `Tracker.step` returns them.
        model: the hand that was fitted.
        settings, name, frame_index, truth, source, subject, events: as in `Track`.
    """
    arrays = {f.name: np.array([getattr(x, f.name) for x in frames]) for f in fields(TrackedFrame)}
    return Track(
        name=name,
        hand=model.hand,
        frame_index=np.array(frame_index, np.int64),
        truth=truth,
        model=model,
        settings=settings,
        version=__version__,
        source=source,
        subject=subject,
        events=tuple(events),
        **arrays,
    )
