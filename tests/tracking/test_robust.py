"""Robust losses in the tracker, through the filter too."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht


@pytest.mark.parametrize("filter", ["none", "kalman"])
def test_a_joint_that_is_off_bends_the_hand_little(filter, sample):
    model = ht.calibrate(ht.HandModel.default("right"), sample).model
    joints, rng = sample.joints[:120].copy(), np.random.default_rng(5)
    # a finger joint, another one in each frame, 6 cm off
    off = rng.normal(size=(120, 3))
    joints[np.arange(120), rng.integers(1, 21, 120)] += (
        0.06 * off / np.linalg.norm(off, axis=1)[:, None]
    )
    dirty = ht.Sequence(sample.time_ns[:120], joints)
    error = {}
    for robust in ("none", "geman-mcclure"):
        track = ht.track(dirty, model, calibrate="none", filter=filter, gate=False, robust=robust)
        assert track.settings["robust"] == robust
        assert track.settings["spread_mm"] == 10.0
        distance = np.linalg.norm(track.filtered_joints - sample.truth[:120], axis=-1)
        error[robust] = np.nanmean(distance)
    assert error["geman-mcclure"] < 0.75 * error["none"]


def test_settings_that_make_no_sense():
    model = ht.HandModel.default("right")
    for bad in ({"robust": "x"}, {"spread_mm": 0.0}, {"spread_mm": np.nan}, {"noise_mm": -1.0}):
        with pytest.raises(ht.SettingsError, match=next(iter(bad))):
            ht.Tracker(model, filter="kalman", **bad)


def test_variances_are_those_of_the_noise_given(sample):
    model = ht.calibrate(ht.HandModel.default("right"), sample).model
    one, two = (ht.Tracker(model, noise_mm=mm).step(sample.joints[0], 0) for mm in (2.0, 4.0))
    np.testing.assert_allclose(two.angle_variance, 4 * one.angle_variance, rtol=1e-12)
    np.testing.assert_array_equal(one.angles, two.angles)
