"""How steady and how accurate tracked sequences are: the numbers of `handtrack stability`.

A track is compared with its truth where it has one, otherwise with the joints it was fitted to.
Against the observed joints the numbers say how well the hand explains the observation, noise
included: not how near it is to the real hand. Joints that come alone are measured against
nothing: only how they move is known then.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError
from handtrack.evaluation.arrays import sequence_of_points
from handtrack.evaluation.frame_match import match_frames, rate_problem
from handtrack.evaluation.matching import truth_problem
from handtrack.evaluation.measure import Estimate, measure, pool, reprojection_spread
from handtrack.evaluation.results import Against, Spread, Stability, StabilityReport
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.track import Track

__all__ = [
    "Spread",
    "Stability",
    "StabilityReport",
    "compare_arrays",
    "stability",
    "stability_of_pair",
    "stability_of_pairs",
]


def stability(
    tracks: Track | Sequence | Estimate | Iterable[Track | Sequence | Estimate],
) -> StabilityReport:
    """Stability of tracks: their filtered joints against the truth, else against the observed.

    If only some have a truth, each is reported against the best it has, and the overall
    numbers, which must mean one thing, are against the observed joints of all. A Sequence is
    measured as it is, against the truth it holds, else against nothing.

    Args:
        tracks: one or several: tracks, joint sequences, or joints of another method.

    Returns:
        The numbers of each, and of all frames together (`overall`).

    Raises:
        InputError: there is no track, or something else is given.
    """
    found: object = tracks
    single = isinstance(found, Track | Sequence | Estimate)
    given = list(found) if isinstance(found, Iterable) and not single else [found]
    if not given:
        raise InputError("no track to measure")
    estimates = [_estimate(t) for t in given]
    rows = [_alone(e, _best(e)) for e in estimates]
    pooled, note = rows, ""
    if len({r.against for r in rows}) > 1:
        least: Against = (
            "observed" if all(_best(_blind(e)) == "observed" for e in estimates) else "nothing"
        )
        pooled = [_alone(e, least) for e in estimates]
        note = f"against the {least} joints of all, for only some sequences have a truth"
        if least == "nothing":
            note = "without errors, for only some sequences have something to be measured against"
    return StabilityReport(tuple(rows), pool(pooled, note))


def stability_of_pairs(
    pairs: Iterable[tuple[Track | Sequence | Estimate, Sequence]], match: str = "auto"
) -> StabilityReport:
    """Stability of (estimate, truth) pairs, each as `stability_of_pair`.

    Raises:
        InputError: there is no pair, or one does not fit.
    """
    rows = [stability_of_pair(estimate, truth, match) for estimate, truth in pairs]
    if not rows:
        raise InputError("no pair to measure")
    return StabilityReport(tuple(rows), pool(rows))


def stability_of_pair(
    estimate: Track | Sequence | Estimate, truth: Sequence, match: str = "auto"
) -> Stability:
    """Stability of an estimate against a truth from elsewhere.

    Args:
        estimate: the joints to judge; of a track its filtered ones.
        truth: the joints to judge by; its `joints`, not its `truth`, are used.
        match: "frame" numbers, "time", "position" or "auto" (see `match_frames`).

    Raises:
        InputError: the two are of different hands, have too few frames in common, or the
            truth is in another unit, joint order or mirrored (named in the message), or
            frame rates contradict frame numbers that fit.
    """
    estimate = _estimate(estimate)
    where = f"{estimate.name} against {truth.name}"
    if estimate.hand != truth.hand:
        raise InputError(f"{where}: a {estimate.hand} hand against a {truth.hand} one")
    try:
        i, j, how = match_frames(estimate, truth, match)
    except InputError as problem:
        raise InputError(f"{where}: {problem}") from None
    wrong = rate_problem(estimate, truth, estimate.joints, truth.joints, match)
    if wrong:
        raise InputError(f"{where}: {wrong}")
    reference = np.full(estimate.joints.shape, np.nan)
    reference[i] = truth.joints[j]
    wrong = truth_problem(estimate.joints[i], truth.joints[j])
    if wrong:
        raise InputError(f"{where}: {wrong}")
    notes = [how] if how else []
    if len(i) < len(estimate):
        notes.append(f"{len(estimate) - len(i)} of {len(estimate)} frames have no truth")
    if len(j) < len(truth):
        notes.append(f"{len(truth) - len(j)} of {len(truth)} frames of the truth have no estimate")
    apart = np.abs(
        (estimate.time_ns[i] - estimate.time_ns[i[0]]) - (truth.time_ns[j] - truth.time_ns[j[0]])
    )
    if np.median(apart) > 1_000_000:
        notes.append(f"matched frames are {np.median(apart) * 1e-6:.1f} ms apart (median)")
    return measure(estimate, reference, "truth", notes)


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


def _estimate(given: object) -> Estimate:
    if isinstance(given, Track):
        return Estimate.of_track(given)
    if not isinstance(given, Sequence | Estimate):
        raise InputError(
            f"a {type(given).__name__} is neither a track nor a sequence: handtrack.read_mcap and"
            " handtrack.load read them"
        )
    return Estimate.of_sequence(given) if isinstance(given, Sequence) else given


def _best(estimate: Estimate) -> Against:
    if estimate.truth is not None:
        return "truth"
    # what was fitted to pictures is no observation: against it every error would be 0
    fitted = estimate.observed is None or reprojection_spread(estimate.settings) is not None
    return "nothing" if fitted else "observed"


def _blind(estimate: Estimate) -> Estimate:
    return replace(estimate, truth=None)


def _alone(estimate: Estimate, against: Against) -> Stability:
    """An estimate against what came with it."""
    reference = {"truth": estimate.truth, "observed": estimate.observed}.get(against)
    notes = []
    if against == "truth" and reference is not None:
        wrong = truth_problem(estimate.joints, reference)
        if wrong:
            notes.append(f"warning: {wrong}")
    return measure(estimate, reference, against, notes)
