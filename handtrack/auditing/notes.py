"""What the reader had to say of a file: faults that it cured, so that joints show them no more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from handtrack.auditing.findings import Finding
from handtrack.sequences.note import Note
from handtrack.sequences.sequence import Sequence

_SEVERITY = 4.0


def note_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """A finding for each kind that notes name: at their frames, else in all of the sequence."""
    said: dict[str, list[Note]] = {}
    for note in map(Note.of, s.notes):
        if note.about:
            said.setdefault(note.about, []).append(note)
    for about, notes in said.items():
        marks = np.zeros(s.present.shape, dtype=bool)
        for note in notes:
            # the reader counts the frames of the file
            at = np.minimum(note.frames, len(s) - 1) if note.frames else slice(None)
            marks[at] |= s.present[at]
        yield Finding(about, "; ".join(notes), marks, _SEVERITY)
