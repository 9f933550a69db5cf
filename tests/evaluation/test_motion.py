"""Acceleration, jitter, acceleration error and lag."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.errors import InputError, SettingsError
from handtrack.evaluation import metrics, motion


def walk(seed=0, frames=30, joints=4):
    return np.cumsum(np.random.default_rng(seed).normal(size=(frames, joints, 3)), 0)


def stamps(steps):
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)


def test_against_loops():
    x, fps = walk(), 30.0
    acceleration, jitter = metrics.acceleration(x, fps=fps), metrics.jitter(x, fps=fps)
    assert acceleration.shape == jitter.shape == (30,)
    for t in range(30):
        if 1 <= t <= 28:
            d2 = [x[t + 1, j] - 2 * x[t, j] + x[t - 1, j] for j in range(4)]
            expected = np.mean([np.linalg.norm(v) for v in d2]) * fps**2
            assert acceleration[t] == pytest.approx(expected, rel=1e-12)
        else:
            assert np.isnan(acceleration[t])
        if 1 <= t <= 27:
            d3 = [x[t + 2, j] - 3 * x[t + 1, j] + 3 * x[t, j] - x[t - 1, j] for j in range(4)]
            expected = np.mean([np.linalg.norm(v) for v in d3]) * fps**3
            assert jitter[t] == pytest.approx(expected, rel=1e-12)
        else:
            assert np.isnan(jitter[t])


def test_hand_counted():
    # one point at 0, 0, 1, 3, 6, 10 m: second differences 1, third 1, 0, 0
    x = np.zeros((6, 1, 3))
    x[:, 0, 1] = [0, 0, 1, 3, 6, 10]
    np.testing.assert_allclose(metrics.acceleration(x, fps=2)[1:-1], 4.0)
    np.testing.assert_allclose(metrics.jitter(x, fps=2)[1:4], 0.0, atol=1e-12)
    x[5, 0, 1] = 11
    np.testing.assert_allclose(metrics.jitter(x, fps=2)[1:4], [0, 0, 8], atol=1e-12)


def test_blocks_make_no_difference(monkeypatch):
    x = walk(6, frames=50)
    x[20] = np.nan
    time_ns = stamps(np.where(np.arange(49) == 31, 90, 30) * 1_000_000)
    whole = [m(x, time_ns=time_ns) for m in (metrics.acceleration, metrics.jitter)]
    monkeypatch.setattr(motion, "_BLOCK", 7)
    for before, metric in zip(whole, (metrics.acceleration, metrics.jitter), strict=True):
        np.testing.assert_array_equal(metric(x, time_ns=time_ns), before)


def test_stamps_and_rate_agree():
    x = walk(1)
    time_ns = np.arange(30) * 10_000_000
    for metric in (metrics.acceleration, metrics.jitter):
        np.testing.assert_allclose(metric(x, time_ns=time_ns), metric(x, fps=100), rtol=1e-9)


def test_uneven_stamps_are_exact_for_polynomials():
    time_ns = stamps(np.random.default_rng(0).integers(8_000_000, 12_000_000, 40))
    t = (time_ns * 1e-9)[:, None, None]
    x = t**2 * np.array([1.0, 2.0, 2.0]) + t * 5.0 + 1.0  # second derivative 2 * 3
    np.testing.assert_allclose(metrics.acceleration(x, time_ns=time_ns)[1:-1], 6.0, rtol=1e-6)
    y = t**3 * np.array([1.0, 2.0, 2.0]) - t**2  # third derivative 6 * 3
    np.testing.assert_allclose(metrics.jitter(y, time_ns=time_ns)[1:-2], 18.0, rtol=1e-4)


def test_a_missing_frame_removes_what_touches_it():
    x = walk(2)
    x[10] = np.nan
    assert list(np.flatnonzero(np.isnan(metrics.acceleration(x, fps=30)))) == [0, 9, 10, 11, 29]
    jitter = np.flatnonzero(np.isnan(metrics.jitter(x, fps=30)))
    assert list(jitter) == [0, 8, 9, 10, 11, 28, 29]
    # a single missing joint leaves the others
    y = walk(2)
    whole = np.linalg.norm(y[9] - 2 * y[10] + y[11], axis=-1)
    y[10, 2, 0] = np.nan
    assert metrics.acceleration(y, fps=1)[10] == pytest.approx(np.delete(whole, 2).mean())


@pytest.mark.parametrize("step", [100, 5])
def test_a_gap_in_time_counts_as_missing(step):
    steps = np.full(29, 33_000_000)
    steps[14] = step * 1_000_000  # between frames 14 and 15
    time_ns = stamps(steps)
    x = walk(3)
    missing = np.flatnonzero(np.isnan(metrics.acceleration(x, time_ns=time_ns)))
    assert list(missing) == [0, 14, 15, 29]
    missing = np.flatnonzero(np.isnan(metrics.jitter(x, time_ns=time_ns)))
    assert list(missing) == [0, 13, 14, 15, 28, 29]
    missing = np.flatnonzero(np.isnan(metrics.acceleration_error(x, x, time_ns)))
    assert list(missing) == [0, 14, 15, 29]


def test_acceleration_error_as_vibe():
    a, b = walk(4), walk(5)
    d2 = [v[:-2] - 2 * v[1:-1] + v[2:] for v in (a, b)]
    expected = np.linalg.norm(d2[0] - d2[1], axis=2).mean(1)
    np.testing.assert_allclose(metrics.acceleration_error(a, b)[1:-1], expected, rtol=1e-12)


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_short_sequences(n):
    x = np.zeros((n, 4, 3))
    for metric in (metrics.acceleration, metrics.jitter):
        assert metric(x, fps=30).shape == (n,)
        assert metric(x, time_ns=np.arange(n) * 10**7).shape == (n,)
    assert np.isnan(metrics.jitter(x, fps=30)).all()
    assert np.isnan(metrics.lag(x, x))


@pytest.mark.parametrize("late", [-7.0, -2.5, 0.0, 0.3, 1.0, 3.75, 10.0])
def test_lag(late):
    t = np.arange(400) / 30.0
    rng = np.random.default_rng(0)
    f, p = rng.uniform(0.2, 1.0, (12, 1)), rng.uniform(0, 6, (12, 1))
    b = np.sin(2 * np.pi * f * t + p).T.reshape(400, 4, 3)
    a = np.sin(2 * np.pi * f * (t - late / 30) + p).T.reshape(400, 4, 3)
    assert metrics.lag(a, b) == pytest.approx(late, abs=0.02)
    a[50:60] = np.nan
    b[100] = np.nan
    assert metrics.lag(a + rng.normal(size=a.shape) * 0.05, b) == pytest.approx(late, abs=0.1)


def test_lag_with_a_gap_in_time():
    time = np.delete(np.arange(400), np.r_[150:190])
    phase = np.arange(12).reshape(4, 3)
    b = np.sin(2 * np.pi * 0.7 * time[:, None, None] / 30 + phase)
    a = np.sin(2 * np.pi * 0.7 * (time[:, None, None] - 2) / 30 + phase)
    assert metrics.lag(a, b, time_ns=time * 33_333_333) == pytest.approx(2, abs=0.02)


def test_lag_of_what_does_not_move_or_is_out_of_reach():
    still = np.ones((50, 2, 3))
    assert np.isnan(metrics.lag(still, still))
    t = np.linspace(0, 1, 200)[:, None, None] * np.ones((1, 2, 3))
    bump = np.exp(-(((t - 0.5) / 0.1) ** 2))
    assert np.isnan(metrics.lag(np.roll(bump, 40, 0), bump, max_lag=15))


def test_bad_arguments():
    x = walk()
    with pytest.raises(SettingsError, match="either"):
        metrics.acceleration(x)
    with pytest.raises(SettingsError, match="either"):
        metrics.jitter(x, fps=30, time_ns=np.arange(30))
    with pytest.raises(SettingsError, match="positive"):
        metrics.jitter(x, fps=0)
    with pytest.raises(InputError, match="30 frames"):
        metrics.jitter(x, time_ns=np.arange(29))
    with pytest.raises(InputError, match="not increase after frame 3"):
        metrics.jitter(x, time_ns=np.r_[0, 1, 2, 3, 3, np.arange(5, 30)])
    with pytest.raises(InputError, match="frames, joints, 3"):
        metrics.jitter(x[0], fps=30)
