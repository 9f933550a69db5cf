"""What a calibration could gain, told without it."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.calibration.explain import explain
from handtrack.calibration.reach import reach
from tools.make.sample import motion, subject_hand

FRAMES = 60
SUBJECT, OTHER = (subject_hand(np.random.default_rng([5, i]), "right") for i in range(2))


def _clip(noise: float) -> ht.Sequence:
    rng = np.random.default_rng(3)
    truth = SUBJECT.joints(*motion(FRAMES / 15.0, 15.0, rng))
    seen = truth + rng.normal(0.0, noise, truth.shape)
    seen[rng.random(seen.shape[:2]) < 0.02] = np.nan
    return ht.Sequence(np.arange(len(truth)) * 66_666_667, seen, hand="right", name="clip")


@pytest.mark.parametrize("noise", [0.0, 3e-4, 2e-3])
@pytest.mark.parametrize("method", ["lengths", "full"])
def test_it_promises_what_a_calibration_from_another_hand_gains(noise, method):
    clip = _clip(noise)
    before = explain(OTHER, clip).fitted.rms
    own = ht.calibrate(OTHER, clip, method).model
    gained = np.log(before / explain(own, clip).fitted.rms)
    promised = np.log(before / reach(OTHER, clip, method).rms)
    # a batch takes a calibration's trouble where twice the promise would be worth it
    assert 2.0 * promised > gained > 0.05


@pytest.mark.parametrize("method", ["lengths", "full"])
def test_of_the_subjects_own_hand_it_promises_little(method):
    clip = _clip(2e-3)
    promised = np.log(explain(SUBJECT, clip).fitted.rms / reach(SUBJECT, clip, method).rms)
    assert 0.0 <= promised < 0.1
