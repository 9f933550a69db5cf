"""What a frame says of a predicted pose, against objectives and Jacobians in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from plain import plain, positive, record
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.kernels import drift, exchange, kalman, measurement, pose_information
from handtrack.kernels.filter_state import DRIFTING, FILTER
from handtrack.kernels.workspace import RESULT, WORK

N = 26
SOLVER = pose_information.information


class Case:
    """A hand, a state, a frame with fractional weights and its raw fit, as all poses: (26,)."""

    def __init__(self, hand: str, seed: int, off: float = 0.05, kind: np.dtype = FILTER):
        rng = np.random.default_rng(seed)
        self.model = HandModel.default(hand)
        limits = self.model.limits
        middle = 0.5 * (limits.lower + limits.upper)
        self.angles = limits.clamp(middle + 0.2 * (limits.upper - middle))
        self.rotation = Rotation.random(rng=rng).as_matrix()
        self.translation = rng.normal(size=3)
        self.weights = rng.uniform(0.2, 0.9, 21)
        self.weights[[4, 11]] = 0.0
        self.raw = rng.normal(0, off, N)
        truth = self.joints(self.raw + rng.normal(0, 0.02, N))
        self.targets = truth + rng.normal(0, 2e-3, (21, 3))
        self.targets[[4, 11]] = np.nan
        s = self.state = record(kind, seed)
        s.angles[:], s.rotation[:], s.translation[:] = self.angles, self.rotation, self.translation
        s.pose_pose = 1e-2 * positive(rng, N)
        s.noise, s.white = 4e-6, 0.8
        w = self.work = record(WORK)
        m = self.model
        numbers = m.rest_joints, m.axes, limits.lower, limits.upper, 0.0, m.landmark_offsets
        plain(exchange.load_model)(w, numbers)
        self.row = record(RESULT)
        self.row.noise, self.row.angles = 1e-6, self.angles + self.raw[:20]
        turned = Rotation.from_rotvec(self.raw[20:23]).as_matrix() @ self.rotation
        self.row.root = np.append(turned.ravel(), self.translation + self.raw[23:])
        self.sigma = np.sqrt(s.white * s.noise)

    def joints(self, d: np.ndarray) -> np.ndarray:
        """Of the state's pose moved by d: turned by the world."""
        turn = Rotation.from_rotvec(d[20:23]).as_matrix()
        return self.model.joints(
            self.angles + d[:20], turn @ self.rotation, self.translation + d[23:]
        )

    def residuals(self, d: np.ndarray) -> np.ndarray:
        seen = self.weights > 0
        r = (self.joints(d) - self.targets)[seen] * np.sqrt(self.weights[seen])[:, None]
        return r.ravel() / self.sigma

    def information(self, d: np.ndarray) -> np.ndarray:
        """J' J where the world turns after d, by differences."""
        turned = Rotation.from_rotvec(d[20:23])

        def moved(step: np.ndarray) -> np.ndarray:
            turn = (Rotation.from_rotvec(step[20:23]) * turned).as_rotvec()
            return np.concatenate([d[:20] + step[:20], turn, d[23:] + step[23:]])

        h = 1e-5
        columns = [
            (self.residuals(moved(h * e)) - self.residuals(moved(-h * e))) / (2 * h)
            for e in np.eye(N)
        ]
        j = np.stack(columns, 1)
        return j.T @ j

    def measured(self, coupled: int) -> float:
        return plain(measurement.measure_frame)(
            self.work, SOLVER, self.state, self.targets, self.weights, self.row, coupled
        )

    def objective(self, d: np.ndarray, precision: np.ndarray) -> float:
        return 0.5 * (np.sum(self.residuals(d) ** 2) + d @ precision @ d)


@pytest.mark.parametrize("hand", ["left", "right"])
def test_an_uncoupled_frame_says_its_raw_fit(hand):
    c = Case(hand, 0)
    found, s, precision = c.measured(0), c.state, np.linalg.inv(c.state.pose_pose)
    np.testing.assert_allclose(s.precision, precision, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(s.distance, c.raw, atol=1e-12)
    np.testing.assert_allclose(s.pull, precision @ c.raw, rtol=1e-7)
    expected = c.information(c.raw) + measurement.WEAK * np.eye(N)
    np.testing.assert_allclose(s.system, expected, rtol=1e-5, atol=1e-6 * expected.max())
    np.testing.assert_allclose(s.best_angles, c.row.angles)
    np.testing.assert_allclose(s.best_root, c.row.root)
    log = np.linalg.slogdet(s.pose_pose)[1]
    assert found == pytest.approx(c.objective(c.raw, precision) + 0.5 * log, rel=1e-9)


@pytest.mark.parametrize(("hand", "off"), [("left", 0.05), ("right", 0.05), ("left", 0.4)])
def test_a_coupled_frame_says_the_best_pose_under_prior_and_joints(hand, off):
    """Also of a hand that moved far, which is found from its raw fit."""
    c = Case(hand, 1, off)
    # of the turn's distance the slope is known to second order: that of small turns
    c.raw[20:23] *= 0.05 / off
    c = c if off < 0.1 else far(c)
    found, s, precision = c.measured(1), c.state, np.linalg.inv(c.state.pose_pose)
    root = np.linalg.cholesky(precision).T
    limits = c.model.limits
    best = least_squares(lambda d: np.append(c.residuals(d), root @ d), c.raw, xtol=1e-12)
    assert limits.contains(c.angles + best.x[:20]).all()
    np.testing.assert_allclose(s.distance, best.x, atol=1e-3)
    log = np.linalg.slogdet(s.pose_pose)[1]
    assert found - 0.5 * log == pytest.approx(c.objective(s.distance, precision), rel=1e-8)
    assert found - 0.5 * log == pytest.approx(best.cost, abs=1e-2)
    np.testing.assert_allclose(s.best_angles, c.angles + s.distance[:20], atol=1e-12)


def far(c: Case) -> Case:
    """The same, its hand moved by its translation alone."""
    c.raw[:23] *= 0.1
    turned = Rotation.from_rotvec(c.raw[20:23]).as_matrix() @ c.rotation
    c.row.angles, c.row.root = (
        c.angles + c.raw[:20],
        np.append(turned.ravel(), c.translation + c.raw[23:]),
    )
    c.targets = np.where(c.weights[:, None] > 0, c.joints(c.raw) + 1e-3, np.nan)
    return c


def test_a_state_begins_at_a_raw_fit_with_its_covariance():
    c, speed = Case("right", 2), np.arange(1.0, N + 1)
    s = c.state
    plain(kalman.begin)(c.work, SOLVER, s, c.targets, c.weights, c.row, speed)
    expected = c.information(c.raw) + kalman.VAGUE * np.eye(N)
    found = np.linalg.inv(s.pose_pose)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * expected.max())
    # nothing sees the thumb's tip
    assert s.pose_pose[3, 3] == pytest.approx(1 / kalman.VAGUE)
    np.testing.assert_allclose(s.angles, c.row.angles)
    np.testing.assert_allclose(s.rotation.ravel(), c.row.root[:9])
    np.testing.assert_allclose(s.translation, c.row.root[9:])
    np.testing.assert_array_equal(s.speed_speed, np.diag(speed))
    assert not s.pose_speed.any()
    assert not s.velocity.any()
    assert s.known == 1


def test_a_state_with_drift_begins_with_as_much_as_a_fit_has_from_lasting_noise():
    c, speed = Case("left", 4, kind=DRIFTING), np.arange(1.0, N + 1)
    s, w = c.state, c.work
    s.colour = 0.6
    plain(drift.begin_drifting)(w, SOLVER, s, c.targets, c.weights, c.row, speed, 19)
    at_unit = s.white * s.noise * (c.information(c.raw) + kalman.VAGUE * np.eye(N))
    at_unit += drift.LEAST_UNIT * np.eye(N)
    np.testing.assert_allclose(np.linalg.inv(s.unit), at_unit, atol=1e-5 * at_unit.max())
    np.testing.assert_array_equal(s.rest_rest[:N, :N], np.diag(speed))
    np.testing.assert_allclose(s.rest_rest[N:, N:], 0.6 * s.noise * s.unit)
    for zero in (s.rest_rest[:N, N:], s.rest_rest[N:, :N], s.pose_rest, s.velocity, s.drift):
        assert not zero.any()
    # a frame with fewer joints says nothing of it, one with as many does
    kept = s.unit.copy()
    s.system *= 4.0
    plain(drift.learn_unit)(s, 18)
    np.testing.assert_array_equal(s.unit, kept)
    plain(drift.learn_unit)(s, 19)
    assert np.trace(s.unit) < 0.5 * np.trace(kept)
    assert s.unit_seen == 19


@pytest.mark.parametrize("ready", [0, 1])
def test_a_coupled_update_keeps_the_pose_that_was_found(ready):
    """Velocities follow by their regression, covariances as in any update."""
    rng = np.random.default_rng(3)
    s = record(FILTER, 3)
    p, m, z = positive(rng, 2 * N), positive(rng, N), rng.normal(0, 0.1, N)
    s.pose_pose, s.pose_speed, s.speed_speed = p[:N, :N].copy(), p[:N, N:].copy(), p[N:, N:].copy()
    s.precision, s.system = np.linalg.inv(p[:N, :N]), m.copy()
    s.distance, s.pull, s.ready = z.copy(), s.precision @ z, ready
    whole = s.precision + m
    if ready:
        # as the last step has left it, and `system` is not read again
        plain(measurement.factor)(whole.copy(), s.factor)
        s.log_determinant, s.system = np.linalg.slogdet(whole)[1], np.full((N, N), np.nan)
    root = np.append(Rotation.random(rng=rng).as_matrix().ravel(), rng.normal(size=3))
    s.best_root, speed = root, s.velocity.copy()
    information, pull = np.zeros((N, N)), np.zeros(N)
    less = plain(kalman.update)(s, 1, 1, information, pull)
    total = np.linalg.inv(p[:N, :N] + np.linalg.inv(m))
    gain = p[:, :N] @ total
    after = np.block([[s.pose_pose, s.pose_speed], [s.pose_speed.T, s.speed_speed]])
    np.testing.assert_allclose(after, p - gain @ p[:N], atol=1e-10)
    regression = p[N:, :N] @ np.linalg.inv(p[:N, :N])
    np.testing.assert_allclose(s.velocity, speed + regression @ z, atol=1e-10)
    np.testing.assert_array_equal(s.angles, s.best_angles)
    np.testing.assert_array_equal(s.rotation.ravel(), root[:9])
    np.testing.assert_allclose(information, total, atol=1e-10)
    np.testing.assert_allclose(pull, np.linalg.inv(p[:N, :N]) @ z, atol=1e-10)
    assert less == pytest.approx(0.5 * np.linalg.slogdet(whole)[1])
