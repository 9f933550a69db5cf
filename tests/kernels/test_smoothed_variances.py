"""Variances of smoothed angles against Rauch-Tung-Striebel smoothers of one angle and its speed."""

from __future__ import annotations

import numpy as np
import pytest
from plain import plain, positive, record

from handtrack.kernels import smoothed_variances
from handtrack.kernels.filter_state import DRIFTING, FILTER, KEPT

FRAMES, ANGLES, N = 6, 20, 26


def run(name: str, *args) -> None:
    plain(getattr(smoothed_variances, name))(*args)


def filtered(seed: int) -> tuple[list, list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """What is kept of each frame; covariances (20, 2, 2) predicted, updated; transitions."""
    rng = np.random.default_rng(seed)
    p = np.stack([positive(rng, 2) for _ in range(ANGLES)])
    kept, before, after, moves = [], [], [], []
    for t in range(FRAMES):
        f01, f11 = rng.uniform(0.01, 0.5, ANGLES), rng.uniform(0.3, 1.0, ANGLES)
        f = np.tile(np.eye(2), (ANGLES, 1, 1))
        f[:, 0, 1], f[:, 1, 1] = f01, f11
        q = 0.1 * np.stack([positive(rng, 2) for _ in range(ANGLES)])
        p = f @ p @ f.transpose(0, 2, 1) + q
        s, k = record(FILTER), record(KEPT)
        k.gain[:] = 9.0  # of a frame before
        k.f01[:ANGLES], k.f11[:ANGLES] = f01, f11
        s.pose_pose[range(ANGLES), range(ANGLES)] = p[:, 0, 0]
        s.pose_speed[range(ANGLES), range(ANGLES)] = p[:, 0, 1]
        run("keep_spread", s, k)
        before.append(p)
        if t != 3:  # where nothing is measured
            r = rng.uniform(0.05, 2.0, ANGLES)
            gain = p[:, :, 0] / (p[:, 0, 0] + r)[:, None]
            p = p - gain[:, :, None] * p[:, None, 0, :]
            s.pose_pose[range(ANGLES), range(ANGLES)] = p[:, 0, 0]
            run("keep_gain", s, k)
        after.append(p)
        moves.append(f)
        kept.append(k)
    return kept, before, after, moves


def test_smoothed_variances_are_rauch_tung_and_striebels():
    kept, before, after, moves = filtered(0)
    smoothed = [after[-1]]
    for t in range(FRAMES - 2, -1, -1):
        c = after[t] @ moves[t + 1].transpose(0, 2, 1) @ np.linalg.inv(before[t + 1])
        more = c @ (smoothed[0] - before[t + 1]) @ c.transpose(0, 2, 1)
        smoothed.insert(0, after[t] + more)
    n, row = np.full((3, ANGLES), 5.0), record(KEPT)
    row.variance = np.zeros(ANGLES)
    run("clear_spread", n)
    assert (n == 0).all()
    for t in range(FRAMES - 1, -1, -1):
        run("spread_over_measurement", kept[t], n)
        run("store_smoothed_spread", kept[t], n, row)
        np.testing.assert_allclose(row.variance, smoothed[t][:, 0, 0], rtol=1e-9)
        run("spread_over_transition", kept[t], n)


def test_without_drift_a_spread_is_of_the_difference():
    """A hand's angle is the seen one less its drift."""
    rng = np.random.default_rng(1)
    p = positive(rng, 3 * N)  # poses, velocities, drift
    s, k, row = record(DRIFTING), record(KEPT), record(KEPT)
    s.pose_pose, s.pose_rest, s.rest_rest = p[:N, :N], p[:N, N:], p[N:, N:]
    less = np.hstack([np.eye(N), np.zeros((N, N)), -np.eye(N)])
    of_hand = np.diagonal(less @ p @ less.T)[:ANGLES]
    with_speed = np.diagonal((less @ p)[:, N : 2 * N])[:ANGLES]
    row.variance = np.zeros(ANGLES)
    k.gain[:] = 9.0
    run("keep_undrifted_spread", s, k)
    run("store_undrifted_spread", s, row)
    np.testing.assert_allclose(k.prior, of_hand)
    np.testing.assert_allclose(k.cross, with_speed)
    np.testing.assert_allclose(row.variance, of_hand)
    assert (k.gain == 0).all()
    # a measurement takes a third of it
    s.pose_pose[range(ANGLES), range(ANGLES)] -= of_hand / 3
    run("keep_undrifted_gain", s, k)
    np.testing.assert_allclose(k.gain, (of_hand / 3) / of_hand**2)
    run("store_spread", s, row)
    np.testing.assert_allclose(row.variance, np.diagonal(s.pose_pose)[:ANGLES])


@pytest.mark.parametrize(("prior", "after"), [(0.0, 0.0), (1.0, 1.5)])
def test_a_measurement_that_takes_nothing_has_no_gain(prior, after):
    k = record(KEPT)
    k.prior[4], k.gain[4] = prior, 9.0
    run("gain_of", k, 4, after)
    assert k.gain[4] == 0.0
