"""The filter's and the smoother's steps against textbook formulas over dense matrices in NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain import plain, positive, record
from poses_in_time import moved, pose_of, step
from scipy.spatial.transform import Rotation

from handtrack.kernels import (
    joint_noise,
    kalman,
    measurement,
    motion_evidence,
    motion_noise,
    smoother,
)
from handtrack.kernels.filter_state import (
    BANK,
    BEGUN,
    FILTER,
    KEPT,
    NOTHING,
    PREDICTED,
    FilterNumbers,
)

N = 26


def state(seed: int):
    """A filter's state with a covariance of poses and velocities, and a step of time."""
    rng = np.random.default_rng(seed)
    s = record(FILTER, seed)
    p = positive(rng, 2 * N)
    s.pose_pose, s.pose_speed, s.speed_speed = p[:N, :N].copy(), p[:N, N:].copy(), p[N:, N:].copy()
    s.rotation = Rotation.random(rng=rng).as_matrix()
    step(s, rng)
    s.density = rng.uniform(0.1, 2.0, N)
    return s


def whole(s) -> np.ndarray:
    return np.block([[s.pose_pose, s.pose_speed], [s.pose_speed.T, s.speed_speed]])


def transition(s) -> np.ndarray:
    return np.block([[np.eye(N), np.diag(s.f01)], [np.zeros((N, N)), np.diag(s.f11)]])


# ---- prediction and update ----


def test_prediction_is_f_p_ft_plus_q():
    s = state(0)
    before, pose, speed = whole(s), pose_of(s), s.velocity.copy()
    q = np.block(
        [
            [np.diag(s.density * s.q00), np.diag(s.density * s.q01)],
            [np.diag(s.density * s.q01), np.diag(s.density * s.q11)],
        ]
    )
    plain(kalman.predict)(s)
    f = transition(s)
    np.testing.assert_allclose(whole(s), f @ before @ f.T + q, rtol=1e-11, atol=1e-13)
    moved(s, pose, s.f01 * speed)
    np.testing.assert_allclose(s.velocity, s.f11 * speed)


def test_an_update_is_the_information_filters():
    """A measurement z of the pose with information M: mean, covariance, likelihood, what is kept.

    With S = P + M^-1: the gain is P S^-1, the smoother's H' S^-1 H is S^-1.
    """
    rng = np.random.default_rng(1)
    s = state(1)
    p, m, z = whole(s), positive(rng, N), rng.normal(0, 0.1, N)
    s.precision = np.linalg.inv(s.pose_pose)
    s.distance, s.pull, s.system = z.copy(), s.precision @ z, m.copy()
    pose, speed = pose_of(s), s.velocity.copy()
    information, pull = np.zeros((N, N)), np.zeros(N)
    total = np.linalg.inv(p[:N, :N] + np.linalg.inv(m))
    less = plain(kalman.update)(s, 0, 1, information, pull)
    gain = p[:, :N] @ total
    change = gain @ z
    moved(s, pose, change[:N])
    np.testing.assert_allclose(s.velocity, speed + change[N:], atol=1e-11)
    np.testing.assert_allclose(whole(s), p - gain @ p[:N], atol=1e-10)
    np.testing.assert_allclose(information, total, atol=1e-10)
    np.testing.assert_allclose(pull, total @ z, atol=1e-10)
    # 2 nats: z' S^-1 z where the objective had z' P^-1 z, and |P + M^-1| over |P| |M^-1|
    surplus = z @ s.precision @ z - z @ total @ z
    log = np.linalg.slogdet(s.precision + m)[1]
    assert less == pytest.approx(0.5 * (log - surplus), rel=1e-10)


def test_the_priors_gradient_is_the_slope_of_the_turns_distance():
    """Half d' L d with d the logarithm of the turn, against differences; small turns (eq. 31)."""
    rng = np.random.default_rng(2)
    s, precision = record(FILTER), positive(rng, N)
    d = rng.normal(0, 0.1, N)
    s.distance, s.pull = d.copy(), precision @ d
    plain(measurement.prior_gradient)(s)

    def half(step: np.ndarray) -> float:
        turned = Rotation.from_rotvec(step[20:23]) * Rotation.from_rotvec(d[20:23])
        x = np.concatenate([d[:20] + step[:20], turned.as_rotvec(), d[23:] + step[23:]])
        return 0.5 * x @ precision @ x

    h = 1e-6
    expected = [(half(h * e) - half(-h * e)) / (2 * h) for e in np.eye(N)]
    np.testing.assert_allclose(s.gradient, expected, atol=2e-5)


def test_noise_is_as_given_or_a_mean_in_which_a_stray_frame_counts_fourfold():
    s, follow = record(FILTER), plain(joint_noise.follow_noise)
    follow(s, 5.0, 2.0, 0.1)
    assert s.noise == 2.0
    s = record(FILTER)
    seen = [1.0, 3.0, math.nan, 2.0, 4.0, 1.0]
    for value in seen:
        follow(s, value, 0.0, 0.2)
    # gains 1, 1/2, 1/3, 1/4, 1/5
    assert s.noise == pytest.approx(np.nanmean(seen))
    before = s.noise
    follow(s, 1e9, 0.0, 0.2)
    assert s.noise == pytest.approx(before + 0.2 * (4 * before - before))
    follow(s, -1.0, 0.0, 1.0)
    assert s.noise == pytest.approx(joint_noise.LEAST_NOISE, rel=1e-5)


def test_a_state_ends_after_the_coast_and_begins_with_a_fit():
    s, process = record(FILTER), np.ones((3, N))
    settings = FilterNumbers(1, 0, 1.0, 0.1, 200_000_000, 0.5, 0, 0.0)
    pass_time = plain(kalman.pass_time)
    assert pass_time(s, settings, process, 0, math.nan) == NOTHING
    assert pass_time(s, settings, process, 10**8, 1.0) == BEGUN
    s.known = 1
    assert pass_time(s, settings, process, 2 * 10**8, math.nan) == PREDICTED
    assert s.fade == pytest.approx(math.exp(-0.1 / 0.5))
    assert s.f11 == pytest.approx(np.exp(-0.1) * np.ones(N))
    # the last fit is 0.2 s back: held still; a nanosecond more, and it is not
    assert pass_time(s, settings, process, 3 * 10**8, math.nan) == PREDICTED
    assert pass_time(s, settings, process, 3 * 10**8 + 1, math.nan) == NOTHING
    assert s.known == 0


# ---- the bank that learns the motion's noise ----

GRID = np.stack([np.geomspace(0.1, 10, BANK), -(np.linspace(-1, 1, BANK) ** 2), np.zeros(BANK)])
GRID[2] = np.log(GRID[0])


def banked(seed: int):
    rng = np.random.default_rng(seed)
    s = state(seed)
    p = np.stack([positive(rng, 2) for _ in range(BANK * N)]).reshape(BANK, N, 2, 2)
    s.bank_xx, s.bank_xv, s.bank_vv = p[..., 0, 0].copy(), p[..., 0, 1].copy(), p[..., 1, 1].copy()
    return s, p, rng


def test_the_banks_filters_predict_as_scalar_filters():
    s, p, rng = banked(3)
    x = np.stack([s.bank_x, s.bank_v], -1)
    process = rng.uniform(0.5, 2.0, (3, N))
    plain(motion_noise.predict_bank)(s, GRID, process)
    for k in range(BANK):
        for i in range(N):
            f = np.array([[1.0, s.f01[i]], [0.0, s.f11[i]]])
            q = np.array([[s.q00[i], s.q01[i]], [s.q01[i], s.q11[i]]])
            p[k, i] = f @ p[k, i] @ f.T + GRID[0, k] * process[0, i] * q
            x[k, i] = f @ x[k, i] - [s.f01[i] * s.velocity[i], 0.0]
    np.testing.assert_allclose(np.stack([s.bank_x, s.bank_v], -1), x, atol=1e-12)
    np.testing.assert_allclose(s.bank_xx, p[..., 0, 0], rtol=1e-12)
    np.testing.assert_allclose(s.bank_xv, p[..., 0, 1], rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(s.bank_vv, p[..., 1, 1], rtol=1e-12)


def test_the_bank_learns_as_bayes_does():
    """Each filter takes the scalar measurement that explains the state's update."""
    s, p, rng = banked(4)
    x = np.stack([s.bank_x, s.bank_v], -1)
    log, process = s.bank_log.copy(), rng.uniform(0.5, 2.0, (3, N))
    variance, r, z = rng.uniform(0.5, 2, N), rng.uniform(0.1, 1, N), rng.normal(0, 1.5, N)
    z[3] = 50.0
    gain = variance / (variance + r)
    s.before, s.distance, s.fade = variance.copy(), gain * z, 0.9
    s.pose_pose[range(N), range(N)] = (1 - gain) * variance
    plain(motion_noise.learn)(s, GRID, process)
    h = np.array([1.0, 0.0])
    capped = 0
    for k in range(BANK):
        for i in range(N):
            v, e = p[k, i, 0, 0] + r[i], z[i] - x[k, i, 0]
            x[k, i] += p[k, i] @ h / v * e - [gain[i] * z[i], 0.0]
            p[k, i] -= np.outer(p[k, i] @ h, p[k, i] @ h) / v
            capped += e * e / v > motion_noise.FAR
            q = min(e * e / v, motion_noise.FAR)
            log[k, i] = 0.9 * log[k, i] - 0.5 * (np.log(v) + q)
    assert 0 < capped < BANK * N / 2
    np.testing.assert_allclose(np.stack([s.bank_x, s.bank_v], -1), x, atol=1e-9)
    np.testing.assert_allclose(s.bank_xx, p[..., 0, 0], rtol=1e-9)
    np.testing.assert_allclose(s.bank_xv, p[..., 0, 1], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(s.bank_vv, p[..., 1, 1], rtol=1e-9)
    np.testing.assert_allclose(s.bank_log, log, atol=1e-8)
    weights = np.exp(log + GRID[1][:, None])
    mean = (weights * GRID[2][:, None]).sum(0) / weights.sum(0)
    np.testing.assert_allclose(s.learnt, process[0] * np.exp(mean), rtol=1e-8)


def test_a_bank_begins_at_the_state_and_keeps_what_was_learnt():
    s, process = state(5), np.random.default_rng(5).uniform(0.5, 2, (3, N))
    log = s.bank_log.copy()
    s.learnt = np.where(np.arange(N) % 2, 0.0, 7.0)
    plain(motion_noise.begin_bank)(s, process)
    for name in ("bank_x", "bank_v", "bank_xv"):
        assert (getattr(s, name) == 0).all()
    np.testing.assert_array_equal(s.bank_xx, np.tile(np.diagonal(s.pose_pose), (BANK, 1)))
    np.testing.assert_array_equal(s.bank_vv, np.tile(process[2], (BANK, 1)))
    np.testing.assert_array_equal(s.learnt, np.where(np.arange(N) % 2, process[0], 7.0))
    np.testing.assert_array_equal(s.bank_log, log)


# ---- backwards: the adjoint and its covariance ----


def kept_frame(seed: int):
    rng = np.random.default_rng(seed)
    k = record(KEPT, seed)
    k.pose_pose, k.information = positive(rng, N), positive(rng, N)
    step(k, rng)
    return k


def dense_parts(k) -> tuple[np.ndarray, np.ndarray]:
    """(52, 52) The smoother's H' S^-1 H, and I - P H' S^-1 H of the whole state."""
    s = np.zeros((2 * N, 2 * N))
    s[:N, :N] = k.information
    # of P the pose's rows are all that H leaves
    rows = np.zeros((2 * N, 2 * N))
    rows[:N, :N], rows[:N, N:], rows[N:, :N] = k.pose_pose, k.pose_speed, k.pose_speed.T
    return s, np.eye(2 * N) - rows @ s


def test_the_adjoint_goes_back_over_a_frame_as_in_the_dense_form():
    """r = (I - P H' S^-1 H)' r + H' S^-1 z, then F' r."""
    k, r = kept_frame(6), np.random.default_rng(6).normal(size=(4, N))
    _, left = dense_parts(k)
    dense = np.concatenate([r[smoother.ADJOINT], r[smoother.SPEED]])
    expected = left.T @ dense + np.append(k.pull, np.zeros(N))
    plain(smoother.over_measurement)(k, r)
    found = np.concatenate([r[smoother.ADJOINT], r[smoother.SPEED]])
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-11)
    plain(smoother.covary)(k, r)
    change = np.hstack([k.pose_pose, k.pose_speed]) @ found
    np.testing.assert_allclose(r[smoother.CHANGE], change, rtol=1e-10, atol=1e-11)
    plain(smoother.over_transition)(k, r)
    back = np.concatenate([r[smoother.ADJOINT], r[smoother.SPEED]])
    np.testing.assert_allclose(back, transition(k).T @ found, rtol=1e-10, atol=1e-11)


def test_the_adjoints_covariance_goes_back_as_in_the_dense_form():
    """N = (I - K H)' N (I - K H) + H' S^-1 H, scores on the way, then F' N F."""
    k, rng = kept_frame(7), np.random.default_rng(7)
    dense, m = positive(rng, 2 * N), rng.normal(size=(motion_evidence.MATRICES, N, N))
    m[motion_evidence.POSE], m[motion_evidence.CROSS] = dense[:N, :N], dense[:N, N:]
    m[motion_evidence.VELOCITY] = dense[N:, N:]
    s, left = dense_parts(k)
    expected = left.T @ dense @ left + s
    plain(motion_evidence.covariance_over_measurement)(k, m)
    np.testing.assert_allclose(in_blocks(m), expected, rtol=1e-9, atol=1e-9)

    r, scores = rng.normal(size=(4, N)), np.zeros((2, N))
    plain(motion_evidence.add_scores)(k, r, m, scores)
    for i in range(N):
        u = np.array([[k.q00[i], k.q01[i]], [k.q01[i], k.q11[i]]])
        a, pick = r[:2, i], np.ix_([i, N + i], [i, N + i])
        assert scores[0, i] == pytest.approx(a @ u @ a)
        assert scores[1, i] == pytest.approx(np.trace(expected[pick] @ u))

    f = transition(k)
    plain(motion_evidence.covariance_over_transition)(k, m)
    np.testing.assert_allclose(in_blocks(m), f.T @ expected @ f, rtol=1e-9, atol=1e-9)
    plain(motion_evidence.clear_covariance)(m)
    assert (in_blocks(m) == 0).all()


def in_blocks(m: np.ndarray) -> np.ndarray:
    p, c, v = m[motion_evidence.POSE], m[motion_evidence.CROSS], m[motion_evidence.VELOCITY]
    return np.block([[p, c], [c.T, v]])
