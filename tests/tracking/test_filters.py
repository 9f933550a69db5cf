"""The Kalman filter against plain NumPy, and what a filter of poses must do."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.evaluation import metrics
from handtrack.hand.limits import preset
from handtrack.hand.rotations import about_axis, matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES
from handtrack.tracking import filters
from handtrack.tracking.filters import KalmanPoseFilter, NoFilter, Pose, make_filter

LIMITS = preset("anatomical")
N = N_ANGLES + 6
LINEAR = np.r_[0:N_ANGLES, N_ANGLES + 3 : N]
DT = 1 / 30


class PlainKalman:
    """Positions and velocities under white acceleration noise, written out for any matrices."""

    def __init__(self, z: np.ndarray, r: np.ndarray, spread: np.ndarray):
        n = len(z)
        self.n, self.spread = n, spread
        self.x = np.concatenate([z, np.zeros(n)])
        known = np.isfinite(np.diag(r))
        self.p = np.zeros((2 * n, 2 * n))
        self.p[:n, :n] = np.where(np.outer(known, known), r, np.eye(n))
        self.p[n:, n:] = np.diag(0.25**2 * spread)

    def step(self, dt: float, z: np.ndarray | None, r: np.ndarray | None) -> np.ndarray:
        n, one = self.n, np.eye(self.n)
        f = np.block([[one, dt * one], [0 * one, one]])
        g = np.concatenate([dt**2 / 2 * one, dt * one])
        self.x = f @ self.x
        self.p = f @ self.p @ f.T + g @ np.diag(self.spread) @ g.T
        if z is not None:
            known = np.flatnonzero(np.isfinite(np.diag(r)))
            h = np.eye(2 * n)[known]
            s = h @ self.p @ h.T + r[np.ix_(known, known)]
            gain = np.linalg.solve(s, h @ self.p).T
            self.x = self.x + gain @ (z[known] - self.x[known])
            a = np.eye(2 * n) - gain @ h
            self.p = a @ self.p @ a.T + gain @ r[np.ix_(known, known)] @ gain.T
        return self.x[:n]


def covariance(rng: np.random.Generator, scale: float = 1e-3) -> np.ndarray:
    """Of the angles and the translation together; the rotation's is apart."""
    a = rng.normal(0, scale, (N, N))
    c = a @ a.T + np.diag(np.full(N, scale**2))
    turn = np.setdiff1d(np.arange(N), LINEAR)
    c[np.ix_(turn, LINEAR)] = c[np.ix_(LINEAR, turn)] = 0.0
    return c


def inside(rng: np.random.Generator) -> np.ndarray:
    """Angles well inside the limits."""
    return 0.1 * rng.uniform(-1, 1, N_ANGLES) + 0.1


def linear(pose: Pose) -> np.ndarray:
    return np.concatenate([pose.angles, pose.translation])


def spread(process_noise: float = 1.0) -> np.ndarray:
    angle, shift = filters.ANGLE_ACCELERATION, filters.TRANSLATION_ACCELERATION
    return (process_noise * np.r_[np.full(N_ANGLES, angle), np.full(3, shift)]) ** 2


@pytest.mark.parametrize("process_noise", [0.2, 1.0])
def test_it_is_a_kalman_filter(process_noise):
    """Random covariances, irregular times, missing frames and angles that are not observed."""
    rng = np.random.default_rng(1)
    ours = KalmanPoseFilter(LIMITS, process_noise)
    plain = None
    for t in range(200):
        dt = rng.uniform(0.005, 0.1)
        pose, r = None, None
        if t == 0 or rng.random() > 0.15:
            pose = Pose(inside(rng), np.eye(3), rng.normal(0, 0.02, 3))
            r = covariance(rng)
            if t and rng.random() < 0.5:
                unseen = rng.choice(N_ANGLES, 3, replace=False)
                r[unseen] = r[:, unseen] = 0.0
                r[unseen, unseen] = np.inf
        out = ours.step(dt, pose, r)
        assert out is not None
        reduced = None if r is None else r[np.ix_(LINEAR, LINEAR)]
        if plain is None:
            plain = PlainKalman(linear(pose), reduced, spread(process_noise))
            expected = linear(pose)
        else:
            expected = plain.step(dt, None if pose is None else linear(pose), reduced)
        if LIMITS.contains(expected[:N_ANGLES]):
            np.testing.assert_allclose(linear(out), expected, atol=1e-9)
        np.testing.assert_allclose(out.translation, expected[N_ANGLES:], atol=1e-9)
        np.testing.assert_allclose(out.angles, LIMITS.clamp(expected[:N_ANGLES]), atol=1e-9)


def moving(t: float) -> Pose:
    """A pose in which everything moves at constant speed."""
    angles = 0.05 + 0.02 * np.arange(N_ANGLES) / N_ANGLES * t
    rotation = about_axis(np.array([0.0, 0.6, 0.8]), np.array(0.9 * t))
    return Pose(angles, rotation, np.array([0.1, -0.2, 0.3]) * t)


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two rotations [rad]."""
    return float(np.linalg.norm(matrix_to_vector(a @ b.T)))


@pytest.mark.parametrize("regular", [True, False])
def test_constant_speed_has_no_lag(regular):
    rng = np.random.default_rng(2)
    kalman = KalmanPoseFilter(LIMITS)
    r = np.diag(np.full(N, 1e-4))
    t = 0.0
    for _ in range(150):
        dt = DT if regular else rng.uniform(0.3 * DT, 3 * DT)
        t += dt
        out = kalman.step(dt, moving(t), r)
    truth = moving(t)
    np.testing.assert_allclose(out.angles, truth.angles, atol=1e-7)
    np.testing.assert_allclose(out.translation, truth.translation, atol=1e-7)
    assert apart(out.rotation, truth.rotation) < 1e-7
    # and it goes on so for as long as nothing is measured
    for _ in range(10):
        t += DT
        out = kalman.step(DT, None, None)
    truth = moving(t)
    np.testing.assert_allclose(out.angles, truth.angles, atol=1e-6)
    np.testing.assert_allclose(out.translation, truth.translation, atol=1e-6)
    assert apart(out.rotation, truth.rotation) < 1e-6


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, 0, -1.0], [0.48, -0.6, 0.64]])
def test_turning_right_round_has_no_jump(axis):
    """Two whole turns, through 180 and 360 degrees, with a little noise."""
    rng = np.random.default_rng(3)
    kalman = KalmanPoseFilter(LIMITS)
    r = np.diag(np.full(N, 1e-5))
    step = 4 * np.pi / 200
    before = None
    for i in range(200):
        truth = about_axis(np.array(axis), np.array(step * i))
        noisy = vector_to_matrix(rng.normal(0, 3e-3, 3)) @ truth
        out = kalman.step(DT, Pose(np.full(N_ANGLES, 0.05), noisy, np.zeros(3)), r)
        np.testing.assert_allclose(out.rotation @ out.rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(out.rotation) > 0
        if i > 10:
            assert apart(out.rotation, truth) < 0.02
            assert apart(out.rotation, before) == pytest.approx(step, abs=0.02)
        before = out.rotation


def test_a_frame_of_the_world_makes_no_difference():
    """Filtered poses turn with the world that they are in."""
    rng = np.random.default_rng(4)
    turn = vector_to_matrix(np.array([1.0, -2.0, 0.7]))
    a, b = KalmanPoseFilter(LIMITS), KalmanPoseFilter(LIMITS)
    r = np.diag(np.full(N, 1e-4))
    for i in range(40):
        rotation = vector_to_matrix(rng.normal(0, 0.1, 3)) @ about_axis(
            np.array([0.0, 0.0, 1.0]), np.array(0.1 * i)
        )
        pose = Pose(inside(rng), rotation, rng.normal(0, 0.1, 3))
        one = a.step(DT, pose, r)
        other = b.step(DT, Pose(pose.angles, turn @ rotation, turn @ pose.translation), r)
        np.testing.assert_allclose(other.rotation, turn @ one.rotation, atol=1e-9)
        np.testing.assert_allclose(other.translation, turn @ one.translation, atol=1e-9)


@pytest.mark.parametrize("name", ["li2021", "anatomical"])
def test_filtered_angles_keep_the_limits(name):
    """Angles that bounce between their limits would carry a free filter past them."""
    rng = np.random.default_rng(5)
    limits = preset(name)
    kalman = KalmanPoseFilter(limits)
    r = np.diag(np.full(N, 1e-3))
    outside = 0
    for i in range(120):
        ends = limits.upper if i // 20 % 2 else limits.lower
        angles = limits.clamp(ends + rng.normal(0, 0.05, N_ANGLES))
        out = kalman.step(DT, Pose(angles, np.eye(3), np.zeros(3)), r)
        assert limits.contains(out.angles)
        outside += not limits.contains(kalman._kf.x[:N_ANGLES, 0])
    assert outside > 20


def test_an_angle_that_is_not_observed_coasts_alone():
    """The others are as if it was not there."""
    rng = np.random.default_rng(6)
    with_it, without = KalmanPoseFilter(LIMITS), KalmanPoseFilter(LIMITS)
    r = np.diag(np.full(N, 1e-4))
    unseen = r.copy()
    unseen[7, 7] = np.inf
    others = np.arange(N_ANGLES) != 7
    for i in range(40):
        pose = Pose(inside(rng), np.eye(3), rng.normal(0, 0.1, 3))
        a = with_it.step(DT, pose, r)
        b = without.step(DT, pose, unseen if i > 20 else r)
        assert np.isfinite(b.angles).all()
        np.testing.assert_allclose(b.angles[others], a.angles[others], atol=1e-9)
    wild = pose.angles.copy()
    wild[7] = 1.0
    c = without.step(DT, Pose(wild, np.eye(3), np.zeros(3)), unseen)
    assert abs(c.angles[7] - 1.0) > 0.3


def test_the_first_pose_passes_through_and_reset_forgets():
    rng = np.random.default_rng(7)
    r = covariance(rng)
    kalman = KalmanPoseFilter(LIMITS)
    assert kalman.step(0.0, None, None) is None
    poses = [Pose(inside(rng), about_axis(np.eye(3)[0], np.array(3.0)), np.ones(3))]
    poses += [Pose(inside(rng), np.eye(3), np.zeros(3)) for _ in range(5)]
    first = kalman.step(1e9, poses[0], r)
    for a, b in zip(first, poses[0], strict=True):
        np.testing.assert_array_equal(a, b)
    run = [kalman.step(DT, pose, r) for pose in poses[1:]]
    kalman.reset()
    assert kalman.step(DT, None, None) is None
    kalman.step(0.0, poses[0], r)
    for before, pose in zip(run, poses[1:], strict=True):
        for a, b in zip(before, kalman.step(DT, pose, r), strict=True):
            np.testing.assert_array_equal(a, b)


def test_arguments_and_results_stay_as_they_are():
    rng = np.random.default_rng(8)
    kalman = KalmanPoseFilter(LIMITS)
    out, copies = [], []
    for _ in range(5):
        pose, r = Pose(inside(rng), np.eye(3), rng.normal(0, 0.1, 3)), covariance(rng)
        before = [x.copy() for x in (*pose, r)]
        out.append(kalman.step(DT, pose, r))
        copies.append([x.copy() for x in out[-1]])
        for a, b in zip((*pose, r), before, strict=True):
            np.testing.assert_array_equal(a, b)
    for pose, copy in zip(out, copies, strict=True):
        for a, b in zip(pose, copy, strict=True):
            np.testing.assert_array_equal(a, b)


def test_no_filter_passes_poses_through():
    pose = Pose(np.zeros(N_ANGLES), np.eye(3), np.zeros(3))
    plain = NoFilter()
    assert plain.step(DT, pose, np.eye(N)) is pose
    assert plain.step(DT, None, None) is None
    assert isinstance(make_filter("none", LIMITS), NoFilter)
    assert isinstance(make_filter("kalman", LIMITS), KalmanPoseFilter)


@pytest.mark.parametrize("process_noise", [0.0, -1.0, np.inf, np.nan])
def test_process_noise_must_be_positive(process_noise):
    with pytest.raises(ht.SettingsError, match="process noise"):
        KalmanPoseFilter(LIMITS, process_noise)


@pytest.mark.parametrize(
    ("noise_mm", "calmer", "nearer"), [(1, 0.9, 0.95), (2, 0.75, 0.96), (5, 0.65, 1.02)]
)
def test_it_steadies_a_noisy_sequence(noise_mm, calmer, nearer, sample):
    """Less jitter than the fits, and no farther from the truth."""
    rng = np.random.default_rng(9)
    joints = sample.truth + rng.normal(0, noise_mm * 1e-3, sample.truth.shape)
    noisy = ht.Sequence(sample.time_ns, joints)
    raw, steady = (ht.track(noisy, filter=name) for name in filters.FILTERS)
    jitter, error = [], []
    for track in (raw, steady):
        jitter.append(np.nanmean(metrics.jitter(track.filtered_joints, time_ns=track.time_ns)))
        error.append(metrics.mpjpe(track.filtered_joints, sample.truth).mean())
    assert jitter[1] < calmer * jitter[0]
    assert error[1] < nearer * error[0]
