"""What the reader had to say of a file: faults that it cured, so that joints show them no more."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

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
_PLACE = re.compile(r"(?:at |the first is |\()frame ([\d, ]*\d)")
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
                marks |= s.present
                continue
            # the reader counts the frames of the file, from 0
            at = np.array([int(x) for x in place.group(1).split(", ")])
            marks[np.minimum(at, len(s) - 1)] = s.present[np.minimum(at, len(s) - 1)]
        yield Finding(kind, "; ".join(notes), marks, _SEVERITY)
