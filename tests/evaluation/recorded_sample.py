"""The sample's joints, and made of them what is compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handtrack.sequences.sequence import Sequence

SAMPLE = Path(__file__).resolve().parents[2] / "recordings" / "sample.npz"


def sequence(joints, fps=30.0, first=0, start_ns=0, **more):
    time_ns = start_ns + np.rint(np.arange(len(joints)) * 1e9 / fps).astype(np.int64)
    return Sequence(time_ns, joints, frame_index=first + np.arange(len(joints)), **more)
