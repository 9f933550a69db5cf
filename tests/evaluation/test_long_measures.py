"""Numbers of clips that are looked at in blocks: those of the whole."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.evaluation import anatomy, shake
from handtrack.evaluation.arrays import mean_of_frames, nan_mean
from handtrack.evaluation.motion import gaps_between
from handtrack.evaluation.stability import stability
from handtrack.files import long_arrays
from handtrack.mcap.state import Stretch
from handtrack.tracking.track import LongTrack


def test_shakes_in_blocks_are_those_of_the_whole(sample: ht.Sequence):
    rng = np.random.default_rng(4)
    joints = np.concatenate([sample.joints, sample.joints[::-1]] * 8)  # 4800 frames: two blocks
    joints = joints + rng.normal(0, 1e-3, joints.shape)
    joints[4090:4093] = np.nan
    time_ns = np.cumsum(rng.integers(15_000_000, 18_000_000, len(joints)))
    assert len(joints) > long_arrays.ROWS
    found = shake.shake_values(joints, time_ns)
    gaps = gaps_between(time_ns, len(joints))
    whole = shake._values(joints, time_ns, gaps, *shake.palm_motion(joints))
    for name, values in whole.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-7, atol=1e-9, err_msg=name)
    assert np.isfinite(found["palm_mm"]).mean() > 0.5
    np.testing.assert_allclose(mean_of_frames(joints), nan_mean(joints, 0), rtol=1e-12)


def test_a_sequence_on_disk_is_the_same(sample: ht.Sequence, monkeypatch: pytest.MonkeyPatch):
    joints = np.concatenate([sample.joints, sample.joints[::-1]] * 8)
    joints[7, 3, 1] = np.nan
    time_ns = np.arange(len(joints)) * 10_000_000
    expected = ht.Sequence(time_ns, joints)
    monkeypatch.setattr(long_arrays, "MOST", 0)
    found = ht.Sequence(time_ns, joints.astype(np.float64))
    np.testing.assert_array_equal(found.joints, expected.joints)
    np.testing.assert_array_equal(found.confidence, expected.confidence)
    assert np.isnan(found.joints[7, 3]).all()
    assert found.confidence[7, 3] == 0
    # nothing is copied or checked again
    assert replace(found, name="b").joints is found.joints
    joints[5, 2, 0] = np.inf
    with pytest.raises(ht.InputError, match="frame 5: a joint is infinite"):
        ht.Sequence(time_ns, joints)


def test_statistics_hold_little_of_a_long_track(
    sample: ht.Sequence, monkeypatch: pytest.MonkeyPatch
):
    track = ht.track(sample.frames(0, 299), calibrate=False)
    monkeypatch.setattr(long_arrays, "MOST", 0)

    def peak(repeats: int) -> int:
        made, n = LongTrack(), len(track)
        for k in range(repeats):
            arrays = track.arrays()
            for name, step in (("time_ns", 10_000_000), ("frame_index", 1)):
                arrays[name] = (np.arange(n) + k * n) * step
            made.append(Stretch(**arrays, head=track.head))
        long = made.track()
        tracemalloc.start()
        try:
            found = stability(long).overall
            assert (found.frames, found.against) == (repeats * n, "truth")
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    # a frame's joints are 504 bytes, and its values in the statistics some 30 numbers
    assert (peak(40) - peak(16)) / (24 * len(track)) < 150


def test_rows_that_are_picked(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(long_arrays, "PICKED", 3)
    monkeypatch.setattr(long_arrays, "MOST", 0)
    array, places = np.arange(40).reshape(20, 2), np.array([0, 1, 5, 7, 11, 19])
    np.testing.assert_array_equal(long_arrays.rows_of(array, places), array[places])
    assert long_arrays.rows_of(array, places[:0]).shape == (0, 2)


def test_drift_of_lengths_is_that_of_all_frames():
    rng = np.random.default_rng(0)
    joints = rng.normal(0, 0.05, (9000, 21, 3))
    joints[:5000, 7] = np.nan
    sizes = anatomy.bone_lengths(joints)
    expected = np.nanstd(sizes, 0) / np.nanmean(sizes, 0)
    np.testing.assert_allclose(anatomy.bone_length_drift(joints), expected, rtol=1e-9)
