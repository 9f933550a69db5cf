"""Stamps that are missing, rounded or repeated, spread evenly over the time that they share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]


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
    if len(first) > 3 and first[1] > 1:
        first = first[1:]  # of a rounded clock the first run is only the end of one
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
    if not usual.any():
        return float(middle)  # of two kinds of steps, as many of each
    return float((steps * frames)[usual].sum() / frames[usual].sum())


def filled(time_ns: Indices, missing: Flags, step: float) -> Indices:
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


def spread(time_ns: Indices, step: float) -> Indices:
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
    # where a new stamp begins the clock has just passed it
    slope, start = np.polyfit(place[first[1:]], since[first[1:]], 1)
    line = start + slope * place
    late = line - since
    if slope < 1 or not ((late >= -slope) & (late <= grain + slope)).all():
        return None
    return np.asarray(time_ns[0] + np.round(line).astype(np.int64))
