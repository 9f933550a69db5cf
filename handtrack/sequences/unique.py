"""Different names for the sequences of several files."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

from handtrack.sequences.sequence import Sequence


def unique_names(sequences: list[Sequence]) -> list[Sequence]:
    """The same, with the folder's name in front of names that several have, or else a number."""
    count = Counter(s.name for s in sequences)
    named = [
        replace(s, name=f"{Path(s.source).resolve().parent.name} {s.name}")
        if count[s.name] > 1
        else s
        for s in sequences
    ]
    count = Counter(s.name for s in named)
    number: Counter[str] = Counter()
    for i, sequence in enumerate(named):
        if count[sequence.name] > 1:
            number[sequence.name] += 1
            named[i] = replace(sequence, name=f"{sequence.name} {number[sequence.name]}")
    return named
