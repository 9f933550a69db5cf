"""Intervals of means and standard deviations of correlated series."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.evaluation import bootstrap, resampling
from handtrack.evaluation.bootstrap import independent, intervals, paired_difference, student
from handtrack.evaluation.resampling import block_length


def walk(rng, n, memory):
    """(n,) an AR(1) series of mean 0 and deviation 1."""
    from scipy.signal import lfilter

    noise = rng.normal(size=n + 300)
    return lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise)[300:]


@pytest.mark.parametrize(("memory", "low", "naive"), [(0.0, 0.9, 1.0), (0.9, 0.8, 0.5)])
def test_intervals_hold_the_truth_about_as_often_as_they_say(monkeypatch, memory, low, naive):
    """95 % are meant; resampling single frames of the correlated series gets 35 %."""
    monkeypatch.setattr(resampling, "REPEATS", 300)
    rng = np.random.default_rng(3)
    series = [walk(rng, 600, memory) + 5 for _ in range(120)]
    found = [intervals(x) for x in series]
    hits_mean = np.mean([i.mean.low <= 5 <= i.mean.high for i in found])
    hits_std = np.mean([i.std.low <= 1 <= i.std.high for i in found])
    assert low <= hits_mean <= 1
    assert low <= hits_std <= 1
    monkeypatch.setattr(resampling, "block_length", lambda values: 1)
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


@pytest.mark.parametrize("blocks", [3.0, 5.5, 9.0, 60.0])
def test_few_blocks_widen_as_students_t_and_the_lost_degree_of_freedom(blocks):
    from scipy.stats import norm, t

    wanted = t.ppf(0.975, blocks - 1) / norm.ppf(0.975) * np.sqrt(blocks / (blocks - 1))
    assert bootstrap._wider(blocks) == pytest.approx(wanted, rel=0.035)


def test_quantiles_are_numpys_of_what_is_known():
    x = np.random.default_rng(11).normal(size=333)
    x[::7] = np.nan
    assert bootstrap._quantiles(x) == pytest.approx(tuple(np.nanquantile(x, [0.025, 0.975])))


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
    paired = paired_difference(a, b).mean
    assert paired.value == pytest.approx((a - b).mean(), abs=1e-12)
    assert paired.high - paired.low < 0.05 * (alone.high - alone.low)
    assert paired.clear
    assert paired.high < 0
    back = paired_difference(b, a)
    assert back.mean.low == pytest.approx(-paired.high)
    assert paired_difference(a, a).mean == bootstrap.Uncertain(0.0, 0.0, 0.0)


def test_difference_of_deviations():
    rng = np.random.default_rng(5)
    a, b = rng.normal(0, 1, 2000), rng.normal(0, 1.3, 2000)
    found = paired_difference(a, b).std
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
    both = paired_difference(holes, x)
    assert both.mean.value == pytest.approx(0, abs=1e-12)


def straight(x):
    """Politis and White's block length in the plainest way: sums over lags, one by one.

    Politis and White (2004), section 3.2, and Patton, Politis and White (2009), for the circular
    bootstrap: G = sum |k| w R_k, D = 4/3 g(0)^2, b = (2 G^2 / D)^(1/3) n^(1/3); the flat-top
    window ends at twice the lag after which K_n correlations are below 2 sqrt(log10 n / n).
    """
    n, x = len(x), np.asarray(x) - np.mean(x)
    few = max(5, int(np.ceil(np.sqrt(np.log10(n)))))
    reach = min(int(np.ceil(np.sqrt(n))) + few, n - 1)
    r = [sum(x[i] * x[i + k] for i in range(n - k)) / n for k in range(reach + 1)]
    bound = 2 * np.sqrt(np.log10(n) / n)
    memory = next(
        m
        for m in range(reach)
        if all(abs(r[m + j]) / r[0] < bound for j in range(1, few + 1) if m + j <= reach)
    )
    end = min(2 * max(memory, 1), reach)
    g = spectrum = 0.0
    for k in range(-end, end + 1):
        share = abs(k) / end
        window = 1.0 if share <= 0.5 else 2 * (1 - share)
        g += window * abs(k) * r[abs(k)]
        spectrum += window * r[abs(k)]
    d = 4 / 3 * spectrum**2
    return max(1.0, (2 * g**2 / d) ** (1 / 3) * n ** (1 / 3))


@pytest.mark.parametrize(("n", "memory"), [(200, 0.3), (400, 0.6), (900, 0.8), (300, -0.4)])
def test_block_length_is_the_formula(n, memory):
    x = walk(np.random.default_rng(n), n, memory)
    assert block_length(x) == pytest.approx(straight(x), rel=1e-9)
    assert block_length(x) > 1.5


def test_resamples_are_circular_and_as_long_as_the_series():
    """Counted by hand: 10 frames in blocks of 4 are 4 + 4 + 2, beginning anywhere, going round."""
    x = np.array([3.0, 1, 4, 1, 5, 9, 2, 6, 5, 3])
    starts = np.array([[8, 0], [3, 9], [9, 5]])
    ends = starts + np.array([[4], [4], [2]])
    mean, std = resampling._moments(resampling.Moments(x), starts, ends, 4)
    first = [5, 3, 3, 1, 1, 5, 9, 2, 3, 3]
    second = [3, 1, 4, 1, 3, 3, 1, 4, 9, 2]
    np.testing.assert_allclose(mean, [np.mean(first), np.mean(second)])
    np.testing.assert_allclose(std, [np.std(first), np.std(second)])


def test_resampled_means_vary_as_the_closed_form_says(monkeypatch):
    """Var = (2 Var(S_4) + Var(S_2)) / 100 over all beginnings: the last block is cut to 2."""
    monkeypatch.setattr(resampling, "REPEATS", 40_000)
    x = np.array([3.0, 1, 4, 1, 5, 9, 2, 6, 5, 3])
    ((mean, _),) = resampling.resamples([resampling.Moments(x)], 4)
    sums = {b: [np.roll(x, -s)[:b].sum() for s in range(10)] for b in (4, 2)}
    expected = (2 * np.var(sums[4]) + np.var(sums[2])) / 100
    # going round, every frame is drawn as often: no bias
    assert mean.mean() == pytest.approx(x.mean(), abs=5 * np.sqrt(expected / 40_000))
    assert mean.var() == pytest.approx(expected, rel=0.04)
    ((mean, _),) = resampling.resamples([resampling.Moments(np.full(10, 2.5))], 4)
    assert (mean == 2.5).all()


def test_errors_have_no_interval_below_zero():
    """Means and deviations of rare large errors, where the basic interval reaches below 0."""
    rng = np.random.default_rng(8)
    below = 0
    for n in (12, 20, 40, 90):
        for _ in range(60):
            x = rng.exponential(1.0, n) ** 3 * (rng.random(n) < 0.3)
            found = intervals(x)
            if found.few:
                continue
            assert 0 <= found.mean.low <= found.mean.value <= found.mean.high
            assert 0 <= found.std.low <= found.std.value <= found.std.high
            basic = bootstrap._around(x.mean(), rng.choice(x, (500, n)).mean(1), n)
            below += basic.low < 0
    assert below > 20  # the case is there


@pytest.mark.parametrize(("n", "memory"), [(20, 0.95), (30, 0.97), (60, 0.99), (90, 0.99)])
def test_short_clips_that_hang_together_have_no_false_interval(n, memory):
    """Of 100 clips an interval would hold the true mean in few; those shown are few."""
    rng = np.random.default_rng(n)
    missed = 0
    for _ in range(100):
        x = np.exp(0.5 * walk(rng, n, memory))
        found = intervals(x)
        if found.few:
            assert np.isnan([found.mean.low, found.mean.high, found.std.low]).all()
            assert "too few for an interval" in found.few
            assert found.mean.value == pytest.approx(x.mean())
        else:
            missed += not found.mean.low <= np.exp(0.125) <= found.mean.high
    assert missed <= 20


def test_a_drift_is_too_few_blocks():
    found = intervals(np.linspace(1, 9, 120))
    assert "too few for an interval" in found.few
    assert intervals(np.linspace(1, 9, 120) + np.random.default_rng(0).normal(0, 0.01, 120)).few
    both = paired_difference(np.linspace(1, 3, 30), np.linspace(1, 3, 30)[::-1])
    assert not both.mean.clear


def test_independent_frames_of_an_autoregression():
    """n (1 - r) / (1 + r), in the median over series."""
    rng = np.random.default_rng(9)
    for n, memory in ((120, 0.0), (300, 0.5), (300, 0.9), (1000, 0.95)):
        found = np.median([independent(walk(rng, n, memory)) for _ in range(60)])
        assert found == pytest.approx(n * (1 - memory) / (1 + memory), rel=0.25)


def test_too_few_frames_have_no_interval():
    found = intervals([1.0, 2.0, 3.0])
    assert found.mean.value == 2
    assert np.isnan([found.mean.low, found.std.high]).all()
    assert not found.mean.clear
    assert found.few == "3 frames are too few for an interval"
    assert found.mean.to_dict() == {"value": 2.0, "low": None, "high": None}
    assert np.isnan(intervals([]).mean.value)
    assert intervals([4.0] * 50).std == bootstrap.Uncertain(0.0, 0.0, 0.0)


def test_same_series_same_interval():
    x = walk(np.random.default_rng(6), 300, 0.7)
    assert intervals(x) == intervals(x.copy())


def test_shapes_must_agree():
    with pytest.raises(InputError, match="expected one of"):
        paired_difference([1.0, 2.0], [1.0])
