"""Shakes that are put in are found: the hand's as a whole apart from its fingers'."""

from __future__ import annotations

import json
from dataclasses import fields

import numpy as np
import pytest
from recorded_sample import SAMPLE

import handtrack as ht
from handtrack.cli import run
from handtrack.evaluation import metrics
from handtrack.evaluation.shake import Shake, bends, palm_motion, shake, shake_values
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import PALM

N = 240
TIME = (np.arange(N) * 1e9 / 30).astype(np.int64)
# what is left of white noise: a parabola through 11 values follows 89/429 of its variance
LEFT = np.sqrt(1 - 89 / 429)


@pytest.fixture(scope="module")
def still():
    model = HandModel.default("left")
    angles = np.full(20, 0.35)
    turn = about_axis(np.array([2.0, 2.0, -1.0]) / 3, np.array(1.9))
    return np.tile(model.joints(angles, turn, np.array([0.4, -1.0, 2.0])), (N, 1, 1))


def test_a_still_hand_does_not_shake(still):
    found = shake(still, TIME)
    assert max(found.to_dict().values()) < 1e-6


def test_the_whole_hand_is_moved(still):
    rng = np.random.default_rng(0)
    found = shake(still + rng.normal(0, 0.002, (N, 1, 3)), TIME)
    assert found.palm_mm == pytest.approx(2 * np.sqrt(3) * LEFT, rel=0.06)
    assert found.palm_jitter_m_s3 > 10
    assert max(found.palm_deg, found.fingers_deg, found.fingers_mm) < 1e-5
    assert found.fingers_jitter_m_s3 < 1e-6


def test_the_whole_hand_is_turned_about_its_palm(still):
    rng = np.random.default_rng(1)
    middle = still[0, PALM].mean(0)
    axis = np.array([0.2, 1.0, -0.4]) / np.sqrt(1.2)
    turns = about_axis(axis, rng.normal(0, np.radians(3.0), N))
    turned = np.einsum("tij,tkj->tki", turns, still - middle) + middle
    found = shake(turned, TIME)
    assert found.palm_deg == pytest.approx(3 * LEFT, rel=0.1)
    assert max(found.palm_mm, found.fingers_deg, found.fingers_mm) < 1e-5


def test_only_the_fingers_bend(still):
    rng = np.random.default_rng(2)
    model = HandModel.default("left")
    angles = np.full((N, 20), 0.35)
    angles[:, [6, 7]] += rng.normal(0, np.radians(4.0), (N, 2))  # index PIP and DIP
    x = model.joints(angles)
    found = shake(x, TIME)
    assert max(found.palm_mm, found.palm_deg) < 1e-6
    # two of 15 bends move by 4 degrees
    assert found.fingers_deg == pytest.approx(4 * LEFT * np.sqrt(2 / 15), rel=0.1)
    assert found.fingers_mm > 0.5


def test_slow_motion_is_no_shake(still):
    t = np.arange(N) / 30
    slow = still + 0.2 * np.sin(2 * np.pi * 0.2 * t)[:, None, None]
    assert shake(slow, TIME).palm_mm < 1.0


def test_the_values_are_those_of_loops(still):
    rng = np.random.default_rng(3)
    x = still + rng.normal(0, 0.003, still.shape)
    middle, _ = palm_motion(x)
    values = shake_values(x, TIME)
    for t in (5, 77, N - 6):
        around = np.arange(-5, 6)
        curve = np.array(
            [np.polyval(np.polyfit(around, middle[t + around, i], 2), 0) for i in range(3)]
        )
        assert values["palm_mm"][t] == pytest.approx(1e3 * np.linalg.norm(middle[t] - curve))
    assert np.isnan(values["palm_mm"][[0, 4, N - 5, N - 1]]).all()
    bent = bends(x)
    a, b = x[9, 6] - x[9, 5], x[9, 7] - x[9, 6]
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    assert bent[9, 4] == pytest.approx(angle)


def test_gaps_break_the_mean(still):
    x = still.copy()
    x[100:] += 0.05  # a jump, hidden in a gap of time
    time = TIME.copy()
    time[100:] += 10**9
    assert shake(x, time).palm_mm < 1e-6
    assert shake(x, TIME).palm_mm > 1.0
    x[100, PALM] = np.nan
    values = shake_values(x, TIME)
    assert np.isnan(values["palm_mm"][95:106]).all()
    assert np.isfinite(values["palm_mm"][94])


def test_too_short_or_unseen(still):
    assert all(v is None for v in shake(still[:10], TIME[:10]).to_dict().values() if v != 0)
    assert np.isnan(shake(np.full_like(still, np.nan), TIME).palm_mm)
    with pytest.raises(ht.InputError, match="20 joints"):
        shake(still[:, :20], TIME)


def test_stability_tells_the_shakes_of_input_output_and_truth(sample):
    track = ht.track(sample, filter="rts")
    (row,) = ht.stability(track).sequences
    assert isinstance(row.shake, Shake)
    assert row.shake == shake(
        np.where(track.measured_joints[:, None], track.filtered_joints, np.nan), track.time_ns
    )
    assert row.input_shake.fingers_mm > 1.5 * row.shake.fingers_mm
    assert row.input_shake.fingers_deg > 1.5 * row.shake.fingers_deg
    assert row.truth_shake.fingers_mm < row.input_shake.fingers_mm
    told = row.to_dict()
    assert told["shake"] == row.shake.to_dict()
    assert told["truth_shake"] == row.truth_shake.to_dict()
    two = ht.stability([track, track])
    assert two.overall.shake.palm_mm == pytest.approx(row.shake.palm_mm)


def passed(turn):
    """Share of a wave of so many radians a frame that parabolas through 11 frames leave.

    The least squares by NumPy, not the weights that are used.
    """
    k = np.arange(-5, 6)
    weights = np.linalg.pinv(np.vander(k, 3))[-1]
    return 1 - float(weights @ np.cos(turn * k))


@pytest.mark.parametrize("frames", [4, 7.5, 12, 40])
def test_a_wave_of_the_whole_hand_in_closed_form(still, frames):
    turn, size = 2 * np.pi / frames, 0.003
    wave = size * np.sin(turn * np.arange(N) + 0.3)
    found = shake(still + wave[:, None, None] * np.array([0.0, 0.6, 0.8]), TIME)
    left = 1e3 * size * abs(passed(turn)) / np.sqrt(2)
    assert found.palm_mm == pytest.approx(left, rel=0.03, abs=1e-3)
    steps = size * (2 * np.sin(turn / 2)) ** 3 * 30**3  # of third differences
    mean = np.abs(np.cos(turn * (np.arange(N) - 1.5) + 0.3)).mean()
    assert found.palm_jitter_m_s3 == pytest.approx(steps * mean, rel=0.03)
    assert max(found.palm_deg, found.fingers_deg, found.fingers_mm) < 1e-5


@pytest.mark.parametrize("frames", [5, 9])
def test_a_wave_of_one_bend_in_closed_form(frames):
    turn, size = 2 * np.pi / frames, 4.0
    angles = np.full((N, 20), 0.5)
    angles[:, 7] += np.radians(size) * np.sin(turn * np.arange(N) + 0.2)  # index DIP
    found = shake(HandModel.default("right").joints(angles), TIME)
    assert max(found.palm_mm, found.palm_deg) < 1e-6
    left = size * passed(turn) / np.sqrt(2) / np.sqrt(15)  # one of 15 bends
    assert found.fingers_deg == pytest.approx(left, rel=0.03)


def test_acceleration_error_of_a_wave_in_closed_form(still):
    turn, size = 2 * np.pi / 9, 0.002
    wave = size * np.sin(turn * np.arange(N))
    moved = still + wave[:, None, None] * np.array([1.0, 0.0, 0.0])
    found = np.nanmean(metrics.acceleration_error(moved, still))
    # of second differences, not divided by the squared step, as the field has it
    expected = (2 * np.sin(turn / 2)) ** 2 * np.abs(wave[1:-1]).mean()
    assert found == pytest.approx(expected, rel=1e-9)


def test_the_commands_json_has_every_number(capsys):
    assert run(["stability", str(SAMPLE), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["sequences"]
    names = {f.name for f in fields(Shake)}
    for key in ("shake", "truth_shake"):
        assert set(row[key]) == names
        assert all(isinstance(v, float) for v in row[key].values())
    assert isinstance(row["acceleration_error_mm"], float)
