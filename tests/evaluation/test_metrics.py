"""Position errors, PCK, AUC and F-scores against hand-counted tables and plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from handtrack.evaluation import metrics


def hands(seed=0, frames=40, joints=21, noise=0.01):
    rng = np.random.default_rng(seed)
    b = rng.normal(size=(frames, joints, 3)) * 0.05
    return b + rng.normal(size=b.shape) * noise, b


def test_public_name():
    assert ht.metrics.pa_mpjpe is metrics.pa_mpjpe
    assert all(hasattr(metrics, name) for name in metrics.__all__)


def test_mpjpe_hand_counted():
    # errors of the joints: frame 0: 3, 4, 5; frame 1: 0, 1, missing; frame 2: all missing
    b = np.zeros((3, 3, 3))
    a = np.zeros((3, 3, 3))
    a[0, 0, 0], a[0, 1, 1], a[0, 2] = 3, -4, (0, 3, 4)
    a[1, 1, 2] = 1
    a[1, 2, 0] = np.nan
    b[2] = np.nan
    np.testing.assert_array_equal(metrics.mpjpe(a, b), [4.0, 0.5, np.nan])
    np.testing.assert_array_equal(metrics.mpvpe(a, b), [4.0, 0.5, np.nan])
    np.testing.assert_array_equal(metrics.per_joint(a, b), [1.5, 2.5, 5.0])


def test_one_frame_without_a_time_axis():
    a, b = hands()
    assert metrics.mpjpe(a[3], b[3]) == metrics.mpjpe(a, b)[3]
    assert metrics.pa_mpjpe(a[3], b[3]) == pytest.approx(metrics.pa_mpjpe(a, b)[3], abs=1e-15)


def test_root_aligned():
    a, b = hands()
    moved = b + np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(metrics.root_aligned_mpjpe(moved, b), 0, atol=1e-15)
    loops = [
        np.mean([np.linalg.norm((a[t, j] - a[t, 9]) - (b[t, j] - b[t, 9])) for j in range(21)])
        for t in range(len(a))
    ]
    np.testing.assert_allclose(metrics.root_aligned_mpjpe(a, b, root=9), loops, atol=1e-14)
    a[4, 0] = np.nan
    assert np.isnan(metrics.root_aligned_mpjpe(a, b)[4])


def test_breakdown():
    b = np.zeros((2, 21, 3))
    a = b.copy()
    a[:, 0, 0] = 1
    a[:, 1:5, 1] = 2
    a[0, 5:9, 2] = 4
    a[1, 5:9] = np.nan
    a[:, 17:21] = np.nan
    found = metrics.per_finger(a, b)
    assert list(found) == ["wrist", "thumb", "index", "middle", "ring", "little"]
    assert [found[k] for k in ("wrist", "thumb", "index", "middle", "ring")] == [1, 2, 4, 0, 0]
    assert np.isnan(found["little"])


def test_pck_and_auc_hand_counted():
    # one joint, errors 1, 2, 3, 4 of range 0..4: the curve at 0, 1, 2, 3, 4 is 0, 1/4, ..., 1
    b = np.zeros((4, 1, 3))
    a = b.copy()
    a[:, 0, 0] = [1, 2, 3, 4]
    curve = metrics.pck(a, b, [0, 1, 2, 3, 4])
    np.testing.assert_array_equal(curve, [[0, 0.25, 0.5, 0.75, 1.0]])
    assert metrics.auc(a, b, 0, 4, 5) == pytest.approx(0.5)
    # a second joint that is never seen does not count, one without error does
    wide = np.concatenate([a, np.full_like(a, np.nan), b], 1)
    zeros = np.zeros_like(wide)
    assert np.isnan(metrics.pck(wide, zeros, [1.0])[1]).all()
    assert metrics.auc(wide, zeros, 0, 4, 5) == pytest.approx(0.75)


def freihand_auc(a, b, low, high, steps):
    """As FreiHAND's EvalUtil.get_measures, joint by joint."""
    thresholds = np.linspace(low, high, steps)
    norm = np.trapezoid(np.ones_like(thresholds), thresholds)
    areas = []
    for j in range(a.shape[1]):
        d = np.linalg.norm(a[:, j] - b[:, j], axis=1)
        d = d[~np.isnan(d)]
        if len(d):
            pck = [np.mean((d <= t).astype(float)) for t in thresholds]
            areas.append(np.trapezoid(pck, thresholds) / norm)
    return np.mean(areas)


@pytest.mark.parametrize("span", [metrics.FREIHAND_RANGE, metrics.RHD_RANGE, (0.0, 0.03)])
def test_auc_as_freihand(span):
    a, b = hands(1, 60, noise=0.02)
    a[::3, 5] = np.nan
    b[:, 7] = np.nan
    assert metrics.auc(a, b, *span) == pytest.approx(freihand_auc(a, b, *span, 100), abs=1e-12)


def freihand_f(p, q, threshold):
    """Nearest neighbours by brute force."""
    d = np.linalg.norm(p[:, None] - q[None], axis=-1)
    precision, recall = np.mean(d.min(1) < threshold), np.mean(d.min(0) < threshold)
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def test_f_score():
    rng = np.random.default_rng(3)
    a, b = rng.uniform(0, 0.1, (5, 80, 3)), rng.uniform(0, 0.1, (5, 60, 3))
    expected = [[freihand_f(a[t], b[t], h) for h in (0.005, 0.015)] for t in range(5)]
    np.testing.assert_allclose(metrics.f_score(a, b), expected, atol=1e-12)
    assert metrics.f_score(a, b, 0.015).shape == (5,)
    a[2] = np.nan
    a[3, 10:] = np.nan
    out = metrics.f_score(a, b)
    assert np.isnan(out[2]).all()
    assert out[3, 1] == pytest.approx(freihand_f(a[3, :10], b[3], 0.015))
    # hand-counted: 2 of 4 estimated points are near, 2 of 2 reference points are: F = 2/3
    q = np.array([[[0, 0, 0], [1, 0, 0]]], float)
    p = np.array([[[0, 0, 0], [1, 0, 0], [5, 0, 0], [6, 0, 0]]], float)
    assert metrics.f_score(p, q, 0.5)[0] == pytest.approx(2 / 3)
    assert metrics.f_score(p, q + 100, 0.5)[0] == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(1e-3, 1e3))
def test_units_carry_over(seed, unit):
    a, b = hands(seed, 4)
    for metric in (metrics.mpjpe, metrics.root_aligned_mpjpe, metrics.pa_mpjpe):
        np.testing.assert_allclose(metric(a * unit, b * unit), metric(a, b) * unit, rtol=1e-9)


def test_bad_arguments():
    a, b = hands()
    with pytest.raises(InputError, match=r"\(40, 21, 3\).*\(39, 21, 3\)"):
        metrics.mpjpe(a, b[1:])
    with pytest.raises(InputError, match="expected \\(frames, joints, 3\\)"):
        metrics.mpjpe(a[..., :2], b[..., :2])
    a[0, 0, 0] = np.inf
    with pytest.raises(InputError, match="infinite"):
        metrics.pa_mpjpe(a, b)
    with pytest.raises(SettingsError, match="AUC"):
        metrics.auc(b, b, 0.05, 0.05)
    with pytest.raises(InputError, match="expected 21"):
        metrics.per_finger(b[:, :20], b[:, :20])
    with pytest.raises(InputError, match="reference"):
        metrics.f_score(b, b[1:])


def test_no_frames():
    none = np.zeros((0, 21, 3))
    for metric in (metrics.mpjpe, metrics.pa_mpjpe, metrics.root_aligned_mpjpe):
        assert metric(none, none).shape == (0,)
    assert np.isnan(metrics.auc(none, none))


def test_arguments_are_not_changed():
    a, b = hands()
    a[0, 0, 0] = np.nan
    a0, b0 = a.copy(), b.copy()
    for name in ("errors", "mpjpe", "pa_mpjpe", "align", "pck", "f_score", "acceleration_error"):
        getattr(metrics, name)(a, b)
    np.testing.assert_array_equal(a, a0)
    np.testing.assert_array_equal(b, b0)
