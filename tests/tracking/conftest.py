"""A clip with gaps, and how it is tracked."""

from __future__ import annotations

import numpy as np
import pytest
from tracked_clip import FILTERS, GAPS, WAITING

import handtrack as ht


@pytest.fixture(scope="module")
def long(sample) -> ht.Sequence:
    """600 frames: the sample there and back, with a bad start and gaps, one over frame 256."""
    joints = np.concatenate([sample.joints, sample.joints[::-1]])
    for gap in GAPS:
        joints[gap] = np.nan
    rng = np.random.default_rng(3)
    joints[rng.random(joints.shape[:2]) < 0.05] = np.nan
    joints[400, 5:] = np.nan  # five joints are too few
    time_ns = np.cumsum(rng.integers(20_000_000, 50_000_000, len(joints)))
    confidence = rng.uniform(0.2, 1.0, joints.shape[:2])
    return ht.Sequence(time_ns, joints, confidence, frame_index=np.arange(7, 7 + len(joints)))


@pytest.fixture(scope="module", params=FILTERS + WAITING)
def tracked(request, long) -> ht.Track:
    return ht.track(long, filter=request.param)
