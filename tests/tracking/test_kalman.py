"""The compiled Kalman filter and smoothers against filterpy, closed forms and differences."""

from __future__ import annotations

import numpy as np
import pytest
from filter_cases import MODEL, frames_of, hard_frames, moving, poses, steady
from scipy.linalg import expm

from handtrack.hand.rotations import matrix_to_vector, vector_to_matrix
from handtrack.kernels import filter_loop as kernels
from handtrack.kernels import motion_evidence as motion
from handtrack.kernels import motion_noise
from handtrack.kernels.filter_state import BEGUN, KEPT, NOTE, PREDICTED, UPDATED
from handtrack.tracking import process_noise
from handtrack.tracking.filterpy_filter import FilterPyFilter
from handtrack.tracking.filters import make_filter
from handtrack.tracking.kalman import KalmanFilter

N = 26


def kalman(kind=KalmanFilter, **settings) -> KalmanFilter:
    return kind(MODEL, steady("kalman", **settings))


@pytest.mark.parametrize("couple", [True, False])
@pytest.mark.parametrize("process_noise", ["auto", 1.0])
def test_compiled_equals_filterpy(couple, process_noise):
    """Poses, velocities, covariances, likelihoods and what a smoother needs."""
    settings = {"couple": couple, "process_noise": process_noise}
    frames = hard_frames()
    n = len(frames.raw)
    ours, theirs = kalman(**settings), kalman(FilterPyFilter, **settings)
    kept = np.zeros(n, KEPT), np.zeros(n, KEPT)
    (a, notes_a), (b, notes_b) = ours.run(frames, kept[0]), theirs.run(frames, kept[1])
    assert set(notes_a["kind"]) == {BEGUN, UPDATED, PREDICTED}
    np.testing.assert_array_equal(notes_a["kind"], notes_b["kind"])
    np.testing.assert_allclose(poses(a), poses(b), atol=1e-9, rtol=0)
    x, y = ours.state[0], theirs.state[0]
    for name in ("angles", "rotation", "translation", "velocity"):
        np.testing.assert_allclose(x[name], y[name], atol=1e-9, rtol=0)
    for name in ("pose_pose", "speed_speed"):
        largest = np.abs(np.diagonal(y[name])).max()
        np.testing.assert_allclose(x[name], y[name], atol=1e-9 * largest, rtol=0)
    for name in ("pose_pose", "pose_speed", "information", "pull"):
        a, b = kept[0][name], kept[1][name]
        np.testing.assert_allclose(a, b, atol=1e-7 * np.abs(b).max(), rtol=0)
    np.testing.assert_allclose(notes_a["likelihood"], notes_b["likelihood"], rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("name", ["kalman", "fixed-lag", "rts"])
def test_engines_agree_whatever_the_filter(name):
    frames = hard_frames(60)
    out = []
    for engine in ("compiled", "filterpy"):
        made = make_filter(steady(name, process_noise=1.0, engine=engine), MODEL)
        first, known = made.advance(frames)
        last, known_too = made.finish()
        assert np.concatenate([known, known_too]).all()
        out.append(poses(np.concatenate([first, last])))
    np.testing.assert_allclose(*out, atol=1e-8, rtol=0)


def test_the_smoother_is_rauch_tung_and_striebels():
    """The textbook's recursion over full covariances, with tiny turns (it is linear then)."""
    rng = np.random.default_rng(2)
    times_ns, _, _, joints = moving(40, turn=0.0, speed=0.01)
    joints = joints[:1] + rng.normal(0, 1e-6, joints.shape)
    joints[20, 5:] = np.nan
    frames = frames_of(times_ns, joints)
    n = len(joints)
    settings = {"couple": False, "process_noise": 1.0, "noise_mm": 5.0}
    causal, kept = kalman(**settings), np.zeros(n, KEPT)
    states, before = [], []
    for t in range(n):
        causal.run(frames.part(slice(t, t + 1)), kept[t : t + 1])
        x = causal.state[0]
        cross = x["pose_speed"]
        p = np.block([[x["pose_pose"], cross], [cross.T, x["speed_speed"]]])
        states.append((np.append(pose_in(x), x["velocity"]), p))
        before.append(pose_in(kept[t]))
    f01, f11 = kept[1]["f01"], kept[1]["f11"]
    f = np.block([[np.eye(N), np.diag(f01)], [np.zeros((N, N)), np.diag(f11)]])
    q = [np.diag(process_noise.DENSITY * kept[1][name]) for name in ("q00", "q01", "q11")]
    q = np.block([[q[0], q[1]], [q[1], q[2]]])
    expected = [states[-1][0]]
    for t in range(n - 2, -1, -1):
        x, p = states[t]
        ahead = f @ p @ f.T + q
        gain = np.linalg.solve(ahead, f @ p).T
        change = np.concatenate(
            [between(before[t + 1], expected[0]), expected[0][32:] - f11 * x[32:]]
        )
        step = gain @ change
        new = x.copy()
        new[:20] += step[:20]
        new[20:29] = (vector_to_matrix(step[20:23]) @ x[20:29].reshape(3, 3)).ravel()
        new[29:32] += step[23:26]
        new[32:] += step[26:]
        expected.insert(0, new)
    smoother = make_filter(steady("rts", **settings), MODEL)
    smoother.advance(frames)
    out, _ = smoother.finish()
    np.testing.assert_allclose(poses(out)[:, :32], np.array(expected)[:, :32], atol=1e-10, rtol=0)


def pose_in(record: np.void) -> np.ndarray:
    """(32,) angles, rotation by rows, translation."""
    return np.concatenate([record["angles"], record["rotation"].ravel(), record["translation"]])


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(26,) from pose a (32,) to pose b."""
    turn = matrix_to_vector(b[20:29].reshape(3, 3) @ a[20:29].reshape(3, 3).T)
    return np.concatenate([b[:20] - a[:20], turn, b[29:32] - a[29:32]])


@pytest.mark.parametrize("g", [0.0, 1e-6, 9e-3, 1.1e-2, 0.3, 5.0])
def test_transition_and_noise_are_the_integrals(g):
    """Van Loan's matrix exponential of dx = v dt, dv = -decay v dt + dw."""
    dt = 0.03
    decay = g / dt
    a = np.array([[0.0, 1.0], [0.0, -decay]])
    big = np.block([[-a, np.diag([0.0, 1.0])], [np.zeros((2, 2)), a.T]]) * dt
    e = expm(big)
    f = e[2:, 2:].T
    q = f @ e[:2, 2:]
    found = motion_noise.unit_process.py_func(decay, dt)
    expected = (f[0, 1], f[1, 1], q[0, 0], q[0, 1], q[1, 1])
    np.testing.assert_allclose(found, expected, rtol=1e-7)


@pytest.mark.parametrize("couple", [True, False])
def test_evidence_is_the_slope_of_the_likelihood(couple):
    """By each density, against central differences."""
    rng = np.random.default_rng(3)
    times_ns, _, _, joints = moving(50, turn=0.2)
    frames = frames_of(times_ns, joints + rng.normal(0, 3e-4, joints.shape))
    filter_ = kalman(couple=couple, process_noise=1.0, noise_mm=0.3)
    density = process_noise.DENSITY * np.linspace(0.3, 3.0, N)

    def likelihood(density: np.ndarray, kept: np.ndarray | None = None) -> tuple[float, np.ndarray]:
        filter_.reset()
        filter_.process = process_noise.process(density)
        notes = filter_.run(frames, kept)[1]
        return notes["likelihood"].sum(), notes

    kept, evidence = np.zeros(50, KEPT), np.zeros((2, N))
    _, notes = likelihood(density, kept)
    work = np.zeros((motion.MATRICES, N, N))
    motion.add_evidence(notes, kept, work, evidence)
    slope = 0.5 * density * (evidence[0] - evidence[1])
    for i in (0, 5, 11, 19, 20, 22, 24):
        more, less = density.copy(), density.copy()
        more[i] *= 1.01
        less[i] /= 1.01
        difference = (likelihood(more)[0] - likelihood(less)[0]) / (2 * np.log(1.01))
        assert slope[i] == pytest.approx(difference, rel=0.05, abs=0.05)


def test_coupled_poses_minimise_prior_and_joints_under_the_limits():
    """No feasible change of the pose lowers the objective, at limits or inside them."""
    rng = np.random.default_rng(4)
    times_ns, _, _, joints = moving(30)
    noisy = joints + rng.normal(0, 6e-3, joints.shape)
    frames = frames_of(times_ns, noisy)
    filter_ = kalman(FilterPyFilter, process_noise=1.0)
    filter_.run(frames.part(slice(0, 29)), None)
    x = filter_.state[0]
    given = frames.part(slice(29, 30))
    shown = (given.joints[0], given.weights[0], given.raw[:1], np.zeros(1, NOTE))
    with_model = (filter_.state, *filter_.with_model)
    motion_now = (filter_.process, filter_.grid)
    assert kernels.before_frame(*with_model, motion_now, given.times_ns[0], *shown)
    # a prior that pulls some angles out of their limits
    x["angles"][[2, 7, 11]] += 4.0
    prior = pose_in(x)
    assert kernels.measure(*with_model, *shown)
    precision, noise = x["precision"].copy(), x["noise"]

    def objective(pose: np.ndarray) -> float:
        d = between(prior, pose)
        out = MODEL.joints(pose[:20], pose[20:29].reshape(3, 3), pose[29:32])
        return 0.5 * (d @ precision @ d + np.square(out - noisy[29]).sum() / noise)

    best = np.concatenate([x["best_angles"], x["best_root"]])
    assert MODEL.limits.contains(best[:20])
    at_limit = np.isclose(best[:20], MODEL.limits.upper, atol=1e-9)
    assert at_limit.sum() >= 2
    least = objective(best)
    for size in (1e-4, 1e-3, 1e-2):
        for _ in range(200):
            step = rng.normal(0, size, N)
            pose = best.copy()
            pose[:20] = MODEL.limits.clamp(pose[:20] + step[:20])
            pose[20:29] = (vector_to_matrix(step[20:23]) @ best[20:29].reshape(3, 3)).ravel()
            pose[29:32] += 0.1 * step[23:]
            assert objective(pose) > least - 1e-4


def made_motion(density: np.ndarray, frames: int, rng: np.random.Generator) -> np.ndarray:
    """Joints of a hand that moves as the filter believes."""
    dt = 1 / 60
    steps = [motion_noise.unit_process.py_func(process_noise.DECAY, dt)] * N
    x, v = np.zeros(N), np.zeros(N)
    middle = 0.5 * (MODEL.limits.lower + MODEL.limits.upper)
    middle[[0, 1, 4, 5, 8, 9, 12, 13, 16, 17]] = 0.0
    rotation, out = np.eye(3), []
    for _ in range(frames):
        move = np.empty(N)
        for i, (f01, f11, q00, q01, q11) in enumerate(steps):
            a, b = rng.multivariate_normal([0, 0], density[i] * np.array([[q00, q01], [q01, q11]]))
            move[i] = f01 * v[i] + a
            v[i] = f11 * v[i] + b
        x += move
        rotation = vector_to_matrix(move[20:23]) @ rotation
        out.append(MODEL.joints(middle + x[:20], rotation, x[23:]))
    return np.array(out)


def test_the_motions_noise_is_learnt():
    """In a stream and from a sequence, within a factor that so few frames allow."""
    rng = np.random.default_rng(5)
    factor = np.full(N, 0.05)  # small steps keep the angles inside their limits
    factor[20:23], factor[23:] = 3.0, 0.1
    density = process_noise.DENSITY * factor
    joints = made_motion(density, 300, rng)
    joints += rng.normal(0, 3e-4, joints.shape)
    times_ns = np.arange(300) * int(1e9 / 60)
    frames = frames_of(times_ns, joints)
    stream = kalman()
    stream.run(frames, None)
    learnt = stream.state[0]["learnt"]
    ratio = np.log(learnt / density)
    assert np.abs(ratio).max() < np.log(5.0)
    assert abs(ratio.mean()) < np.log(1.6)
    smoother = make_filter(steady("rts"), MODEL)
    smoother.advance(frames)
    smoother._kalman.numbers = stream.numbers._replace(follow=0)
    ratio = np.log(smoother._learnt(smoother._inputs) / density)
    assert np.abs(ratio).max() < np.log(2.5)
    assert abs(ratio.mean()) < np.log(1.2)
