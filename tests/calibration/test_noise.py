"""Smoothing: noise goes, motion, gaps and strays do not come in."""

from __future__ import annotations

import numpy as np
import pytest
from subjects import poses, subject

from handtrack.calibration.noise import noise_level, smoothed


def motion(seed: int = 0, frames: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return np.arange(frames) * 33_333_333, subject(rng).joints(*poses(rng, frames))


@pytest.mark.parametrize("sigma", [0.002, 0.005, 0.010])
def test_noise_is_taken_away_and_what_is_left_is_known(sigma):
    time, clean = motion()
    seen = clean + sigma * np.random.default_rng(1).normal(size=clean.shape)
    smooth, left = smoothed(time, seen, noise_level(seen))
    assert np.std(smooth - clean) < 0.65 * sigma
    assert left == pytest.approx(np.std(smooth - clean), rel=0.35)


def test_parabolas_are_kept_whatever_the_frame_times():
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.integers(20_000_000, 40_000_000, 80))
    t = time * 1e-9
    a = rng.normal(0, 0.1, (3, 21, 3))
    joints = a[0] + t[:, None, None] * a[1] + (t**2)[:, None, None] * a[2]
    smooth, _ = smoothed(time, joints, 0.002)
    np.testing.assert_allclose(smooth, joints, rtol=0, atol=1e-9)


def test_a_clean_motion_is_left_alone():
    time, clean = motion(3)
    smooth, _ = smoothed(time, clean, noise_level(clean))
    assert np.abs(smooth - clean).max() < 0.002
    same, as_much = smoothed(time, clean, 1e-4)
    assert same is clean
    assert as_much == 1e-4
    few = clean[:4]
    assert smoothed(time[:4], few, 0.01)[0] is few


def test_gaps_stay_gaps_and_strays_become_some():
    time, clean = motion(4)
    rng = np.random.default_rng(5)
    seen = clean + 0.003 * rng.normal(size=clean.shape)
    seen[100:120] = np.nan
    seen[rng.random(seen.shape[:2]) < 0.1] = np.nan
    missing = np.isnan(seen[..., 0])
    stray = (rng.random(seen.shape[:2]) < 0.01) & ~missing
    seen[stray] += 0.1
    smooth, _ = smoothed(time, seen, 0.003)
    gone = np.isnan(smooth[..., 0])
    assert gone[missing].all()
    assert gone[stray].mean() > 0.9
    assert gone[~missing & ~stray].mean() < 0.05
    assert np.nanstd(smooth - clean) < 0.003
