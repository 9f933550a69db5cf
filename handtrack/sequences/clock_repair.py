"""Repair of times that do not increase: what is out of order, stray, missing, set or repeated.

In this order, each said in a note:

1. frames whose stamps are exchanged, or a file that runs backwards, are put in order of time,
   unless their numbers contradict;
2. stray stamps (a few frames away from neighbours that fit each other) count as missing;
3. where time goes back for good (a clock that was set, or several clips in one file), or
   forward by more than a day, what follows is moved to go on from there;
4. missing stamps lie evenly between those before and after, a step apart at most;
5. repeated stamps are spread over the time to the next, a step apart at most.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

DAY_NS = 86_400 * 10**9
GAP_NS, GAP_STEPS = 10 * 10**9, 100
"""A time without frames that is longer than both is said."""
PAUSE_NS = 10**9
"""Between clips that stand one behind the other: longer than a filter goes on."""
_STRAYS = 8
"""So many frames in a row can be stray at most."""
_NEAR = 8
"""So far from its place can a frame be that only came late."""
_BACKWARDS = 0.05
"""Where time goes back in more than this share of the steps the stamps are in disorder."""


class Repaired(NamedTuple):
    """Times that strictly increase.

    Attributes:
        rows: (T,) which of the frames given, in order of time: all of them.
        time_ns: (T,) int64.
        notes: what was done, one line each.
    """

    rows: Indices
    time_ns: Indices
    notes: tuple[str, ...]


def typical_step(values: NDArray[Any], missing: Flags) -> float:
    """By how much values go up from frame to frame, usually (0: nothing tells).

    A run of equal values shares the step to the next among its frames; the usual ones of these
    are averaged, so that rounding does not count. Neither do steps back, unless most are.
    """
    at = np.flatnonzero(~missing)
    known = values[at]
    if len(known) < 2:
        return 0.0
    first = np.concatenate([[0], np.flatnonzero(np.diff(known) != 0) + 1])
    if len(first) < 2:
        return 0.0
    frames = np.diff(at[first])
    steps = np.diff(known[first]) / frames
    ahead = steps > 0
    if 2 * ahead.sum() < len(steps):
        return float(np.median(np.diff(np.unique(known))))
    middle = np.median(np.repeat(steps[ahead], frames[ahead]))
    usual = (steps > 0.4 * middle) & (steps < 2.5 * middle)
    # half as many again is one frame left out, where stamps are not rounded
    if not (frames > 1).any():
        usual = (steps > 0.5 * middle) & (steps < 1.5 * middle)
    return float((steps * frames)[usual].sum() / frames[usual].sum())


def repaired(
    time_ns: Indices,
    missing: Flags,
    step: float,
    numbers: Indices | None,
    name: str,
    path: Path,
) -> Repaired:
    """Times that strictly increase, as near to those given as can be.

    Args:
        time_ns: (T,) as the source has them, at least one known.
        missing: (T,) which are not known.
        step: time between frames [ns] (`typical_step`).
        numbers: (T,) numbers of the frames, or None.
        name: what the source calls the times; path: the file.

    Raises:
        InputError: the stamps are in disorder.
    """
    n = len(time_ns)
    rows, notes = np.arange(n), []
    step = max(step, 1.0)
    if not missing.any() and (np.diff(time_ns) > 0).all():
        time_ns, said = _joined(time_ns, missing, step, name)
        return Repaired(rows, time_ns, (*said, *_gaps(time_ns, step)))
    order = _order(time_ns, missing, step, numbers)
    if order is not None:
        rows, time_ns, missing = order, time_ns[order], missing[order]
        moved = int((order != np.arange(n)).sum())
        if numbers is not None:
            numbers = numbers[order]
        notes.append(f"{_frames(moved)} of {n} were not in order of {name}: sorted")
    if missing.any():
        notes.append(f"{name} is missing in {_frames(int(missing.sum()))} of {n}: filled in")
    stray = _strays(time_ns, missing, step)
    if stray.any():
        at = int(np.flatnonzero(stray)[0])
        notes.append(
            f"{name} of {_frames(int(stray.sum()))} does not fit its neighbours (the first is"
            f" frame {at}): replaced by what lies between"
        )
        missing = missing | stray
    time_ns, said = _joined(time_ns, missing, step, name)
    back = int((np.diff(time_ns[~missing]) < 0).sum())
    if back or len(said) > max(3, _BACKWARDS * n):
        raise InputError(
            f"{name} goes back {len(said) + back} times in {n} frames, it is no clock (--fps N goes"
            " by the order of the frames)",
            path,
        )
    notes += said[:3] + ([f"and so at {len(said) - 3} more places"] if len(said) > 3 else [])
    time_ns = _filled(time_ns, missing, step)
    equal = np.diff(time_ns) <= 0
    if equal.any():
        notes.append(_repeats(time_ns, missing, name))
        time_ns = _spread(time_ns, step)
    if not (np.diff(time_ns) > 0).all():
        raise InputError(f"{name} is too coarse (--fps N goes by the order of the frames)", path)
    return Repaired(rows, time_ns, (*notes, *_gaps(time_ns, step)))


def _order(
    time_ns: Indices, missing: Flags, step: float, numbers: Indices | None
) -> Indices | None:
    """How to sort frames that are merely out of order; None where sorting is no cure."""
    if missing.any():
        return None
    back = np.diff(time_ns) < 0
    if not back.any():
        return None
    order = np.argsort(time_ns, kind="stable")
    if numbers is not None and (np.diff(numbers[order]) < 0).any():
        return None
    steps = np.diff(time_ns[order])
    moved = order != np.arange(len(order))
    if np.abs(order - np.arange(len(order))).max() <= _NEAR:
        steps = steps[moved[1:] | moved[:-1]]
    elif back.mean() <= _BACKWARDS:
        return None
    even = (steps > 0.5 * step) & (steps < 1.6 * step)
    return order if even.mean() >= 0.9 else None


def _strays(time_ns: Indices, missing: Flags, step: float) -> Flags:
    """Which stamps lie outside while those before and after them fit each other."""
    at = np.flatnonzero(~missing)
    t = time_ns[at]
    stray = np.zeros(len(time_ns), bool)
    leap = max(20 * step, 10**9)
    steps = np.diff(t)
    breaks = np.flatnonzero((steps < 0) | (steps > leap))
    # pieces without a break: first and one past the last
    ends = [0, *(breaks + 1).tolist(), len(t)]
    i = 1
    while i < len(ends) - 1:
        length = next((k for k in range(1, 5) if _fits_without(t, at, ends, i, i + k, step)), None)
        if length is not None:
            stray[at[ends[i] : ends[i + length]]] = True
            i += length
        i += 1
    # of two neighbours in the wrong order, the one without which the rest is even
    for b in np.flatnonzero(np.diff(time_ns) < 0).tolist():
        if missing[b] or missing[b + 1] or stray[b] or stray[b + 1]:
            continue
        around = [(b, b - 1, b + 1), (b + 1, b, b + 2)]
        apart = {
            one: abs(float(time_ns[right] - time_ns[left]) / (2 * step) - 1)
            for one, left, right in around
            if left >= 0 and right < len(time_ns) and not (missing[left] or missing[right])
        }
        best = min(apart, key=lambda one: apart[one], default=None)
        if best is not None and apart[best] < 0.5:
            stray[best] = True
    return stray


def _fits_without(
    t: Indices, at: Indices, ends: list[int], first: int, last: int, step: float
) -> bool:
    """Whether time goes on evenly where pieces first..last - 1 are left out."""
    if last >= len(ends) - 1:
        return False
    begin, end = ends[first], ends[last]
    if end - begin > _STRAYS or end - begin > min(begin, len(t) - end):
        return False
    across = float(t[end] - t[begin - 1])
    frames = int(at[end] - at[begin - 1])
    return 0 < across <= 3 * frames * step


def _joined(time_ns: Indices, missing: Flags, step: float, name: str) -> tuple[Indices, list[str]]:
    """Times in which what follows a set clock goes on from what was before."""
    at = np.flatnonzero(~missing)
    steps = np.diff(time_ns[at])
    notes: list[str] = []
    out = time_ns.copy()
    began = 0
    for b in np.flatnonzero((steps < 0) | (steps > DAY_NS)).tolist():
        before, after = int(at[b]), int(at[b + 1])
        frames = after - before
        change = int(steps[b])
        ahead = round(step * frames)
        if change > 0:
            done = f"{name} leaps by {_duration(change)} at frame {after}: the clock was set;"
        elif abs(change + DAY_NS) < max(10 * step, PAUSE_NS):
            ahead = change + DAY_NS if change + DAY_NS > 0 else ahead
            done = f"{name} passes midnight at frame {after}:"
        elif time_ns[after] <= time_ns[began] + 2 * step:
            ahead = max(ahead, PAUSE_NS)
            done = f"{name} starts again at frame {after}: several clips in one file?"
        else:
            done = f"{name} goes back by {_duration(-change)} at frame {after}: the clock was set;"
        out[after:] += ahead - change
        began = after
        notes.append(f"{done} what follows is moved to go on from there")
    return out, notes


def _filled(time_ns: Indices, missing: Flags, step: float) -> Indices:
    """Missing stamps between their neighbours, no farther apart than a step."""
    if not missing.any():
        return time_ns
    at = np.flatnonzero(~missing)
    out = time_ns.copy()
    frame = np.arange(len(time_ns))
    before = at[np.clip(np.searchsorted(at, frame, "right") - 1, 0, len(at) - 1)]
    after = at[np.clip(np.searchsorted(at, frame, "left"), 0, len(at) - 1)]
    room = (time_ns[after] - time_ns[before]).astype(np.float64)
    share = np.where(after > before, room / np.maximum(after - before, 1), step)
    share = np.minimum(share, 3 * step)
    ahead = np.round((frame - before) * share).astype(np.int64)
    out[missing] = (time_ns[before] + ahead)[missing]
    return out


def _spread(time_ns: Indices, step: float) -> Indices:
    """Runs of equal stamps spread over the time to the next."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(time_ns) != 0) + 1])
    frames = np.diff(np.concatenate([first, [len(time_ns)]]))
    even = _unrounded(time_ns, first)
    if even is not None:
        return even
    room = np.append(np.diff(time_ns[first]) / frames[:-1], step)
    apart = np.repeat(np.minimum(room, step), frames)
    place = np.arange(len(time_ns)) - np.repeat(first, frames)
    out = time_ns + np.round(place * apart).astype(np.int64)
    # of a rounded clock the first run is only the end of one
    if frames[0] > 1 and len(first) > 1 and step < room[0] < 100 * step:
        n = frames[0]
        out[:n] = time_ns[n] - np.round((n - np.arange(n)) * step).astype(np.int64)
    return np.asarray(out, dtype=np.int64)


def _unrounded(time_ns: Indices, first: Indices) -> Indices | None:
    """The even times that stamps were rounded from, where such are within the rounding."""
    n = len(time_ns)
    if n - len(first) < max(3, n // 10) or len(first) < 4:
        return None
    if len(set(np.diff(first).tolist())) == 1:  # all runs alike: shared out they are even
        return None
    place, since = np.arange(n, dtype=np.float64), (time_ns - time_ns[0]).astype(np.float64)
    grain = float(np.diff(time_ns[first]).min())
    slope, start = np.polyfit(place, since, 1)
    line = start + slope * place
    # an edge of a run may lie anywhere in the grain before or after it
    if slope < 1 or not (np.abs(line - since) <= grain).all():
        return None
    return np.asarray(time_ns[0] + np.round(line).astype(np.int64))


def _repeats(time_ns: Indices, missing: Flags, name: str) -> str:
    equal = np.diff(time_ns) <= 0
    n, repeats = len(time_ns), int(equal.sum())
    said = f"{name} is repeated in {_frames(repeats)} of {n}: spread over the time to the next"
    if n >= 8 and n % 2 == 0 and equal[::2].all() and not equal[1::2].any():
        said += " (every stamp stands twice: two hands in one?)"
    return said


def _gaps(time_ns: Indices, step: float) -> list[str]:
    steps = np.diff(time_ns)
    long = np.flatnonzero(steps > max(GAP_NS, GAP_STEPS * step))
    notes = [f"no frames for {_duration(int(steps[b]))} after frame {b}" for b in long[:3].tolist()]
    return notes + ([f"and so at {len(long) - 3} more places"] if len(long) > 3 else [])


def _frames(n: int) -> str:
    return "1 frame" if n == 1 else f"{n} frames"


def _duration(ns: int) -> str:
    seconds = ns * 1e-9
    for unit, size in (("years", 365.25 * 86400), ("days", 86400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.4g} {unit}"
    return f"{seconds:.4g} s"
