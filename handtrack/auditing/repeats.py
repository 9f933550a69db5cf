"""Frames, and fingers, that are what they were to the last digit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from handtrack.auditing.bones import marked_runs
from handtrack.auditing.findings import Finding, Marks
from handtrack.hand.skeleton import BASES
from handtrack.sequences.sequence import Sequence

_HELD = 4
"""A finger that is held for so many frames, while others move, is frozen."""
_COARSE_M = 5e-5
"""Numbers in larger steps than that come again by chance in a hand that rests."""
_STEPS = 3
"""So many of these steps it must have moved before or after."""


def frozen_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Frames that are an earlier one to the last digit, and fingers that are held."""
    seen: dict[bytes, int] = {}
    marks = np.zeros(len(s), dtype=bool)
    for t in np.flatnonzero(s.present.any(1)):
        key = (s.joints[t] + 0.0).tobytes()  # -0 is 0
        marks[t] = key in seen
        seen.setdefault(key, int(t))
    same = s.joints[1:] == s.joints[:-1]
    if marks.any():
        marks &= ~_resting(s, marks)
    numbers["repeated_percent"] = 100 * float(marks.mean())
    if marks.any():
        n = int(marks.sum())
        held = marks & np.concatenate([[False], same.any((1, 2))])
        how = "the frame before" if held.sum() > n / 2 else "an earlier frame"
        text = f"{n} frames repeat {how} to the last digit; none is let pass"
        yield Finding("frozen", text, marks[:, None] & s.present, 1 + 9 * float(marks.mean()))
    fingers = _held_fingers(s, same.all(2), marks)
    if fingers.any():
        n = int(fingers.any(1).sum())
        text = (
            f"fingers are as in the frame before to the last digit while others move, in {n}"
            f" frames; {_HELD - 1} in a row are let pass"
        )
        yield Finding("frozen", text, fingers & s.present, 1 + 9 * n / len(s))


def _step(s: Sequence) -> float:
    """The least change of a coordinate from a frame to the next [m]; 0 where none changes."""
    changes = np.abs(np.diff(s.joints[:400], axis=0))
    changes = changes[changes > 1e-9]
    return float(changes.min()) if changes.size else 0.0


def _resting(s: Sequence, marks: Marks) -> Marks:
    """(T,) which repeats are chance: coarse numbers of a hand that does not move."""
    out = np.zeros(len(s), dtype=bool)
    step = _step(s)
    if step < _COARSE_M:
        return out
    for first, last in marked_runs(marks, 1):
        around = s.joints[max(first - 1, 0) : last + 2]
        moved = np.abs(np.diff(around, axis=0))
        out[first : last + 1] = np.nanmax(moved, initial=0.0) < _STEPS * step
    return out


def _held_fingers(s: Sequence, same: Marks, frozen: Marks) -> Marks:
    """(T, 21) joints of fingers that are held in a hand that is not.

    A joint that hardly ever changes is given so, as the wrist in its own frame is.
    """
    out = np.zeros(s.present.shape, dtype=bool)
    if len(s) < 3 or _step(s) >= _COARSE_M:
        return out
    usual = same.mean(0) > 0.5
    others_move = (~same & s.present[1:] & s.present[:-1]).any(1)
    for base in BASES:
        held = same[:, base + 1 : base + 4].all(1) & others_move & ~frozen[1:]
        if usual[base + 1 : base + 4].any():
            continue
        for first, last in marked_runs(held, _HELD):
            out[first + 1 : last + 2, base : base + 4] = True
    return out
