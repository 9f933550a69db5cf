"""A clip with gaps, and how it is tracked."""

from __future__ import annotations

import numpy as np

import handtrack as ht
from handtrack.tracking.frame import TrackedFrame

FILTERS = ("none", "kalman", "one-euro")


WAITING = ("fixed-lag", "rts")


GAPS = (slice(0, 2), slice(100, 101), slice(250, 260), slice(300, 320))


def stream(tracker: ht.Tracker, sequence: ht.Sequence) -> list[TrackedFrame]:
    frames = []
    for x, t, c in zip(sequence.joints, sequence.time_ns, sequence.confidence, strict=True):
        frames += tracker.push(x, t, c)
    return frames + tracker.finish()


def same(a: object, b: object) -> None:
    """Equal to the last bit, NaN included."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    assert a.dtype.kind == b.dtype.kind
    np.testing.assert_array_equal(a, b)
