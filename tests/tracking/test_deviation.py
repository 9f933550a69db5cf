"""How far joints are from the true ones, against a loop over frames with numeric Jacobians."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_tracks import make_track
from scipy.spatial.transform import Rotation

from handtrack.tracking.deviation import _ROOT, joint_deviation

H = 1e-5


def jacobian(model, angles: np.ndarray) -> np.ndarray:
    """(63, 26) of the joints by angles, a turn, a shift; whatever the turn is about."""
    columns = []
    for k in range(26):
        ends = []
        for sign in (1, -1):
            d = np.zeros(26)
            d[k] = sign * H
            turn = Rotation.from_rotvec(d[20:23]).as_matrix()
            ends.append(model.joints(angles + d[:20], turn, d[23:]).ravel())
        columns.append((ends[0] - ends[1]) / (2 * H))
    return np.stack(columns, 1)


def by_loops(track, lasting: np.ndarray) -> np.ndarray:
    out = np.full((len(track), 21), np.nan)
    for t in range(len(track)):
        if not np.isfinite(track.angles[t]).all():
            continue
        w = track.confidence[t] * ~track.rejected[t]
        w[np.isnan(track.observed[t, :, 0])] = 0.0
        seen = max((w > 0).sum(), 0)
        if seen < 6:
            w, seen = np.ones(21), 21
        j = jacobian(track.model, track.angles[t])
        unit = np.linalg.inv(j.T @ np.diag(np.repeat(w, 3)) @ j + 1e-7 * np.eye(26))
        own, each = track.angle_variance[t], np.diagonal(unit)[:20]
        known = np.isfinite(own) & (own > 0)
        level = np.median(own[known] / each[known]) if known.any() else 0.0
        shown = track.objective[t] / max(3 * seen - 26, 1)
        if shown > level:
            level = shown if lasting.any() else level ** (1 - _ROOT) * shown**_ROOT
        spread = np.diagonal(j @ unit @ j.T).reshape(21, 3).mean(1)
        out[t] = np.sqrt(np.maximum(level * spread, lasting**2))
    return out


@pytest.mark.parametrize("hand", ["left", "right"])
@pytest.mark.parametrize("lasting_mm", [None, 1.5])
def test_of_fractional_confidences_strays_and_unknown_variances(hand, lasting_mm):
    rng = np.random.default_rng(3)
    made = make_track(14, hand, seed=2, lost=slice(5, 7))
    confidence = rng.uniform(0.2, 1.0, (14, 21))
    confidence[rng.uniform(size=(14, 21)) < 0.05] = 0.0
    observed = np.where(confidence[..., None] > 0, made.filtered_joints, np.nan)
    observed[5:7] = np.nan
    observed[9, 3:] = np.nan  # too few
    rejected = np.zeros((14, 21), bool)
    rejected[2, [7, 14]] = True
    variance = rng.uniform(0.5, 2.0, (14, 20)) * 1e-3
    variance[:, 3], variance[:, 5] = np.inf, 0.0
    variance[4] = np.inf
    objective = np.where(np.isfinite(made.angles[:, 0]), rng.uniform(0, 2e-2, 14), np.nan)
    settings = dict(made.settings)
    lasting = np.zeros(21)
    if lasting_mm:
        settings["lasting_mm"] = [lasting_mm] * 20 + [40.0]
        lasting = 1e-3 * np.array(settings["lasting_mm"])
    track = dataclasses.replace(
        made,
        confidence=confidence,
        observed=observed,
        rejected=rejected,
        angle_variance=variance,
        objective=objective,
        settings=settings,
    )
    expected = by_loops(track, lasting)
    assert np.isfinite(expected).all(1).sum() >= 12
    np.testing.assert_allclose(joint_deviation(track), expected, rtol=2e-3)
