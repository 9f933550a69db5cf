"""Bone lengths, limits, angle errors and self-intersection."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from handtrack.errors import InputError, SettingsError
from handtrack.evaluation import metrics
from handtrack.hand.capsules import segment_distance
from handtrack.hand.limits import preset
from handtrack.hand.model import HandModel


def test_bone_length_drift():
    x = np.zeros((4, 3, 3))
    x[:, 1, 0] = [1, 1, 1, 1]
    x[:, 2, 0] = [3, 2, 4, 3]  # bone 1-2: 2, 1, 3, 2: mean 2, std sqrt(1/2)
    drift = metrics.bone_length_drift(x, [(0, 1), (1, 2)])
    np.testing.assert_allclose(drift, [0, np.sqrt(0.5) / 2])
    x[3, 2] = np.nan  # 2, 1, 3
    np.testing.assert_allclose(
        metrics.bone_length_drift(x, [(1, 2)]), [np.std([2, 1, 3]) / 2], rtol=1e-12
    )
    x[:, 2] = np.nan
    assert np.isnan(metrics.bone_length_drift(x, [(1, 2)])).all()
    with pytest.raises(InputError, match="3 joints"):
        metrics.bone_length_drift(x)


def test_a_hand_model_does_not_drift():
    model = HandModel.default("right")
    angles = model.limits.clamp(np.random.default_rng(0).normal(size=(50, 20)))
    x = model.joints(angles)
    assert metrics.bone_length_drift(x).max() < 1e-12
    np.testing.assert_allclose(metrics.bone_lengths(x)[7], model.bone_lengths)


def test_limit_violations():
    limits = preset("li2021")
    angles = np.zeros((4, 20))
    angles[1, 6] = np.deg2rad(103.0)  # index PIP: 100 is the most
    angles[2, 3] = np.deg2rad(-5.0)  # thumb IP: 0 is the least
    angles[3] = np.nan
    found = metrics.limit_violations(angles, limits)
    assert found.share == pytest.approx(2 / 3)
    assert found.max_deg == pytest.approx(5.0)
    assert found.mean_deg == pytest.approx(8.0 / 60)
    assert found.degrees[1, 6] == pytest.approx(3.0)
    assert np.isnan(found.degrees[3]).all()
    assert np.flatnonzero(found.share_per_angle).tolist() == [3, 6]
    assert found.share_per_angle[3] == pytest.approx(1 / 3)
    nothing = metrics.limit_violations(angles[3:], limits)
    assert np.isnan([nothing.share, nothing.mean_deg, nothing.max_deg]).all()
    with pytest.raises(InputError, match="expected \\(frames, 20\\)"):
        metrics.limit_violations(angles[:, :19], limits)


def test_angle_error_goes_the_short_way():
    a = np.deg2rad([[10.0, 179.0], [0.0, np.nan], [np.nan, np.nan]])
    b = np.deg2rad([[0.0, -179.0], [5.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(np.rad2deg(metrics.angle_error(a, b)), [6.0, 5.0, np.nan])
    with pytest.raises(InputError):
        metrics.angle_error(a, b[1:])


def test_segment_distance_against_a_solver():
    rng = np.random.default_rng(1)
    ends = rng.normal(size=(4, 300, 3))
    got = segment_distance(*ends)
    for i in range(300):
        p0, p1, q0, q1 = ends[:, i]

        def squared(v, p0=p0, p1=p1, q0=q0, q1=q1):
            return ((p0 + v[0] * (p1 - p0) - q0 - v[1] * (q1 - q0)) ** 2).sum()

        best = minimize(squared, [0.5, 0.5], bounds=[(0, 1)] * 2, tol=1e-14)
        assert got[i] == pytest.approx(np.sqrt(best.fun), abs=1e-5)


def test_segment_distance_of_special_cases():
    o, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert segment_distance(o, x, y, x + y) == pytest.approx(1)  # parallel
    assert segment_distance(o, x, 3 * x, 5 * x) == pytest.approx(2)  # on one line
    assert segment_distance(o, x, 0.5 * x - y, 0.5 * x + y) == pytest.approx(0)  # crossing
    assert segment_distance(o, o, y, y) == pytest.approx(1)  # points
    assert segment_distance(o, x, y, y) == pytest.approx(1)


def test_self_intersection():
    model = HandModel.default("right")
    angles = np.zeros((4, 20))
    angles[1, 4] = 0.1  # the index bends a little out of the plane: no harm
    angles[2, 8 + 1] = 0.35  # the middle finger crosses into the index
    x = model.joints(angles)
    x[3] = np.nan
    depth = metrics.self_intersection(x)
    assert depth[:2].max() < 0.002
    assert depth[2] > 0.008
    assert np.isnan(depth[3])
    # thin bones do not meet in the plane unless they cross
    assert metrics.self_intersection(x, np.zeros((5, 3)))[:2].max() == 0
    np.testing.assert_allclose(
        metrics.self_intersection(x * 1e3, metrics.FINGER_RADII * 1e3)[:3], depth[:3] * 1e3
    )
    one = np.full((1, 21, 3), np.nan)
    one[0, 1:3] = x[0, 1:3]
    assert np.isnan(metrics.self_intersection(one)).all()
    with pytest.raises(SettingsError):
        metrics.self_intersection(x, np.zeros(15))
    with pytest.raises(InputError, match="expected 21"):
        metrics.self_intersection(x[:, :20])
