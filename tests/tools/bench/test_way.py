"""A frame can be followed with one finger: the files it enters are few, and none more come."""

from __future__ import annotations

from tools.bench.way import files, of_step, of_track


def test_a_step_enters_seven_files():
    found = files(of_step())
    assert len(found) <= 7, list(found)
    assert "kernels/frame_loop.py" in found  # compiled code is seen too


def test_from_a_sequence_to_its_recording():
    """Of short clips, so without what judges long ones."""
    found = files(of_track("--calibrate", "none", frames=400))
    assert len(found) <= 20, list(found)
    assert {"tracking/tracker.py", "recording/write.py", "mcap/stream.py"} <= set(found)
