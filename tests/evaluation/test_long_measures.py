"""Numbers of clips that are looked at in blocks: those of the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.evaluation import shake
from handtrack.evaluation.arrays import mean_of_frames, nan_mean
from handtrack.evaluation.motion import gaps_between
from handtrack.files import long_arrays


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
