"""How steady and how accurate tracked sequences are: the numbers of `handtrack stability`.

A track is compared with its truth where it has one, otherwise with the joints it was fitted to.
Against the observed joints the numbers say how well the hand explains the observation, noise
included: not how near it is to the real hand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError
from handtrack.evaluation.arrays import Array, nan_mean, sequence_of_points
from handtrack.evaluation.matching import match_frames, truth_problem
from handtrack.evaluation.metrics import acceleration, jitter, lag, mpjpe, pa_mpjpe
from handtrack.evaluation.results import Against, Spread, Stability, StabilityReport
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.track import Track

_FAR_MM = 150.0
"""An error of so much, more than a hand's length, is not one of the hand's pose."""
_LATE = 0.5
"""A lag of so many frames is worth a note."""
_LAG_FRAMES = 2000
"""Frames that are enough to find a lag."""


def stability(tracks: Track | Iterable[Track]) -> StabilityReport:
    """Stability of tracks: their filtered joints against the truth, else against the observed.

    If only some tracks have a truth, each is reported against the best it has, and the overall
    numbers, which must mean one thing, are against the observed joints of all.

    Raises:
        InputError: there is no track.
    """
    tracks = [tracks] if isinstance(tracks, Track) else list(tracks)
    if not tracks:
        raise InputError("no track to measure")
    rows = [_of_track(t, _best(t)) for t in tracks]
    pooled, note = rows, ""
    if len({r.against for r in rows}) > 1:
        pooled = [_of_track(t, "observed") for t in tracks]
        note = "against the observed joints of all, for only some sequences have a truth"
    return StabilityReport(tuple(rows), _pool(pooled, note))


def stability_of_pairs(pairs: Iterable[tuple[Sequence, Sequence]]) -> StabilityReport:
    """Stability of (estimate, truth) pairs, each as `stability_of_pair`.

    Raises:
        InputError: there is no pair, or one does not fit.
    """
    rows = [stability_of_pair(estimate, truth) for estimate, truth in pairs]
    if not rows:
        raise InputError("no pair to measure")
    return StabilityReport(tuple(rows), _pool(rows, ""))


def stability_of_pair(estimate: Sequence, truth: Sequence, match: str = "auto") -> Stability:
    """Stability of an estimate against a truth from elsewhere.

    Args:
        estimate: the joints to judge.
        truth: the joints to judge by; its `joints`, not its `truth`, are used.
        match: "frame" numbers, "time", or "auto" (see `match_frames`).

    Raises:
        InputError: the two are of different hands, have too few frames in common, or the
            truth is in another unit, joint order or mirrored (named in the message).
    """
    where = f"{estimate.name} against {truth.name}"
    if estimate.hand != truth.hand:
        raise InputError(f"{where}: a {estimate.hand} hand against a {truth.hand} one")
    try:
        i, j = match_frames(estimate, truth, match)
    except InputError as problem:
        raise InputError(f"{where}: {problem}") from None
    reference = np.full(estimate.joints.shape, np.nan)
    reference[i] = truth.joints[j]
    wrong = truth_problem(estimate.joints[i], truth.joints[j])
    if wrong:
        raise InputError(f"{where}: {wrong}")
    seen = ~np.isnan(estimate.joints[..., 0]).all(1)
    notes = []
    if len(i) < len(estimate):
        notes.append(f"{len(estimate) - len(i)} of {len(estimate)} frames have no truth")
    if len(j) < len(truth):
        notes.append(f"{len(truth) - len(j)} of {len(truth)} frames of the truth have no estimate")
    apart = np.abs(
        (estimate.time_ns[i] - estimate.time_ns[i[0]]) - (truth.time_ns[j] - truth.time_ns[j[0]])
    )
    if np.median(apart) > 1_000_000:
        notes.append(f"matched frames are {np.median(apart) * 1e-6:.1f} ms apart (median)")
    return _measure(
        estimate.name,
        estimate.hand,
        estimate.time_ns,
        estimate.joints,
        reference,
        "truth",
        (int(seen.sum()), 0, int((~seen).sum())),
        notes=notes,
    )


def compare_arrays(
    estimate: ArrayLike,
    truth: ArrayLike,
    fps: float = 30.0,
    hand: Hand = "right",
    name: str = "estimate",
) -> Stability:
    """Stability of joint arrays that belong together frame by frame.

    Args:
        estimate, truth: (T, 21, 3) [m], NaN = missing.
        fps: frames per second.
        hand: which hand both show.
        name: of the result.

    Raises:
        InputError: shapes differ or are not (T, 21, 3), fps is not positive, or as
            `stability_of_pair`.
    """
    a = sequence_of_points(estimate, "the estimate's points")
    b = sequence_of_points(truth, "the truth's points")
    if a.shape != b.shape or a.shape[1] != N_JOINTS:
        raise InputError(
            f"the estimate has shape {a.shape}, the truth {b.shape}, expected (frames, 21, 3)"
        )
    if not (np.isfinite(fps) and fps > 0):
        raise InputError(f"fps is {fps}, expected a positive number")
    time_ns = np.rint(np.arange(len(a)) * 1e9 / fps).astype(np.int64)
    return stability_of_pair(
        Sequence(time_ns, a, hand=hand, name=name),
        Sequence(time_ns, b, hand=hand, name="truth"),
        match="frame",
    )


def _best(track: Track) -> Against:
    has_truth = track.truth is not None and not np.isnan(track.truth).all()
    return "truth" if has_truth else "observed"


def _of_track(track: Track, against: Against) -> Stability:
    reference = track.observed
    notes = []
    if against == "truth" and track.truth is not None:
        reference = track.truth
        wrong = truth_problem(track.filtered_joints, reference)
        if wrong:
            notes.append(f"warning: {wrong}")
    fitted, predicted, lost = (
        int((track.status == status).sum()) for status in ("fitted", "predicted", "lost")
    )
    return _measure(
        track.name,
        track.hand,
        track.time_ns,
        track.filtered_joints,
        reference,
        against,
        (fitted, predicted, lost),
        track.observed,
        notes,
    )


def _measure(
    name: str,
    hand: str,
    time_ns: ArrayLike,
    estimate: Array,
    reference: Array,
    against: Against,
    counts: tuple[int, int, int],
    observed: Array | None = None,
    notes: Iterable[str] = (),
) -> Stability:
    values = {
        "pa_mpjpe_mm": pa_mpjpe(estimate, reference) * 1e3,
        "mpjpe_mm": mpjpe(estimate, reference) * 1e3,
        "jitter_m_s3": jitter(estimate, time_ns=time_ns),
        "acceleration_m_s2": acceleration(estimate, time_ns=time_ns),
    }
    if observed is not None:
        values["input_jitter_m_s3"] = jitter(observed, time_ns=time_ns)
        values["input_acceleration_m_s2"] = acceleration(observed, time_ns=time_ns)
    late = float("nan")
    if against == "truth":
        values["truth_jitter_m_s3"] = jitter(reference, time_ns=time_ns)
        values["truth_acceleration_m_s2"] = acceleration(reference, time_ns=time_ns)
        if observed is not None:
            values["input_pa_mpjpe_mm"] = pa_mpjpe(observed, reference) * 1e3
            values["input_mpjpe_mm"] = mpjpe(observed, reference) * 1e3
        part = slice(0, _LAG_FRAMES)
        late = lag(estimate[part], reference[part], time_ns=np.asarray(time_ns)[part])
        apart = Spread.of(values["mpjpe_mm"]).median
        if apart > _FAR_MM:
            notes = [*notes, f"the output is {apart:.0f} mm from the truth: another world frame?"]
        if abs(late) >= _LATE:
            notes = [
                *notes,
                f"the output is {abs(late):.1f} frames {'late' if late > 0 else 'early'}",
            ]
    return _summary(name, hand, len(estimate), counts, against, values, late, tuple(notes))


def _summary(
    name: str,
    hand: str,
    frames: int,
    counts: tuple[int, int, int],
    against: Against,
    values: Mapping[str, Array],
    late: float,
    notes: tuple[str, ...],
) -> Stability:
    def mean(key: str) -> float:
        return float(nan_mean(values[key])) if key in values else float("nan")

    def spread(key: str) -> Spread | None:
        return Spread.of(values[key]) if key in values else None

    return Stability(
        name=name,
        hand=hand,
        frames=frames,
        fitted=counts[0],
        predicted=counts[1],
        lost=counts[2],
        compared=int((~np.isnan(values["pa_mpjpe_mm"])).sum()),
        against=against,
        pa_mpjpe_mm=Spread.of(values["pa_mpjpe_mm"]),
        mpjpe_mm=Spread.of(values["mpjpe_mm"]),
        jitter_m_s3=mean("jitter_m_s3"),
        acceleration_m_s2=mean("acceleration_m_s2"),
        input_jitter_m_s3=mean("input_jitter_m_s3"),
        input_acceleration_m_s2=mean("input_acceleration_m_s2"),
        input_pa_mpjpe_mm=spread("input_pa_mpjpe_mm"),
        input_mpjpe_mm=spread("input_mpjpe_mm"),
        truth_jitter_m_s3=mean("truth_jitter_m_s3"),
        truth_acceleration_m_s2=mean("truth_acceleration_m_s2"),
        lag_frames=late,
        notes=notes,
        frame_values=values,
    )


def _pool(rows: list[Stability], note: str) -> Stability:
    """All frames of the rows as one; the rows must be against the same thing."""
    shared = set.intersection(*(set(r.frame_values) for r in rows))
    values = {
        key: np.concatenate([r.frame_values[key] for r in rows])
        for key in rows[0].frame_values
        if key in shared
    }
    hands = {r.hand for r in rows}
    lags = nan_mean(np.array([r.lag_frames for r in rows]))
    return _summary(
        "overall",
        hands.pop() if len(hands) == 1 else "both",
        sum(r.frames for r in rows),
        (
            sum(r.fitted for r in rows),
            sum(r.predicted for r in rows),
            sum(r.lost for r in rows),
        ),
        rows[0].against,
        values,
        float(lags),
        (note,) if note else (),
    )
