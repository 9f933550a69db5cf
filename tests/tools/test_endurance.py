"""The endurance run, a small part of it: every frame is looked at, memory and time are counted."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.tracking.tracker import Tracker
from tools.bench import endurance


@pytest.mark.parametrize("name", endurance.CAUSAL)
def test_a_while_of_each_filter(name: str) -> None:
    parts = endurance.endure(name, 2500)
    assert len(parts) == endurance.PARTS
    assert all(0.95 < part.fitted <= 1.0 for part in parts)
    # arrays of a frame that were kept would be 3 MB a thousand frames
    assert parts[-1].memory - parts[3].memory < 2.0


def test_a_pose_that_is_no_number_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    step = Tracker.step

    def wrong(self: Tracker, joints: np.ndarray, time_ns: int) -> object:
        frame = step(self, joints, time_ns)
        object.__setattr__(frame, "angles", np.full(20, np.nan))
        return frame

    monkeypatch.setattr(Tracker, "step", wrong)
    with pytest.raises(ArithmeticError, match="none, frame 0: fitted, pose"):
        endurance.endure("none", 20)
