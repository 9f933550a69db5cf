"""The steps of the filter with drift, and what it learns of noise, against dense NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain import plain, positive, record
from poses_in_time import moved, pose_of, step
from scipy.spatial.transform import Rotation

from handtrack.kernels import drift, drift_loop, drift_smoother, joint_noise, motion_noise
from handtrack.kernels.filter_state import BANK, DRIFTING, KEPT_DRIFTING
from handtrack.kernels.workspace import RESULT

N = 26
BOTH, ALL = 2 * N, 3 * N


def state(seed: int):
    """A state of pose, velocities and drift, and a step of time over which some drift is lost."""
    rng = np.random.default_rng(seed)
    s = record(DRIFTING, seed)
    p = positive(rng, ALL)
    s.pose_pose, s.pose_rest, s.rest_rest = p[:N, :N].copy(), p[:N, N:].copy(), p[N:, N:].copy()
    s.rotation = Rotation.random(rng=rng).as_matrix()
    step(s, rng)
    s.density, s.stays = rng.uniform(0.1, 2.0, N), rng.uniform(0.0, 0.9, N)
    s.renewed, s.spread = np.sqrt(1 - s.stays**2), positive(rng, N)
    return s


def whole(s) -> np.ndarray:
    return np.block([[s.pose_pose, s.pose_rest], [s.pose_rest.T, s.rest_rest]])


def transition(s) -> np.ndarray:
    zero = np.zeros((N, N))
    return np.block(
        [
            [np.eye(N), np.diag(s.f01), np.diag(s.stays - 1)],
            [zero, np.diag(s.f11), zero],
            [zero, zero, np.diag(s.stays)],
        ]
    )


def noise(s) -> np.ndarray:
    """What the motion and the renewed drift, which the seen pose has too, add."""
    new = np.outer(s.renewed, s.renewed) * s.spread
    q = np.zeros((ALL, ALL))
    for rows in (slice(0, N), slice(BOTH, ALL)):
        for columns in (slice(0, N), slice(BOTH, ALL)):
            q[rows, columns] = new
    q[:N, :N] += np.diag(s.density * s.q00)
    q[:N, N:BOTH] = q[N:BOTH, :N] = np.diag(s.density * s.q01)
    q[N:BOTH, N:BOTH] = np.diag(s.density * s.q11)
    return q


def test_prediction_is_f_p_ft_plus_q():
    s = state(0)
    f, q, p, pose = transition(s), noise(s), whole(s), pose_of(s)
    x = np.concatenate([np.zeros(N), s.velocity, s.drift])
    plain(drift.predict_drifting)(s)
    np.testing.assert_allclose(whole(s), f @ p @ f.T + q, rtol=1e-10, atol=1e-12)
    moved(s, pose, (f @ x)[:N])
    np.testing.assert_allclose(np.append(s.velocity, s.drift), (f @ x)[N:])


def test_an_update_moves_velocities_and_drift_with_the_pose():
    rng, s = np.random.default_rng(1), state(1)
    p, m, z = whole(s), positive(rng, N), rng.normal(0, 0.1, N)
    s.precision = np.linalg.inv(s.pose_pose)
    s.distance, s.pull, s.system = z.copy(), s.precision @ z, m.copy()
    pose, before = pose_of(s), np.append(s.velocity, s.drift)
    total = np.linalg.inv(p[:N, :N] + np.linalg.inv(m))
    information, pull = np.zeros((N, N)), np.zeros(N)
    plain(drift.update_drifting)(s, 0, 1, information, pull)
    gain = p[:, :N] @ total
    moved(s, pose, (gain @ z)[:N])
    np.testing.assert_allclose(np.append(s.velocity, s.drift), before + (gain @ z)[N:], atol=1e-11)
    np.testing.assert_allclose(whole(s), p - gain @ p[:N], atol=1e-10)
    np.testing.assert_allclose(information, total, atol=1e-10)
    np.testing.assert_allclose(pull, total @ z, atol=1e-10)


GRID = np.stack([np.geomspace(0.1, 10, BANK), -(np.linspace(-1, 1, BANK) ** 2), np.zeros(BANK)])
GRID[2] = np.log(GRID[0])
NAMES = ("xx", "xv", "xc", "vv", "vc", "cc")
PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def banked(seed: int):
    rng, s = np.random.default_rng(seed), state(seed)
    p = np.stack([positive(rng, 3) for _ in range(BANK * N)]).reshape(BANK, N, 3, 3)
    for name, (i, j) in zip(NAMES, PLACES, strict=True):
        setattr(s, f"bank_{name}", p[..., i, j].copy())
    return s, p, np.stack([s.bank_x, s.bank_v, s.bank_c], -1), rng


def same_bank(s, p, x) -> None:
    np.testing.assert_allclose(np.stack([s.bank_x, s.bank_v, s.bank_c], -1), x, atol=1e-9)
    for name, (i, j) in zip(NAMES, PLACES, strict=True):
        found = getattr(s, f"bank_{name}")
        np.testing.assert_allclose(found, p[..., i, j], rtol=1e-8, atol=1e-10, err_msg=name)


def test_the_banks_filters_predict_as_filters_of_three():
    s, p, x, rng = banked(2)
    process = rng.uniform(0.5, 2.0, (3, N))
    plain(drift_loop.predict_drifting_bank)(s, GRID, process)
    for k in range(BANK):
        for i in range(N):
            a = s.stays[i]
            f = np.array([[1.0, s.f01[i], a - 1], [0.0, s.f11[i], 0.0], [0.0, 0.0, a]])
            q = np.zeros((3, 3))
            q[:2, :2] = [[s.q00[i], s.q01[i]], [s.q01[i], s.q11[i]]]
            new = (1 - a * a) * s.spread[i, i]
            shared = np.outer([1, 0, 1], [1, 0, 1])
            p[k, i] = f @ p[k, i] @ f.T + GRID[0, k] * process[0, i] * q + new * shared
            own = f @ [0.0, s.velocity[i], s.drift[i]]
            x[k, i] = f @ x[k, i] - [own[0], 0.0, 0.0]
    same_bank(s, p, x)


def test_the_bank_learns_as_bayes_does():
    s, p, x, rng = banked(3)
    log, process = s.bank_log.copy(), rng.uniform(0.5, 2.0, (3, N))
    variance, r, z = rng.uniform(0.5, 2, N), rng.uniform(0.1, 1, N), rng.normal(0, 1.5, N)
    gain = variance / (variance + r)
    s.before, s.distance, s.fade = variance.copy(), gain * z, 0.9
    s.pose_pose[range(N), range(N)] = (1 - gain) * variance
    plain(drift_loop.learn_drifting)(s, GRID, process)
    for k in range(BANK):
        for i in range(N):
            v, e, first = p[k, i, 0, 0] + r[i], z[i] - x[k, i, 0], p[k, i, 0].copy()
            x[k, i] += first / v * e - [gain[i] * z[i], 0.0, 0.0]
            p[k, i] -= np.outer(first, first) / v
            log[k, i] = 0.9 * log[k, i] - 0.5 * (np.log(v) + min(e * e / v, motion_noise.FAR))
    same_bank(s, p, x)
    np.testing.assert_allclose(s.bank_log, log, atol=1e-8)


def test_a_bank_begins_without_drift():
    s, process = state(4), np.random.default_rng(4).uniform(0.5, 2, (3, N))
    plain(drift_loop.begin_drifting_bank)(s, process)
    for name in ("x", "v", "c", "xv", "xc", "vc"):
        assert (getattr(s, f"bank_{name}") == 0).all(), name
    np.testing.assert_array_equal(s.bank_xx, np.tile(np.diagonal(s.pose_pose), (BANK, 1)))
    own = np.diagonal(s.rest_rest)[N:]
    np.testing.assert_array_equal(s.bank_cc, np.tile(own, (BANK, 1)))


def test_drift_is_lost_with_a_finger_that_comes_back_and_with_the_hand():
    s = state(5)
    s.lasts, s.colour, s.noise = 0.2, 0.7, 3.0
    s.fingers_seen[:] = 4, 4, 0, 2, 0
    weights = np.zeros(21)
    weights[1:9] = weights[9] = weights[0] = 0.4  # thumb, index whole, one joint of the middle
    age = plain(drift.age_drift)
    age(s, 0.05, weights)
    expected = np.full(N, math.exp(-0.25))
    expected[8:12] = 0.0
    np.testing.assert_allclose(s.stays, expected)
    np.testing.assert_allclose(s.renewed, np.sqrt(1 - expected**2))
    np.testing.assert_allclose(s.spread, 2.1 * s.unit)
    assert list(s.fingers_seen) == [4, 4, 1, 0, 0]
    s.fingers_seen[:] = 0
    age(s, 0.05, weights)
    assert (s.stays == 0).all()
    assert (s.renewed == 1).all()


def test_the_adjoint_goes_back_over_a_frame_as_in_the_dense_form():
    """r = (I - P H' S^-1 H)' r + H' S^-1 z, then F' r; the hand's pose is the seen less drift."""
    rng, s, k = np.random.default_rng(6), state(6), record(KEPT_DRIFTING, 6)
    k.pull = np.zeros(N)
    plain(drift_loop.keep_drifting)(s, k)
    k.information, k.pull = positive(rng, N), rng.normal(size=N)
    p, f = whole(s), transition(s)
    r, rest = rng.normal(0, 0.01, (3, N)), rng.normal(0, 0.01, BOTH)
    dense = np.append(r[drift_smoother.ADJOINT], rest)
    pose = record(DRIFTING)
    plain(drift_smoother.smoothed_pose)(k, r.copy(), rest.copy(), pose)
    change = p @ dense
    turn = Rotation.from_rotvec(change[20:23])
    less = s.drift + change[BOTH:]
    whole_turn = (Rotation.from_rotvec(-less[20:23]) * turn).as_matrix() @ s.rotation
    np.testing.assert_allclose(pose.angles, s.angles + change[:20] - less[:20], atol=1e-11)
    np.testing.assert_allclose(pose.rotation, whole_turn, atol=1e-11)
    away = s.translation + change[23:N] - less[23:]
    np.testing.assert_allclose(pose.translation, away, atol=1e-11)

    plain(drift_smoother.over_measurement)(k, r, rest)
    h = np.zeros((ALL, ALL))
    h[:N, :N] = k.information
    dense = (np.eye(ALL) - p @ h).T @ dense + np.append(k.pull, np.zeros(BOTH))
    np.testing.assert_allclose(np.append(r[drift_smoother.ADJOINT], rest), dense, atol=1e-10)
    plain(drift_smoother.over_transition)(k, r, rest)
    np.testing.assert_allclose(np.append(r[drift_smoother.ADJOINT], rest), f.T @ dense, atol=1e-10)
    plain(drift_smoother.clear)(r, rest)
    assert not r[drift_smoother.ADJOINT].any()
    assert not rest.any()


# ---- what share of the noise lasts ----


def test_the_share_of_noise_is_learnt_from_residuals_in_the_hands_frame():
    """Against a loop over frames in NumPy; some joints come and go, one frame has no fit."""
    rng, dt = np.random.default_rng(7), 0.03
    s, usual, count = record(DRIFTING), np.zeros((21, 3)), np.zeros(21)
    s.noise, s.lasts = 1e-4, 0.2
    last: list[np.ndarray | None] = [None] * 21
    pairs = products = squares = total = 0.0
    slow = rng.normal(0, 0.01, (21, 3))
    for t in range(40):
        slow = 0.9 * slow + 0.4 * rng.normal(0, 0.01, (21, 3))
        turn, joints = Rotation.random(rng=rng).as_matrix(), rng.normal(size=(21, 3))
        weights = (rng.uniform(size=21) < 0.9) * rng.uniform(0.1, 1.0, 21)
        raw = record(RESULT)
        raw.root[:9], raw.joints, raw.noise = turn.ravel(), joints, math.nan if t == 20 else 1.0
        left = slow + 0.02
        plain(joint_noise.follow_share)(s, dt, joints + left @ turn.T, weights, raw)
        if t == 20:
            last = [None] * 21
            continue
        fade = math.exp(-dt / joint_noise.PRODUCTS_S)
        pairs, products, squares, total = (v * fade for v in (pairs, products, squares, total))
        for k in range(21):
            if weights[k] == 0:
                last[k] = None
                continue
            count[k] += 1
            gain = max(1 / count[k], 1 - math.exp(-dt / joint_noise.MEAN_S))
            usual[k] += gain * (left[k] - usual[k])
            now, before = left[k] - usual[k], last[k]
            if before is not None:
                pairs += 1
                products += now @ before
                squares += (now @ now + before @ before) / 2
                total += left[k] @ left[k]
            last[k] = now
    np.testing.assert_allclose(s.usual, usual, atol=1e-12)
    found = s.pairs, s.products, s.squares, s.whole
    np.testing.assert_allclose(found, (pairs, products, squares, total), rtol=1e-9)
    assert pairs > joint_noise.LEAST_PAIRS
    least = math.exp(-dt / s.lasts) - joint_noise.CHANCE
    assert s.share == pytest.approx((products / squares - joint_noise.CHANCE) / least)
    assert 0.1 < s.share < 1.0
    assert s.moving == pytest.approx(squares / total)
    # a hand without noise says nothing
    s.noise = 0.9 * joint_noise.FINE
    plain(joint_noise.follow_share)(s, dt, joints + left @ turn.T, np.ones(21), raw)
    assert (s.share, s.moving) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("correlation", "share"),
    [(-0.5, 0.0), (0.1, 0.0), (0.3, 0.2 / (math.exp(-0.5) - 0.1)), (0.9, 1.0), (math.nan, 0.0)],
)
def test_a_share_is_the_correlation_over_what_lasting_noise_would_have(correlation, share):
    assert plain(joint_noise.share_of)(correlation, 0.1, 0.2) == pytest.approx(share)


def test_noise_that_could_not_last_to_the_next_frame_counts_as_chance():
    assert plain(joint_noise.share_of)(0.15, 10.0, 0.2) == pytest.approx(0.05 / 0.1)


@pytest.mark.parametrize(
    ("share", "moving", "white", "lasts"),
    [
        (0.0, 0.3, 1.0, 0.0),
        (1.0, 1.0, 1.5, 0.75),
        (0.5, 0.2, 0.75, 0.225),
        (1.0, 0.0, 0.075, 0.0375),
    ],
)
def test_parts_of_noise(share, moving, white, lasts):
    """A constant part of residuals, down to a twentieth, is taken off what lasts."""
    assert plain(joint_noise.parts_of)(share, moving) == pytest.approx((white, lasts))
