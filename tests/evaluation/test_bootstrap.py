"""Intervals of means and standard deviations of correlated series."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.evaluation import bootstrap
from handtrack.evaluation.bootstrap import block_length, difference, intervals, student


def walk(rng, n, memory):
    """(n,) an AR(1) series of mean 0 and deviation 1."""
    from scipy.signal import lfilter

    noise = rng.normal(size=n + 300)
    return lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise)[300:]


@pytest.mark.parametrize(("memory", "low", "naive"), [(0.0, 0.9, 1.0), (0.9, 0.8, 0.5)])
def test_intervals_hold_the_truth_about_as_often_as_they_say(monkeypatch, memory, low, naive):
    """95 % are meant; resampling single frames of the correlated series gets 35 %."""
    monkeypatch.setattr(bootstrap, "REPEATS", 300)
    rng = np.random.default_rng(3)
    series = [walk(rng, 600, memory) + 5 for _ in range(120)]
    found = [intervals(x) for x in series]
    hits_mean = np.mean([i.mean.low <= 5 <= i.mean.high for i in found])
    hits_std = np.mean([i.std.low <= 1 <= i.std.high for i in found])
    assert low <= hits_mean <= 1
    assert low <= hits_std <= 1
    monkeypatch.setattr(bootstrap, "block_length", lambda values: 1)
    single = [intervals(x).mean for x in series]
    assert np.mean([i.low <= 5 <= i.high for i in single]) <= naive


def test_white_noise_as_the_textbook():
    x = np.random.default_rng(0).normal(3.0, 2.0, 4000)
    found = intervals(x)
    assert found.mean.value == pytest.approx(x.mean(), abs=1e-12)
    assert found.std.value == pytest.approx(x.std(), abs=1e-12)
    half = 1.96 * x.std() / np.sqrt(len(x))
    assert found.mean.low == pytest.approx(x.mean() - half, abs=0.15 * half)
    assert found.mean.high == pytest.approx(x.mean() + half, abs=0.15 * half)
    half = 1.96 * x.std() / np.sqrt(2 * len(x))  # of a normal's deviation
    assert found.std.high - found.std.low == pytest.approx(2 * half, rel=0.15)
    assert found.mean.clear


def test_students_quantiles():
    from scipy.stats import t

    for free in (2.0, 3.5, 6.0, 20.0, 1e6):
        assert student(0.975, free) == pytest.approx(t.ppf(0.975, free), rel=0.035)
    assert student(0.975, 8.0) == pytest.approx(t.ppf(0.975, 8.0), rel=5e-4)


def test_block_length_follows_memory():
    rng = np.random.default_rng(1)
    lengths = [np.mean([block_length(walk(rng, 4000, m)) for _ in range(8)]) for m in (0, 0.5, 0.9)]
    assert lengths[0] < 6 < lengths[1] < 40 < lengths[2] < 190
    # the optimum for an AR(1): (2 G^2 / D)^(1/3) n^(1/3), G = 2 m / (1 - m^2) at variance 1
    g, total = 2 * 0.9 / 0.1**2, 1.9 / 0.1
    best = (2 * g**2 / (4 / 3 * total**2)) ** (1 / 3) * 4000 ** (1 / 3)
    assert lengths[2] == pytest.approx(best, rel=0.35)


def test_pairing_cancels_what_is_hard_for_both():
    rng = np.random.default_rng(2)
    hard = walk(rng, 500, 0.95) * 3 + 10
    a, b = hard + rng.normal(0, 0.1, 500), hard + 0.1 + rng.normal(0, 0.1, 500)
    alone = intervals(a).mean
    paired = difference(a, b).mean
    assert paired.value == pytest.approx((a - b).mean(), abs=1e-12)
    assert paired.high - paired.low < 0.05 * (alone.high - alone.low)
    assert paired.clear
    assert paired.high < 0
    back = difference(b, a)
    assert back.mean.low == pytest.approx(-paired.high)
    assert difference(a, a).mean == bootstrap.Uncertain(0.0, 0.0, 0.0)


def test_difference_of_deviations():
    rng = np.random.default_rng(5)
    a, b = rng.normal(0, 1, 2000), rng.normal(0, 1.3, 2000)
    found = difference(a, b).std
    assert found.value == pytest.approx(a.std() - b.std(), abs=1e-12)
    assert found.clear
    assert found.low < -0.3 < found.high


def test_missing_frames_are_left_out():
    rng = np.random.default_rng(4)
    x = walk(rng, 1000, 0.5)
    holes = x.copy()
    holes[rng.random(1000) < 0.3] = np.nan
    found = intervals(holes)
    assert found.mean.value == pytest.approx(np.nanmean(holes))
    assert found.mean.low < found.mean.value < found.mean.high
    both = difference(holes, x)
    assert both.mean.value == pytest.approx(0, abs=1e-12)


def test_too_few_frames_have_no_interval():
    found = intervals([1.0, 2.0, 3.0])
    assert found.mean.value == 2
    assert np.isnan([found.mean.low, found.std.high]).all()
    assert not found.mean.clear
    assert found.mean.to_dict() == {"value": 2.0, "low": None, "high": None}
    assert np.isnan(intervals([]).mean.value)
    assert intervals([4.0] * 50).std == bootstrap.Uncertain(0.0, 0.0, 0.0)


def test_same_series_same_interval():
    x = walk(np.random.default_rng(6), 300, 0.7)
    assert intervals(x) == intervals(x.copy())


def test_shapes_must_agree():
    with pytest.raises(InputError, match="expected one of"):
        difference([1.0, 2.0], [1.0])
