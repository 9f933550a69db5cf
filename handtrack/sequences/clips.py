"""Clips that stand one behind the other in one file: where time begins again, they are cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.clock_even import typical_step
from handtrack.sequences.clock_text import NotTimeError, as_numbers
from handtrack.sequences.readers.raw import Raw, take_rows

SHORTEST = 5
"""Frames of a clip; what is shorter is a fault of the clock."""
_BACK = 8
"""Steps that time goes back at least; less is a frame that came late."""
_GAP = 20
"""Steps that a clip does not begin with."""
_LEAP = 4.0
"""A hand that is elsewhere by so many of its larger steps was filmed at another time."""


def clips_of(raws: list[Raw]) -> list[list[Raw]]:
    """The hands of one source, clip by clip; one list where it is one clip.

    A clip begins where time, or without times the frames' numbers, go back to where the clip
    before began; or go back by more than some frames while the hand leaps, so that no clock was
    merely set.
    """
    begins = [_begins(raw) for raw in raws]
    count = max(len(b) for b in begins)
    if count == 1:
        return [raws]
    clips: list[list[Raw]] = [[] for _ in range(count)]
    for raw, begin in zip(raws, begins, strict=True):
        ends = [*begin[1:], len(raw.joints)]
        for k, (first, last) in enumerate(zip(begin, ends, strict=True)):
            part = take_rows(raw, np.arange(first, last))
            clips[k].append(replace(part, name=f"{raw.name} clip {k + 1}"))
    what = "time begins" if raws[0].stamps is not None else "frame numbers begin"
    longest = max(begins, key=len)
    places = ", ".join(map(str, longest[1:4])) + (" ..." if len(longest) > 4 else "")
    first_one = clips[0][0]
    note = f"{what} again at frame {places}: cut into {count} clips"
    clips[0][0] = replace(first_one, notes=(note, *first_one.notes))
    return clips


def _begins(raw: Raw) -> list[int]:
    """The first row of each clip."""
    values = _times(raw)
    if values is None or len(values) < 2 * SHORTEST:
        return [0]
    missing = ~np.isfinite(values)
    if missing.any():
        return [0]
    back = np.flatnonzero(np.diff(values) < 0) + 1
    step = typical_step(values, missing)
    if not len(back) or not step > 0 or len(back) > len(values) / SHORTEST:
        return [0]
    begins = [0]
    for row in back.tolist():
        again = abs(values[row] - values[begins[-1]]) <= 2 * step
        by = values[row - 1] - values[row]
        if np.diff(values[row : row + SHORTEST]).max(initial=0.0) > _GAP * step:
            continue  # a stray stamp
        if again or (by > _BACK * step and _leaps(raw.joints, row, back)):
            begins.append(row)
    lengths = np.diff([*begins, len(values)])
    whole = all(
        (np.diff(values[a:b]) < 0).sum() * 20 <= b - a
        for a, b in zip(begins, [*begins[1:], len(values)], strict=True)
    )
    return begins if lengths.min() >= SHORTEST and whole else [0]


def _times(raw: Raw) -> NDArray[np.float64] | None:
    """The frames' times in any unit, or their numbers; None where there are none."""
    if raw.time_ns is not None:
        return None  # our own recordings are sure of theirs
    if raw.stamps is None:
        return None if raw.frame_index is None else raw.frame_index.astype(np.float64)
    try:
        values = as_numbers(raw.stamps.values, raw.fps).values
    except NotTimeError:
        return None  # the clock says what is wrong
    if np.shape(values) != (len(raw.joints),):
        return None
    values = np.asarray(values)
    if values.dtype.kind == "i":
        values = values - values[0]  # nanoseconds of today do not fit in a float
    return values.astype(np.float64)


def _leaps(joints: NDArray[np.float64], row: int, others: NDArray[np.int64]) -> bool:
    """Whether the hand is elsewhere than it could have gone to from one frame to the next; `others`
    are rows at which it may leap too."""
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.linalg.norm(np.diff(joints, axis=0), axis=-1)
    here = steps[row - 1][np.isfinite(steps[row - 1])]
    usual = np.delete(steps, others - 1, axis=0)
    usual = usual[np.isfinite(usual)]
    if not len(here) or not len(usual):
        return False
    return bool(np.median(here) > _LEAP * np.percentile(usual, 90) > 0)


def runs(frame: NDArray[np.int64]) -> list[tuple[int, int]]:
    """First and one past the last row of each clip, of rows whose frames begin again; none where
    they do not, or too often for clips.

    Args:
        frame: (rows,) of each row the frame's number.
    """
    begins = [0, *(np.flatnonzero(np.diff(frame) < 0) + 1).tolist()]
    found = list(zip(begins, [*begins[1:], len(frame)], strict=True))
    if len(found) < 2 or len(found) > len(frame) / SHORTEST:
        return []
    return found if all(len(np.unique(frame[a:b])) >= SHORTEST for a, b in found) else []
