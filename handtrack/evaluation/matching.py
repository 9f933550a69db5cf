"""Bringing an estimate and a truth together: which frames belong together, and whether the
truth is what it claims to be (unit, side, joint order)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.evaluation.alignment import pa_mpjpe, reflection_pa_mpjpe
from handtrack.evaluation.arrays import Array, nan_mean
from handtrack.hand.skeleton import N_JOINTS, ORDER_JOINTS, ORDERS

_LOOK = 200
"""Frames that are enough to tell a wrong unit, side or order."""

Indices = NDArray[np.int64]


class Timed(Protocol):
    """Frames that have numbers and times: a sequence, a track, an estimate."""

    @property
    def time_ns(self) -> Indices:
        """(T,) strictly increasing [ns]."""

    @property
    def frame_index(self) -> Indices:
        """(T,) numbers of the source's frames."""

    def __len__(self) -> int: ...


def same_name(a: str, b: str) -> bool:
    """Whether two names mean the same: "clip person0 left" and "person0_left" do."""
    short, long = sorted((name.replace("_", " ").lower() for name in (a, b)), key=len)
    return f" {long}".endswith(f" {short}")


def match_frames(estimate: Timed, truth: Timed, by: str = "auto") -> tuple[Indices, Indices]:
    """Which frame of the truth belongs to which frame of the estimate.

    By frame number the same numbers belong together; unless the caller insists ("frame"), the
    two must then agree on the time between frames. By time each frame gets the nearest stamp
    within half a time step; if the two clocks have nothing in common both are taken to start
    at 0.

    Args:
        estimate, truth: the sequences.
        by: "frame", "time", or "auto": by frame number where that works, else by time.

    Returns:
        indices into the estimate and into the truth, of one length.

    Raises:
        InputError: fewer than half of the shorter sequence's frames find a partner; the message
            says what does not fit.
    """
    problem = "frames were to be matched by time"
    if by in ("auto", "frame"):
        _, i, j = np.intersect1d(
            estimate.frame_index, truth.frame_index, assume_unique=False, return_indices=True
        )
        problem = _frame_problem(estimate, truth, len(i))
        if by == "auto":
            problem = problem or _rate_problem(estimate, truth)
        if not problem:
            return i, j
        if by == "frame":
            raise InputError(problem)
    elif by != "time":
        raise InputError(f"frames cannot be matched by {by!r}, expected auto, frame or time")
    i, j = _by_time(estimate.time_ns, truth.time_ns)
    if 2 * len(i) < min(len(estimate), len(truth)):
        shift = (estimate.time_ns - estimate.time_ns[0], truth.time_ns - truth.time_ns[0])
        separate = (
            estimate.time_ns[-1] < truth.time_ns[0] or truth.time_ns[-1] < estimate.time_ns[0]
        )
        if separate:
            i, j = _by_time(*shift)
    if 2 * len(i) < min(len(estimate), len(truth)):
        raise InputError(
            f"estimate ({_span(estimate)}) and truth ({_span(truth)}) have only {len(i)} frames"
            " in common, by frame number or by time"
        )
    return i, j


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
    if by == "time" or not wrong or _frame_problem(estimate, truth, len(i)):
        return ""
    errors = []
    for left, right in ((i, j), _by_time(estimate.time_ns, truth.time_ns)):
        some = np.linspace(0, len(left) - 1, min(_LOOK, len(left))).astype(int)
        errors.append(_typical(pa_mpjpe(estimate_joints[left[some]], truth_joints[right[some]])))
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


def size_ratio(a: Array, b: Array) -> float:
    """How many times as large the hands of b (T, 21, 3) are as those of a, in common joints."""
    both = np.asarray(~(np.isnan(a).any(-1) | np.isnan(b).any(-1)))[..., None]
    size = _size(np.where(both, a, np.nan))
    return _size(np.where(both, b, np.nan)) / size if size > 0 else float("nan")


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


def truth_problem(estimate: Array, truth: Array) -> str:
    """What is wrong with the truth as a whole, in one line, or "".

    Told apart: another unit, another scale, another joint order, a mirrored hand.

    Args:
        estimate, truth: (T, 21, 3) [m], frames that belong together, NaN = missing.
    """
    both = np.asarray(~(np.isnan(estimate).any(-1) | np.isnan(truth).any(-1)))
    frames = np.flatnonzero(both.sum(1) >= 4)
    if not len(frames):
        return ""
    frames = frames[np.linspace(0, len(frames) - 1, min(_LOOK, len(frames))).astype(int)]
    common = both[frames][..., None]
    a, b = np.where(common, estimate[frames], np.nan), np.where(common, truth[frames], np.nan)
    size_a, size_b = _size(a), _size(b)
    if not (size_a > 0 and size_b > 0):
        return "all joints of a frame are at one point"
    ratio = size_b / size_a
    if not 0.4 < ratio < 2.5:
        for factor, found, expected in (
            (1000, "mm", "m"),
            (100, "cm", "m"),
            (10, "mm", "cm"),
        ):
            for r, words in (
                (ratio, f"the truth's hand is {ratio:.4g} times the estimate's"),
                (1 / ratio, f"the estimate's hand is {1 / ratio:.4g} times the truth's"),
            ):
                if 0.6 < r / factor < 1.6:
                    return f"{words}: {found} read as {expected}?"
        return f"the truth's hand is {ratio:.2g} times as large as the estimate's"
    plain = _typical(pa_mpjpe(a, b))
    # the rest is only worth a word if the error is a good part of the hand
    if not plain > 0.05 * size_b:
        return ""
    orders = {name: o for name, o in ORDERS.items() if ORDER_JOINTS[name] == N_JOINTS}
    for name, order in orders.items():
        index = np.array(order)
        for words, error in (
            ("truth", _typical(pa_mpjpe(a, b[:, index]))),
            ("estimate", _typical(pa_mpjpe(a[:, index], b))),
        ):
            if error < 0.4 * plain:
                return (
                    f"the {words} seems to be in joint order {name!r}: PA-MPJPE is"
                    f" {plain * 1e3:.1f} mm as given, {error * 1e3:.1f} mm in that order"
                )
    mirrored = _typical(reflection_pa_mpjpe(a, b))
    if mirrored < 0.4 * plain:
        return (
            f"the truth looks mirrored: PA-MPJPE is {plain * 1e3:.1f} mm as given,"
            f" {mirrored * 1e3:.1f} mm for its mirror image"
        )
    return ""


def _size(x: Array) -> float:
    """Typical distance of the joints from their barycentre, whatever their order."""
    centred = x - nan_mean(x, -2)[..., None, :]
    return _typical(np.sqrt(nan_mean((centred**2).sum(-1))))


def _typical(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if known.size else float("nan")
