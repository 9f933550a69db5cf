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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.sequences.clock_even import filled, spread
from handtrack.sequences.note import Note

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

DAY_NS = 86_400 * 10**9
GAP_NS, GAP_STEPS = 10 * 10**9, 100
"""A time without frames that is longer than both is said."""
PAUSE_NS = 10**9
"""Between clips that stand one behind the other: longer than a filter goes on."""
_STRAYS = 8
"""So many frames in a row can be stray at most."""
_AT_END = 3
"""So many at the first or the last end."""
_NEAR = 8
"""So far from its place can a frame be that only came late."""
_BACKWARDS = 0.05
"""Where time goes back in more than this share of the steps, and stays back, sorting or
nothing helps."""
_DISORDER = 0.2
"""Where it goes back in more than this share, nothing does."""

_NAMED = 5
"""So many repeats are told one by one."""


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
        notes.append(Note(f"{_frames(moved)} of {n} were not in order of {name}: sorted", "time"))
    steps = np.diff(time_ns[~missing])
    if (steps < 0).sum() > max(3, _DISORDER * n):
        raise InputError(_disorder(name, int((steps < 0).sum()), n), path)
    if missing.any():
        text = f"{name} is missing in {_frames(int(missing.sum()))} of {n}: filled in"
        notes.append(Note(text, "time"))
    stray = _strays(time_ns, missing, step)
    if stray.any():
        at = int(np.flatnonzero(stray)[0])
        text = (
            f"{name} of {_frames(int(stray.sum()))} does not fit its neighbours (the first is"
            f" frame {at}): replaced by what lies between"
        )
        notes.append(Note(text, "time", (at,)))
        missing = missing | stray
    time_ns, said = _joined(time_ns, missing, step, name)
    back = int((np.diff(time_ns[~missing]) < 0).sum())
    if back or len(said) > max(3, _BACKWARDS * n):
        raise InputError(_disorder(name, len(said) + back, n), path)
    notes += [*said[:3], *([Note(f"and so at {len(said) - 3} more places")] if said[3:] else ())]
    time_ns = filled(time_ns, missing, step)
    equal = np.diff(time_ns) <= 0
    if equal.any():
        notes.append(_repeats(time_ns, missing, name))
        time_ns = spread(time_ns, step)
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
    leap = _leap(step)
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
    for piece, inner in ((0, ends[1]), (len(ends) - 2, ends[-2])):
        # at an end only time that goes back shows it
        begin, end = ends[piece], ends[piece + 1]
        goes_back = len(ends) > 2 and t[inner] < t[inner - 1]
        if goes_back and end - begin <= _AT_END and 10 * (end - begin) < len(t):
            stray[at[begin:end]] = True
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
        if best is not None and apart[best] < 0.55:
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


def _joined(time_ns: Indices, missing: Flags, step: float, name: str) -> tuple[Indices, list[Note]]:
    """Times in which what follows a set clock goes on from what was before."""
    at = np.flatnonzero(~missing)
    steps = np.diff(time_ns[at])
    notes: list[Note] = []
    by = np.zeros(len(time_ns), np.int64)
    offset, began = 0, 0
    set_at: tuple[int, int] | None = None
    """The last frame before the clock was set, and by how much its time was moved."""
    for b in np.flatnonzero((steps < 0) | (steps > _leap(step))).tolist():
        before, after, change = int(at[b]), int(at[b + 1]), int(steps[b])
        if 0 < change <= DAY_NS:
            if set_at is None:
                continue
            across, frames = int(time_ns[after] - time_ns[set_at[0]]), after - set_at[0]
            if 0 < across <= 3 * frames * step:  # it was set right again
                by[after] = set_at[1] - offset
                offset, began, set_at = set_at[1], after, None
            continue
        ahead, done = _went(time_ns, before, after, began, step, name)
        set_at = (before, offset)
        by[after] = ahead - change
        offset, began = offset + ahead - change, after
        notes.append(done)
    return time_ns + np.cumsum(by), notes


def _went(
    time_ns: Indices, before: int, after: int, began: int, step: float, name: str
) -> tuple[int, Note]:
    """How much later frame `after` is taken to be than frame `before` [ns], and what is said."""
    change = int(time_ns[after] - time_ns[before])
    ahead = round(step * (after - before))
    moved = " what follows is moved to go on from there"
    if change > 0:
        said = f"{name} leaps by {_duration(change)} at frame {after}: the clock was set;{moved}"
        return ahead, Note(said, "time", (after,))
    past_midnight = change + DAY_NS
    if abs(past_midnight) < max(10 * step, PAUSE_NS):
        passes = past_midnight if past_midnight > 0 else ahead
        return passes, Note(f"{name} passes midnight at frame {after}:{moved}")
    if abs(int(time_ns[after]) - int(time_ns[began])) <= 2 * step * (1 + after - before):
        restart = f"{name} starts again at frame {after}: several clips in one file?{moved}"
        return max(ahead, PAUSE_NS), Note(restart)
    said = (
        f"{name} goes back by {_duration(-change)} at frame {after}: the clock was set, or several"
        f" clips are in one file;{moved}"
    )
    return ahead, Note(said, "time", (after,))


def _leap(step: float) -> float:
    """A step beyond this is not of frames left out [ns]."""
    return max(20 * step, 1e9)


def _repeats(time_ns: Indices, missing: Flags, name: str) -> Note:
    equal = np.diff(time_ns) <= 0
    n, repeats = len(time_ns), int(equal.sum())
    said = f"{name} is repeated in {_frames(repeats)} of {n}: spread over the time to the next"
    named = (np.flatnonzero(equal) + 1).tolist() if repeats <= _NAMED else []
    if named:
        said += f" (frame {', '.join(map(str, named))})"
    if n >= 8 and n % 2 == 0 and equal[::2].all() and not equal[1::2].any():
        said += " (every stamp stands twice: two hands in one?)"
    return Note(said, "time", tuple(named))


def _gaps(time_ns: Indices, step: float) -> list[str]:
    steps = np.diff(time_ns)
    long = np.flatnonzero(steps > max(GAP_NS, GAP_STEPS * step))
    notes = [f"no frames for {_duration(int(steps[b]))} after frame {b}" for b in long[:3].tolist()]
    return notes + ([f"and so at {len(long) - 3} more places"] if len(long) > 3 else [])


def _disorder(name: str, back: int, n: int) -> str:
    return (
        f"{name} goes back {back} times in {n} frames, it is no clock (--fps N goes by the order"
        " of the frames)"
    )


def _frames(n: int) -> str:
    return "1 frame" if n == 1 else f"{n} frames"


def _duration(ns: int) -> str:
    seconds = ns * 1e-9
    for unit, size in (("years", 365.25 * 86400), ("days", 86400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * size:
            return f"{seconds / size:.4g} {unit}"
    return f"{seconds:.4g} s"
