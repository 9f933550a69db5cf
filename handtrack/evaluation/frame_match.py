"""Which frames of an estimate and of a truth belong together.

What files state goes before what is implied: frame numbers and clocks that are the files' own,
and only then places in the arrays, where both have as many. How it was done is said wherever it
is not plain.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.evaluation.alignment import pa_mpjpe
from handtrack.evaluation.arrays import Array
from handtrack.evaluation.matching import LOOK, typical
from handtrack.files.long_arrays import evenly

Indices = NDArray[np.int64]

WAYS = ("auto", "frame", "time", "position")
_SHIFTS = 2000
"""So many ways of laying a clock over another are tried."""
_CURE = "--match frame|time|position says what they belong together by"


class Timed(Protocol):
    """Frames that have numbers and times: a sequence, a track, an estimate."""

    @property
    def time_ns(self) -> Indices:
        """(T,) strictly increasing [ns]."""

    @property
    def frame_index(self) -> Indices:
        """(T,) numbers of the source's frames."""

    @property
    def timed(self) -> bool:
        """Whether the times are the source's; else a rate was assumed."""

    @property
    def numbered(self) -> bool:
        """Whether the numbers are the source's; else frames were counted."""

    def __len__(self) -> int: ...


class Match(NamedTuple):
    """Frames that belong together.

    Attributes:
        estimate, truth: (n,) indices.
        note: how they were found, where it is not plain; else "".
    """

    estimate: Indices
    truth: Indices
    note: str = ""


def match_frames(estimate: Timed, truth: Timed, by: str = "auto") -> Match:
    """Which frame of the truth belongs to which frame of the estimate.

    By frame number the same numbers belong together. By time each frame gets the nearest stamp
    within half a time step; where two clocks have nothing in common they are laid over each
    other if there is only one way to do it. By position the first belongs to the first.

    "auto" takes numbers that both files give and clocks that both files give. Where these
    contradict, the one that does not merely count from the start of its own file. Where neither
    is there, positions, if there are as many.

    Args:
        estimate, truth: the sequences.
        by: one of `WAYS`.

    Raises:
        InputError: fewer than half of the shorter sequence's frames find a partner, or there
            are several ways; the message says what does not fit and the option that decides.
    """
    if by not in WAYS:
        raise InputError(f"frames cannot be matched by {by!r}, expected {', '.join(WAYS)}")
    if by == "position":
        return _by_position(estimate, truth, "")
    if by == "frame":
        i, j = _by_number(estimate, truth)
        problem = _frame_problem(estimate, truth, len(i))
        if problem:
            raise InputError(problem)
        return Match(i, j)
    numbers = _numbers(estimate, truth) if by == "auto" else None
    timed = by == "time" or (estimate.timed and truth.timed)
    clocks = _clocks(estimate, truth) if timed else None
    if numbers is not None and clocks is not None:
        return _agreed(estimate, truth, numbers, clocks)
    if numbers is not None:
        return numbers
    if clocks is not None:
        return clocks
    if timed:
        return _laid_over(estimate, truth)
    without = [w for w, x in (("estimate", estimate), ("truth", truth)) if not x.timed]
    return _by_position(estimate, truth, f"no clock in the {' and the '.join(without)}")


def _numbers(estimate: Timed, truth: Timed) -> Match | None:
    """By the numbers that both files give; None where they have few in common."""
    if not (estimate.numbered and truth.numbered):
        return None
    i, j = _by_number(estimate, truth)
    if _frame_problem(estimate, truth, len(i)):
        return None
    return None if _rate_problem(estimate, truth) else Match(i, j)


def _clocks(estimate: Timed, truth: Timed) -> Match | None:
    """By the clocks as they are; None where they have few stamps in common."""
    i, j = _by_time(estimate.time_ns, truth.time_ns)
    return None if 2 * len(i) < min(len(estimate), len(truth)) else Match(i, j)


def _agreed(estimate: Timed, truth: Timed, numbers: Match, clocks: Match) -> Match:
    """Of two ways the one that is right: they agree, or one only counts from its own start."""
    by_number = dict(zip(numbers.estimate.tolist(), numbers.truth.tolist(), strict=True))
    by_clock = dict(zip(clocks.estimate.tolist(), clocks.truth.tolist(), strict=True))
    both = by_number.keys() & by_clock.keys()
    other = sum(by_number[k] != by_clock[k] for k in both)
    if 20 * other <= len(both) and both:
        return numbers if len(numbers.estimate) >= len(clocks.estimate) else clocks
    step = _step(estimate)
    apart = estimate.time_ns[numbers.estimate] - truth.time_ns[numbers.truth]
    # numbers of which the same step is not the same time are places in the array
    steady = bool(np.abs(apart - np.median(apart)).max() <= 0.5 * step)
    counted = all(0 <= x.frame_index[0] <= 1 for x in (estimate, truth))
    if steady and not counted:
        lead = f"{abs(np.median(apart)) * 1e-9:.4g} s"
        return numbers._replace(note=f"matched by frame number, where the clocks are {lead} apart")
    return clocks._replace(note="matched by their clocks, which the frame numbers contradict")


def _laid_over(estimate: Timed, truth: Timed) -> Match:
    """By clocks that have nothing in common, where there is one way to lay one over the other."""
    problem = (
        f"estimate ({_span(estimate)}) and truth ({_span(truth)}) have only"
        f" {len(_by_time(estimate.time_ns, truth.time_ns)[0])} frames in common, by frame number"
        " or by time"
    )
    apart = estimate.time_ns[-1] < truth.time_ns[0] or truth.time_ns[-1] < estimate.time_ns[0]
    if not apart:
        raise InputError(f"{problem} ({_CURE})")
    short, long = sorted((estimate, truth), key=len)
    spare = len(long) - len(short)
    if spare > _SHIFTS:
        raise InputError(f"{problem}, and their clocks can be laid over each other in many ways")
    own = short.time_ns - short.time_ns[0]
    reach = 0.5 * min(_step(estimate), _step(truth))
    fits = [
        k
        for k in range(spare + 1)
        if np.abs(long.time_ns[k : k + len(short)] - long.time_ns[k] - own).max() <= reach
    ]
    if len(fits) > 1 or (not fits and spare):
        raise InputError(
            f"{problem}; their clocks are {_apart(estimate, truth)} apart, and can be laid over"
            f" each other in {len(fits) or 'no'} way{'s' * (len(fits) != 1)} ({_CURE})"
        )
    k = fits[0] if fits else 0
    shift = short.time_ns[0] - long.time_ns[k]
    offset = shift if short is estimate else -shift
    i, j = _by_time(estimate.time_ns - offset, truth.time_ns)
    if 2 * len(i) < min(len(estimate), len(truth)):
        raise InputError(f"{problem} ({_CURE})")
    return Match(
        i, j, f"the clocks are {abs(int(offset)) * 1e-9:.6g} s apart: laid over each other"
    )


def _by_position(estimate: Timed, truth: Timed, why: str) -> Match:
    n, m = len(estimate), len(truth)
    if n != m:
        because = f"{why}, no frame numbers in common, and " if why else ""
        raise InputError(
            f"{because}the estimate has {n} frames, the truth {m}: which belong together cannot be"
            f" told (--fps N gives both a clock, {_CURE})"
        )
    every = np.arange(n)
    return Match(every, every, f"{why}: matched by position, {n} frames each" if why else "")


def _by_number(estimate: Timed, truth: Timed) -> tuple[Indices, Indices]:
    _, i, j = np.intersect1d(estimate.frame_index, truth.frame_index, return_indices=True)
    return i, j


def _apart(estimate: Timed, truth: Timed) -> str:
    return f"{abs(int(estimate.time_ns[0]) - int(truth.time_ns[0])) * 1e-9:.4g} s"


def _step(sequence: Timed) -> float:
    """Median time from frame to frame [ns]; 0 for a single frame."""
    return float(np.median(np.diff(sequence.time_ns))) if len(sequence) > 1 else 0.0


def rate_problem(
    estimate: Timed, truth: Timed, estimate_joints: Array, truth_joints: Array, by: str
) -> str:
    """What is wrong with matching so where the two have other frame rates, or "".

    Where frames of the same number show the same pose although their times say that they
    cannot, one of the rates is wrong, and a match by time compares other moments. Where they
    do not, a match by number does.

    Args:
        estimate, truth: the frames; their joints (T, 21, 3) and (S, 21, 3) [m].
        by: "auto" or "frame"; with "time" the caller knows.
    """
    wrong = _rate_problem(estimate, truth)
    _, i, j = np.intersect1d(estimate.frame_index, truth.frame_index, return_indices=True)
    if by in ("time", "position") or not wrong or _frame_problem(estimate, truth, len(i)):
        return ""
    errors = []
    for left, right in ((i, j), _by_time(estimate.time_ns, truth.time_ns)):
        left, right = evenly(left, LOOK), evenly(right, LOOK)
        errors.append(typical(pa_mpjpe(estimate_joints[left], truth_joints[right])))
    fits = errors[0] < 0.5 * errors[1]
    if by == "frame":
        return "" if fits else wrong
    if not fits:
        return ""
    return (
        f"{wrong}; but by number the frames fit ({errors[0] * 1e3:.1f} mm) and by time they do"
        f" not ({errors[1] * 1e3:.1f} mm): one of the frame rates is wrong. Match by frame, or"
        " give the right rate"
    )


def _frame_problem(estimate: Timed, truth: Timed, common: int) -> str:
    if 2 * common >= min(len(estimate), len(truth)):
        return ""
    return (
        f"estimate ({_span(estimate)}) and truth ({_span(truth)}) have only {common} frame"
        " numbers in common"
    )


def _rate_problem(estimate: Timed, truth: Timed) -> str:
    """Whether the same step in frame numbers takes another time in the two."""
    ours, theirs = _per_frame(estimate), _per_frame(truth)
    if not (ours > 0 and theirs > 0) or abs(ours / theirs - 1) < 0.1:
        return ""
    return (
        f"the estimate has {1e9 / ours:.4g} frames a second, the truth {1e9 / theirs:.4g}:"
        " the same frame number is not the same moment"
    )


def _per_frame(sequence: Timed) -> float:
    """Median time from one frame number to the next [ns]."""
    numbers = np.diff(sequence.frame_index)
    ahead = numbers > 0
    if not ahead.any():
        return float("nan")
    return float(np.median(np.diff(sequence.time_ns)[ahead] / numbers[ahead]))


def _by_time(a: Indices, b: Indices) -> tuple[Indices, Indices]:
    """Pairs of stamps that are each other's nearest, within half of the shorter step."""
    steps = [np.median(np.diff(t)) for t in (a, b) if len(t) > 1]
    reach = 0.5 * min(steps) if steps else 0.0
    to_b, to_a = _nearest(a, b), _nearest(b, a)
    i = np.arange(len(a))
    keep = (to_a[to_b] == i) & (np.abs(b[to_b] - a) <= reach)
    return i[keep], to_b[keep]


def _nearest(a: Indices, b: Indices) -> Indices:
    """Index of the nearest of sorted b for each of a."""
    right = np.clip(np.searchsorted(b, a), 1, max(1, len(b) - 1))
    right = np.minimum(right, len(b) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(a - b[left]) <= np.abs(b[right] - a), left, right)


def _span(sequence: Timed) -> str:
    first, last = sequence.frame_index[[0, -1]]
    seconds = (sequence.time_ns[-1] - sequence.time_ns[0]) * 1e-9
    return f"{len(sequence)} frames {first}:{last}, {seconds:.3g} s"
