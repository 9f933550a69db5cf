"""Calibration of a stream: better with time, then fixed, and the same for the same frames."""

from __future__ import annotations

import numpy as np
import pytest
from subjects import poses, residual_mm, sequence, subject

from handtrack.calibration.calibrate import calibrate
from handtrack.calibration.online import OnlineCalibration
from handtrack.errors import InputError, SettingsError
from handtrack.hand.model import HandModel


@pytest.fixture(scope="module")
def stream():
    rng = np.random.default_rng(0)
    true = subject(rng)
    clean = true.joints(*poses(rng, 240))
    return clean, sequence(clean + 0.001 * rng.normal(size=clean.shape))


def test_a_stream_gives_the_hand_and_then_keeps_it(stream):
    clean, seen = stream
    joints = seen.joints.copy()
    joints[50:60] = np.nan  # does not count
    online = OnlineCalibration(HandModel.default(), looks_s=(1.0, 6.0))
    found = {}
    for t, frame in enumerate(joints):
        if calibration := online.take(frame, int(seen.time_ns[t])):
            found[t] = calibration.model
            assert online.model is calibration.model
    # a second ends with the 32nd frame; the gap of eleven steps counts as a tenth of a second
    assert list(found) == [31, 189]
    assert online.frozen
    times = [time for time, _ in online.said]
    assert times == [int(seen.time_ns[t]) for t in found]
    assert "for now" in online.said[0][1]
    assert "for good, from 6.0 s" in online.said[1][1]
    first, last = (residual_mm(model, clean[::8]) for model in found.values())
    assert last < first < residual_mm(HandModel.default(), clean[::8])
    whole = calibrate(HandModel.default(), sequence(seen.joints[:32])).model
    np.testing.assert_array_equal(found[31].rest_joints, whole.rest_joints)
    online.reset()
    again = [online.take(x, int(time)) for x, time in zip(joints, seen.time_ns, strict=True)]
    np.testing.assert_array_equal(again[189].model.axes, found[189].axes)


def test_what_is_wrong_with_a_stream_is_said(stream):
    _, seen = stream
    online = OnlineCalibration(HandModel.default())
    assert online.take(seen.joints[0], 0) is None
    with pytest.raises(InputError, match="time does not increase: 0 ns and then 0 ns"):
        online.take(seen.joints[1], 0)
    with pytest.raises(InputError, match=r"shape \(20, 3\)"):
        online.take(seen.joints[1][:20], 1)
    for looks in ((), (0.0,), (2.0, 1.0)):
        with pytest.raises(SettingsError, match="looks_s"):
            OnlineCalibration(HandModel.default(), looks)
