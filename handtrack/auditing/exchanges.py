"""Fingers of one hand that are exchanged for each other in some frames."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from handtrack.auditing.findings import Finding
from handtrack.evaluation.arrays import Array, lengths
from handtrack.hand.skeleton import BASES, FINGERS
from handtrack.sequences.sequence import Sequence

_STEP_M = 0.006
"""Mean step of two fingers' joints that is let pass."""
_UNDONE = 0.5
"""And by how much smaller it is where one finger is taken for the other."""


def exchange_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Frames in which two fingers are in each other's place, told by where they were before.

    No motion brings two fingers to where the other was from one frame to the next.
    """
    if len(s) < 3:
        return
    x = s.joints - s.joints.mean(1, keepdims=True)  # whoever is whose, the middle is the same
    for a, b in combinations(range(len(BASES)), 2):
        first, second = (x[:, BASES[f] : BASES[f] + 4] for f in (a, b))
        same = _step(first, first) + _step(second, second)
        other = _step(first, second) + _step(second, first)
        turns = (same > 2 * _STEP_M) & (other < _UNDONE * same)
        if not turns.any():
            continue
        wrong = np.concatenate([[False], np.cumsum(turns) % 2 == 1])
        if 2 * wrong.sum() > len(s):
            wrong = ~wrong
        marks = np.zeros(s.present.shape, dtype=bool)
        for f in (a, b):
            marks[:, BASES[f] : BASES[f] + 4] = wrong[:, None]
        marks &= s.present
        if marks.any():
            yield Finding(
                "order",
                f"{FINGERS[a]} and {FINGERS[b]} finger are exchanged in {int(wrong.sum())} frames:"
                f" steps of {1e3 * same[turns].max() / 2:.0f} mm into each other's place",
                marks,
                4.0,
            )


def _step(after: Array, before: Array) -> Array:
    """(T - 1,) mean distance of points (T, 4, 3) from others in the frame before; NaN unseen."""
    return np.asarray(lengths(after[1:] - before[:-1]).mean(1))
