"""The tracker: frame by frame, each fit starting from the one before."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.calibration.calibrate import calibrate as calibrate_hand
from handtrack.calibration.explain import doubt, explain
from handtrack.errors import InputError, SettingsError
from handtrack.fitting import fit
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
from handtrack.kernels import workspace
from handtrack.mcap.hand import Event, Head
from handtrack.mcap.state import Stretch
from handtrack.sequences.sequence import Remark, Sequence
from handtrack.tracking.filter_settings import LAG, FilterSettings
from handtrack.tracking.filters import make_filter
from handtrack.tracking.gating import PLAIN, REJECTED, Gate, Verdict
from handtrack.tracking.kalman import Frames
from handtrack.tracking.track import Track, track_of

Array = NDArray[np.float64]

MIN_JOINTS = 6
"""A frame with fewer joints is lost: it says too little of the hand."""
COAST_S = 0.3
"""How long a filter may predict frames that cannot be fitted."""

# frames that are fitted at once in a whole sequence
_CHUNK = 256
# frames by which a calibrated hand is judged
_EXPLAINED = 100


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """What the tracker says of one frame; fields as in Track, for a single frame.

    Its arrays can only be read.
    """

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
    rejected: NDArray[np.bool_]
    restart: bool


class Tracker:
    """Tracks one hand, one frame at a time.

    Every fit starts from the last raw fit; after frames that were lost it starts again, from
    the mean pose and from the last pose, and keeps the better. What the filter makes of a frame
    is never where a fit starts. Giving the frames of a sequence one by one is the same as `track`.
    """

    def __init__(
        self,
        model: HandModel,
        filter: str = "none",
        update: fit.Update = "exact",
        min_joints: int = MIN_JOINTS,
        coast_s: float = COAST_S,
        process_noise: float | Literal["auto"] = "auto",
        couple: bool = True,
        lag: int = LAG,
        noise_mm: float | None = None,
        engine: str = "compiled",
        gate: bool = True,
        robust: fit.Robust = "none",
        spread_mm: float = fit.SPREAD_MM,
        collisions: bool = False,
    ):
        """Args:
        model: the hand to fit.
        filter: "none", "kalman", "one-euro", "fixed-lag" or "rts".
        update: as in `handtrack.fit`.
        min_joints: a frame with fewer observed joints is not fitted.
        coast_s: how long a filter predicts where nothing is fitted [s].
        process_noise, couple, lag, noise_mm, engine: of the filter, as in `FilterSettings`.
        gate: leave out joints and frames that cannot be true (`handtrack.tracking.gating`).
        robust, spread_mm, collisions: of the fit, as in `handtrack.fit`.

        Raises:
            SettingsError: a value makes no sense.
        """
        if not 3 <= min_joints <= N_JOINTS:
            raise SettingsError(f"min_joints is {min_joints}, expected 3..21")
        if not 0 <= coast_s <= 1e6:
            raise SettingsError(f"coast_s is {coast_s}, expected at least 0 s")
        self.model = model
        steady = FilterSettings(
            filter, lag, process_noise, couple, noise_mm, engine, robust, spread_mm
        )
        self.settings: dict[str, Any] = {
            "filter": filter,
            "update": update,
            "min_joints": min_joints,
            "coast_s": coast_s,
            "process_noise": process_noise,
            "couple": couple,
            "lag": lag,
            "noise_mm": noise_mm,
            "engine": engine,
            "gate": gate,
            "robust": robust,
            "spread_mm": spread_mm,
            "collisions": collisions,
        }
        self._program = fit.Program(
            update, "newton", robust, spread_mm, noise_mm=noise_mm, collisions=collisions
        )
        self._gate = Gate(self._program, model, min_joints, coast_s) if gate else None
        self._filter = make_filter(steady, model, coast_s)
        self._coast_ns = int(coast_s * 1e9)
        self._waits = filter in ("fixed-lag", "rts")
        self._waiting: deque[tuple[int, Array, Array, fit.Results, int, Verdict]] = deque()
        self.reset()

    def reset(self) -> None:
        """Forget all frames seen, as if the tracker were new."""
        if self._filter is not None:
            self._filter.reset()
        if self._gate is not None:
            self._gate.reset()
        self._waiting.clear()
        self._keep = fit.start_at(self.model)
        self._time_ns: int | None = None
        self._fitted_ns: int | None = None

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
            SettingsError: the filter waits for later frames; there are `push` and `finish`.
        """
        if self._waits:
            raise SettingsError(
                f"filter {self.settings['filter']} waits for later frames:"
                " give it frames by push(), and finish()"
            )
        return self.push(joints, time_ns, confidence)[0]

    def push(
        self, joints: ArrayLike, time_ns: int, confidence: ArrayLike | None = None
    ) -> list[TrackedFrame]:
        """As `step`, for any filter.

        Returns:
            The frames that are final now, in order: this one; or an earlier one, or none yet,
            where the filter waits.
        """
        observed, w = fit.observations(joints, confidence)
        return self._advance((int(time_ns),), observed, w)

    def finish(self) -> list[TrackedFrame]:
        """The frames that the filter has not given yet; it is as new then."""
        if self._filter is None:
            return []
        try:
            return self._given(*self._filter.finish())
        finally:
            # whatever stopped it: they are not of the frames that come next
            self._waiting.clear()

    def _advance(
        self, times_ns: list[int] | tuple[int, ...], observed: Array, w: Array
    ) -> list[TrackedFrame]:
        """Track the next frames: times (T,), joints (T, 21, 3), weights (T, 21).

        Joints and weights are kept, and missing joints made clear in them.
        """
        if self._time_ns is not None and times_ns[0] <= self._time_ns:
            raise InputError(
                f"time does not increase: the last frame was at {self._time_ns * 1e-9:.6f} s,"
                f" this one is at {times_ns[0] * 1e-9:.6f} s"
            )
        for t in range(1, len(times_ns)):
            if times_ns[t] - times_ns[t - 1] > self._coast_ns:
                before = self._advance(times_ns[:t], observed[:t], w[:t])
                return before + self._advance(times_ns[t:], observed[t:], w[t:])
        if self._time_ns is not None and times_ns[0] - self._time_ns > self._coast_ns:
            # as after frames that were lost: the last pose is one start of two
            fit.forget(self._keep)
        results = fit.Results(len(times_ns), full=False)
        model, least = self.model, self.settings["min_joints"]
        given, verdicts = w, [PLAIN] * len(times_ns)
        if self._gate is None:
            results.run(self._program, model, observed, w, self._keep, model.mean_angles, least)
        else:
            given = w.copy()
            verdicts = self._gate.run(results, times_ns, observed, w, self._keep)
            given[np.isnan(observed[..., 0])] = 0.0
        self._time_ns = times_ns[-1]
        frames = (
            (time_ns, observed[t], given[t], results, t, verdicts[t])
            for t, time_ns in enumerate(times_ns)
        )
        steadied = None
        if self._filter is not None:
            inputs = Frames(np.array(times_ns), observed, w, results.rows)
            steadied = self._filter.advance(inputs)
        # gate and filter look at these again: whoever gets a frame may only read them
        observed.setflags(write=False)
        given.setflags(write=False)
        results.rows.setflags(write=False)
        if steadied is None:
            return [self._frame(*frame, None, False) for frame in frames]
        self._waiting.extend(frames)
        return self._given(*steadied)

    def _given(self, rows: Array, known: NDArray[np.bool_]) -> list[TrackedFrame]:
        """The next frames that wait, with what the filter makes of them."""
        rows.setflags(write=False)
        return [
            self._frame(*self._waiting.popleft(), row, known_)
            for row, known_ in zip(rows, known.tolist(), strict=True)
        ]

    def _frame(
        self,
        time_ns: int,
        observed: Array,
        w: Array,
        results: fit.Results,
        t: int,
        verdict: Verdict,
        filtered: Array | None,
        known: bool,
    ) -> TrackedFrame:
        row = results.row(t)
        fitted = not math.isnan(row.objective)
        reason = ""
        if row.state == workspace.TOO_FEW:
            reason = f"{row.seen} of 21 joints observed, {self.settings['min_joints']} needed"
        elif row.state == workspace.UNDERDETERMINED:
            reason = "the observed joints lie on a line"
        elif row.state not in (workspace.CONVERGED, REJECTED):
            reason = fit.STATUS[row.state]
        reason = "; ".join(filter(None, (verdict.reason, reason)))
        restart = verdict.restart
        if fitted:
            gone_ns = 0 if self._fitted_ns is None else time_ns - self._fitted_ns
            if gone_ns > self._coast_ns:
                restart, found = True, f"found again after {1e-9 * gone_ns:.2f} s"
                reason = "; ".join(filter(None, (found, reason)))
            self._fitted_ns = time_ns
        steady = results.rows[t] if filtered is None else filtered
        angles, quaternion, translation, joints = fit.pose_of(steady)
        return TrackedFrame(
            time_ns=time_ns,
            observed=observed,
            confidence=w,
            angles_raw=row.angles,
            angles=angles,
            quaternion_raw=row.quaternion,
            quaternion=quaternion,
            translation_raw=row.translation,
            translation=translation,
            fitted_joints=row.joints,
            filtered_joints=joints,
            angle_variance=row.variance,
            objective=row.objective,
            sweeps=row.sweeps + row.steps,
            status="fitted" if fitted else "predicted" if known else "lost",
            reason=reason,
            rejected=verdict.rejected,
            restart=restart,
        )


def track(
    sequence: Sequence,
    model: HandModel | None = None,
    calibrate: bool | str = True,
    filter: str = "none",
    update: fit.Update = "exact",
    min_joints: int = MIN_JOINTS,
    coast_s: float = COAST_S,
    process_noise: float | Literal["auto"] = "auto",
    couple: bool = True,
    lag: int = LAG,
    noise_mm: float | None = None,
    engine: str = "compiled",
    gate: bool = True,
    robust: fit.Robust = "none",
    spread_mm: float = fit.SPREAD_MM,
    collisions: bool = False,
    progress: Callable[[int], None] | None = None,
    on_part: Callable[[Stretch], None] | None = None,
) -> Track:
    """Track a whole sequence.

    Args:
        sequence: the joints of one hand.
        model: the hand; the free default hand of the sequence's side if left out.
        calibrate: find the subject's own hand in the sequence, with lengths, palm and axes; or
            a method of `handtrack.calibrate`; False is "scale", the model's size alone, and
            "none" takes the model as it is.
        filter, update, min_joints, coast_s, process_noise, couple, lag, noise_mm, engine, gate,
            robust, spread_mm, collisions: as in `Tracker`.
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
    found: dict[str, Any] = {}
    notes = list(sequence.notes)
    hand = model
    if calibrate != "none":
        method = calibrate
        if isinstance(method, bool):
            method = "auto" if method else "scale"
        calibration = calibrate_hand(model, sequence, method)
        hand = calibration.model
        notes += calibration.notes
        found = calibration.summary()
        if calibration.method in ("full", "lengths"):
            found |= explain(hand, sequence, _EXPLAINED).summary()
            doubtful = doubt(found)
            notes += [doubtful] if doubtful else []
    tracker = Tracker(
        hand,
        filter,
        update,
        min_joints,
        coast_s,
        process_noise,
        couple,
        lag,
        noise_mm,
        engine,
        gate,
        robust,
        spread_mm,
        collisions,
    )
    settings = {
        **tracker.settings,
        "calibrate": calibrate,
        "calibration": found,
        "limits": model.limits.name,
        "model": model.name,
    }
    if sequence.remarks:
        # what was done to the input is not seen in it, and belongs to the result
        settings["remarks"] = [[r.first_ns, r.last_ns, r.text] for r in sequence.remarks]
    # what the source does not say of time, so that nobody compares by it
    assumed = {"time": not sequence.timed, "frame numbers": not sequence.numbered}
    if any(assumed.values()):
        settings["assumed"] = [name for name, is_so in assumed.items() if is_so]

    head = Head.of(
        hand,
        sequence.name,
        settings,
        source=sequence.source,
        subject=sequence.subject,
        has_truth=sequence.truth is not None,
    )
    events = [Event(int(sequence.time_ns[0]), "warning", note) for note in notes]
    before, done = None, 0
    stretches: list[Stretch] = []
    for new in _stretches(tracker, sequence):
        events += sorted(
            frame_events(new, before) + remark_events(sequence.remarks, new),
            key=lambda event: event.time_ns,
        )
        before = new[-1]
        part = slice(done, done + len(new))
        stretch = stretch_of_frames(
            with_remarks(new, sequence.remarks),
            head,
            sequence.frame_index[part],
            None if sequence.truth is None else sequence.truth[part],
            events,
        )
        stretches.append(stretch)
        events, done = [], part.stop
        if on_part is not None:
            on_part(stretch)
        if progress is not None:
            progress(done)
    return track_of(stretches)


def _stretches(tracker: Tracker, sequence: Sequence) -> Iterator[list[TrackedFrame]]:
    """The frames of a sequence, some at a time, as they become final."""
    for t in range(0, len(sequence), _CHUNK):
        part = slice(t, t + _CHUNK)
        # copies: the sequence's own arrays are not to be written to
        joints, w = np.array(sequence.joints[part]), np.array(sequence.confidence[part])
        new = tracker._advance(sequence.time_ns[part].tolist(), joints, w)
        if new:
            yield new
    rest = tracker.finish()
    for t in range(0, len(rest), _CHUNK):
        yield rest[t : t + _CHUNK]


def frame_events(frames: list[TrackedFrame], before: TrackedFrame | None = None) -> list[Event]:
    """What happened in frames: changes of status, hands found anew, joints newly rejected.

    Args:
        frames: in order of time.
        before: the frame before the first of them.
    """
    events = []
    for frame in frames:
        changed = before is None or frame.status != before.status
        newly = frame.rejected if before is None else frame.rejected & ~before.rejected
        if changed or frame.restart or newly.any():
            level = "info" if frame.status == "fitted" else "warning"
            words = (frame.status if changed else "", frame.reason)
            events.append(Event(frame.time_ns, level, ": ".join(filter(None, words))))
        before = frame
    return events


def remark_events(remarks: Iterable[Remark], frames: list[TrackedFrame]) -> list[Event]:
    """An event for every remark that begins in these frames."""
    first, last = frames[0].time_ns, frames[-1].time_ns
    return [Event(r.first_ns, "info", r.text) for r in remarks if first <= r.first_ns <= last]


def with_remarks(frames: list[TrackedFrame], remarks: Iterable[Remark]) -> list[TrackedFrame]:
    """The frames, with each remark among the reasons of those that it is about."""
    out = list(frames)
    for remark in remarks:
        for i, frame in enumerate(out):
            if remark.first_ns <= frame.time_ns <= remark.last_ns:
                reason = "; ".join(filter(None, (remark.text, frame.reason)))
                out[i] = replace(frame, reason=reason)
    return out


def stretch_of_frames(
    frames: list[TrackedFrame],
    head: Head,
    frame_index: ArrayLike,
    truth: Array | None = None,
    events: Iterable[Event] = (),
) -> Stretch:
    """The stretch that frames make, one or more, in order of time.

    Args:
        frames: as `Tracker.step` returns them.
        head: what does not change of the hand.
        frame_index, truth, events: as in `Track`.
    """
    arrays: dict[str, Any] = {
        f.name: np.array([getattr(frame, f.name) for frame in frames]) for f in fields(TrackedFrame)
    }
    return Stretch(
        frame_index=np.array(frame_index, np.int64),
        truth=truth,
        head=head,
        events=tuple(events),
        **arrays,
    )
