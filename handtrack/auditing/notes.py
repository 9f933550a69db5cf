"""What the reader had to say of a file: faults that it cured, so that joints show them no more."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.auditing.findings import Finding
from handtrack.sequences.sequence import Sequence

_SAID = (
    ("unit", r"taken for another unit: "),
    ("unit", r"^the palm is \d+ mm long"),
    ("order", r"another joint order: "),
    ("order", r"^the bones are a hand's in the joint order"),
    ("order", r"hardly fit better than those of a random order"),
    ("time", r" goes (back|forward) by "),
    ("time", r" were not in order of "),
    ("time", r" does not fit its neighbours"),
    ("time", r" is missing in \d[\d,]* frames? of "),
    ("time", r" is repeated in \d"),
    ("time", r" would make .* frames/s: read as "),
    ("time", r"^fps is .* in the file, .* makes "),
    ("time", r" is the same in every frame"),
    ("time", r"^frame numbers leap "),
)
"""Of what kind a note is, by its words (`sequences.clock`, `joint_order`, `size`)."""
_PLACE = re.compile(r"at frame (\d+)|the first is frame (\d+)")
_FEW = re.compile(r" is repeated in | is missing in ")
"""What is of some frames: those whose steps of time are no others'."""
_SEVERITY = 4.0


def cured_unit(unit: str, why: str) -> str:
    """The note of a sequence that was read in another unit than its file says."""
    return f"taken for another unit: read in {unit}; {why}"


def cured_order(order: str, why: str) -> str:
    """The note of a sequence that was read in another joint order than its file says."""
    return f"another joint order: read as {order}; {why}"


def note_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """A finding for each kind that notes name: at their frame, else in all of the sequence."""
    said: dict[str, list[str]] = {}
    for note in s.notes:
        kind = next((k for k, words in _SAID if re.search(words, note)), None)
        if kind is not None:
            said.setdefault(kind, []).append(note)
    for kind, notes in said.items():
        marks = np.zeros(s.present.shape, dtype=bool)
        for note in notes:
            place = _PLACE.search(note)
            if place is None:
                at = _unusual(s) if _FEW.search(note) else np.zeros(0, dtype=np.int64)
                marks |= s.present if not at.size else np.isin(np.arange(len(s)), at)[:, None]
                continue
            # the reader counts the frames of the file, from 0
            t = min(int(place.group(1) or place.group(2)), len(s) - 1)
            marks[t] |= True
        yield Finding(kind, "; ".join(notes), marks, _SEVERITY)


def _unusual(s: Sequence) -> NDArray[np.int64]:
    """Frames after a step of time that is no usual one: a stamp that was repeated halves it."""
    steps = np.diff(s.time_ns)
    usual = np.median(steps) if len(steps) else 0
    return np.flatnonzero((steps < 0.75 * usual) | (steps > 1.5 * usual)) + 1
