"""Errors that fade are told from those that stay, and bones are believed in spite of the first."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.calibration.calibrate import calibrate
from handtrack.calibration.fading import ALL_LASTS, Lasts, lasts
from handtrack.calibration.rounds import worth_of
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from tests.calibration.subjects import poses, sequence
from tools.bench.laid_over import fading

TIME = np.arange(300) * 33_333_333


def errors(lasts_s: float, seed: int = 0) -> np.ndarray:
    kept = float(np.exp(-1 / (30 * lasts_s))) if lasts_s else 0.0
    return 2e-3 * fading((300, 21, 3), kept, np.random.default_rng(seed))


@pytest.mark.parametrize(("lasts_s", "share"), [(0.0, 0.0), (0.1, 0.0), (0.6, 1.0), (2.0, 1.0)])
def test_errors_that_fade_are_told_from_those_that_stay(lasts_s, share):
    assert lasts(errors(lasts_s), TIME).share == pytest.approx(share, abs=0.1)


def test_gaps_are_no_neighbours_and_short_clips_say_nothing():
    assert lasts(errors(0.1)[:50], TIME[:50]) == ALL_LASTS
    assert lasts(errors(0.1), 100 * TIME) == ALL_LASTS
    some = errors(0.1)
    some[np.random.default_rng(1).random((300, 21)) < 0.4] = np.nan
    assert lasts(some, TIME).share == pytest.approx(0.0, abs=0.1)


def test_landmarks_that_lie_aside_are_seen_by_little():
    aside = 1e-3 * np.random.default_rng(2).normal(size=(21, 3))
    fades, both = lasts(errors(0.1), TIME), lasts(errors(0.1) + aside, TIME)
    assert fades.aside < 1e-8
    assert both.aside == pytest.approx(np.square(aside).mean(), rel=0.3)
    assert fades.constant_of(1e-5) < 1e-6
    assert both.constant_of(1e-5) == pytest.approx(1e-5)


def test_a_clip_is_worth_more_where_errors_fade():
    stays = worth_of(100, 10.0, 3e-3, 5e-4, None)
    fades = worth_of(100, 10.0, 3e-3, 5e-4, None, Lasts(0.0, 0.0))
    white = worth_of(100, 10.0, 5e-4, 5e-4, None)
    assert stays < 0.1 * fades < 0.1 * white
    assert 10 < 100 * fades < 50  # ten seconds of errors that are new five times in one


def test_a_hand_unlike_people_is_found_under_noise_that_fades():
    model = HandModel.default("right")
    rest = model.rest_joints.copy()
    for k in range(2, 21):
        if k % 4 == 2:  # proximal bones of half the length
            rest[k : k + 3] -= 0.5 * (model.rest_joints[k] - model.rest_joints[k - 1])
    odd = reshaped(model, rest)
    angles, turn, shift = poses(np.random.default_rng(3), 240)
    true = odd.joints(angles, turn, shift)
    noise = 1.5 * errors(0.1, 4)[: len(true)]
    found = calibrate(model, sequence(true + noise)).model
    off = np.abs(found.bone_lengths - odd.bone_lengths)
    assert 1e3 * off.mean() < 1.5
    assert 1e3 * np.abs(model.bone_lengths - odd.bone_lengths).max() > 15
