"""The bundle adjustment: derivatives, one step against the dense system, descent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handtrack.calibration import bundle
from handtrack.calibration.bundle import Clip, Poses, solve
from handtrack.calibration.chains import SIZE, Chains
from handtrack.calibration.explain import Balls
from handtrack.calibration.freedoms import freedoms
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix

LOOSE = np.deg2rad([60.0, 25.0, 60.0, 60.0])
STEP = 1e-6


def chains(twist: float = 0.0, hand: str = "left") -> Chains:
    model = replace(HandModel.default(hand), thumb_twist=twist)
    return Chains.of(model, LOOSE, np.deg2rad(3.0))


def constants(rng: np.random.Generator) -> np.ndarray:
    """Some way off the prior hand: bases, bones, axes."""
    x = rng.normal(0, 0.1, (5, SIZE))
    x[:, :12] *= 0.03
    return x


def directions(rng: np.random.Generator, frames: int) -> np.ndarray:
    u = rng.normal(size=(frames, 5, 3, 3))
    return u / np.linalg.norm(u, axis=-1, keepdims=True)


def differences(hand, shared, local, kind: str, k: int) -> np.ndarray:
    """Central differences of the points by one local unknown or constant of every finger."""
    if kind == "shared":
        d = np.zeros_like(shared)
        d[:, k] = STEP
        ends = [hand.points(shared + s * d, local) for s in (1, -1)]
    else:
        size = hand.linearised(shared, local)[1].shape[-1]
        d = np.zeros((len(local), 5, size))
        d[..., k] = STEP
        ends = [hand.points(shared, hand.moved(local, s * d)) for s in (1, -1)]
    return (ends[0] - ends[1]) / (2 * STEP)


# ---- the hands ----


@pytest.mark.parametrize("twist", [0.0, 0.3])
def test_chains_move_as_their_derivatives_say(twist):
    rng = np.random.default_rng(0)
    hand, shared, local = chains(twist), constants(rng), rng.normal(0, 0.8, (3, 5, 4))
    points, by_angle, by_shared = hand.linearised(shared, local)
    np.testing.assert_allclose(points, hand.points(shared, local), rtol=0, atol=1e-15)
    for k in range(4):
        wanted = differences(hand, shared, local, "local", k)
        np.testing.assert_allclose(by_angle[..., k], wanted, rtol=0, atol=1e-9)
    for k in range(SIZE):
        wanted = differences(hand, shared, local, "shared", k)
        # the thumb's inner twist turns about its bone: calibration never turns that bone
        fingers = slice(1 if twist and k in (3, 4, 5) else 0, 5)
        np.testing.assert_allclose(by_shared[:, fingers, ..., k], wanted[:, fingers], atol=1e-9)


def test_chains_are_the_model():
    rng = np.random.default_rng(1)
    model = replace(HandModel.default("left"), thumb_twist=0.3)
    angles = rng.normal(0, 0.5, (4, 20))
    points = chains(0.3).points(np.zeros((5, SIZE)), angles.reshape(4, 5, 4))
    wanted = model.joints(angles)[:, 1:] - model.rest_joints[0]
    np.testing.assert_allclose(points.reshape(4, 20, 3), wanted, rtol=0, atol=1e-15)


def test_balls_move_as_their_derivatives_say():
    rng = np.random.default_rng(2)
    hand, shared, local = Balls(), rng.uniform(0.02, 0.05, (5, 6)), directions(rng, 3)
    _, by_local, by_shared = hand.linearised(shared, local)
    for k in range(6):
        wanted = differences(hand, shared, local, "local", k)
        np.testing.assert_allclose(by_local[..., k], wanted, rtol=0, atol=1e-9)
        wanted = differences(hand, shared, local, "shared", k)
        np.testing.assert_allclose(by_shared[..., k], wanted, rtol=0, atol=1e-9)


def test_the_angles_prior_has_the_gradient_it_claims():
    rng = np.random.default_rng(3)
    hand, local = chains(), rng.normal(0, 1.2, (2, 5, 4))
    _, slope, curvature = hand.pull(local)
    assert (curvature >= 1 / LOOSE**2 - 1e-12).all()
    assert (curvature > 1 / LOOSE**2 + 1).any()  # some are outside their limits
    for k in range(4):
        d = np.zeros_like(local)
        d[1, 2, k] = STEP
        difference = (hand.pull(local + d)[0] - hand.pull(local - d)[0]) / (4 * STEP)
        assert slope[1, 2, k] == pytest.approx(difference, rel=1e-5, abs=1e-5)


# ---- the solver ----


def problem(rng: np.random.Generator, frames: int = 4, noise: float = 0.002, clips: int = 1):
    """Clips of one hand that is off the prior, seen with noise; where to start."""
    hand = chains(hand="right")
    moves = freedoms(hand)
    true = rng.normal(0, 0.05, moves.n) * np.where(np.arange(moves.n) % 16 < 8, 0.05, 1.0)
    made, poses = [], []
    for _ in range(clips):
        local = rng.normal(0.3, 0.3, (frames, 5, 4))
        rotation = vector_to_matrix(rng.normal(size=(frames, 3)))
        shift = rng.normal(0, 0.2, (frames, 3))
        shared = (moves.basis @ true).reshape(5, SIZE)
        points = bundle.with_wrist(hand.points(shared, local)) @ rotation.swapaxes(1, 2)
        seen = points + shift[:, None] + noise * rng.normal(size=points.shape)
        weights = np.where(rng.random(seen.shape[:2]) < 0.1, 0.0, 1.0)
        origin = np.zeros((5, SIZE))
        made.append(Clip(hand, seen, weights, origin, moves.basis, max(noise, 3e-4)))
        near = local + rng.normal(0, 0.05, local.shape)
        poses.append(Poses(near, rotation, shift))
    return made, moves, true, poses


def residuals(clips, precision, free, poses) -> np.ndarray:
    """All residuals of the objective in a row, priors of the angles left out."""
    rows = []
    for clip, p in zip(clips, poses, strict=True):
        points = bundle.with_wrist(clip.hand.points(clip.shared(free), p.local))
        placed = points @ p.rotation.swapaxes(1, 2) + p.translation[:, None]
        w = np.sqrt(clip.weights)[..., None] / clip.noise
        rows.append((w * (placed - clip.targets)).ravel())
    return np.concatenate([*rows, np.linalg.cholesky(precision).T @ free])


def test_a_step_is_that_of_the_dense_system():
    """Gauss-Newton over all unknowns at once, by finite differences, gives the same step."""
    rng = np.random.default_rng(4)
    frames = 2
    clips, moves, _, poses = problem(rng, frames=frames, clips=2)
    hand = replace(clips[0].hand, loose=np.full(4, 1e6), strict=1e6)
    clips = [
        replace(clip, hand=hand, weights=clip.weights * rng.uniform(0.2, 3.0, (frames, 21)))
        for clip in clips
    ]
    free = rng.normal(0, 0.01, moves.n)
    n = moves.n

    def moved(x: np.ndarray) -> tuple[np.ndarray, list[Poses]]:
        new = []
        for c, p in enumerate(poses):
            part = x[n + c * frames * 26 : n + (c + 1) * frames * 26].reshape(frames, 26)
            turn, shift = part[:, 20:23], part[:, 23:]
            new.append(
                Poses(
                    p.local + part[:, :20].reshape(-1, 5, 4),
                    p.rotation @ vector_to_matrix(turn),
                    p.translation + np.einsum("tij,tj->ti", p.rotation, shift),
                )
            )
        return free + x[:n], new

    size = n + 2 * frames * 26
    r = residuals(clips, moves.precision, free, poses)
    jacobian = np.empty((len(r), size))
    for k in range(size):
        d = np.zeros(size)
        d[k] = STEP
        ends = [residuals(clips, moves.precision, *moved(s * d)) for s in (1, -1)]
        jacobian[:, k] = (ends[0] - ends[1]) / (2 * STEP)
    normal = jacobian.T @ jacobian + bundle._TRACE * np.eye(size)
    wanted = -np.linalg.solve(normal, jacobian.T @ r)
    systems = bundle._systems(clips, free, poses)
    found, after = bundle._step(systems, moves.precision, free, 0.0)
    np.testing.assert_allclose(found - free, wanted[:n], rtol=1e-4, atol=1e-6)
    _, expected = moved(wanted)
    for a, b in zip(after, expected, strict=True):
        np.testing.assert_allclose(a.local, b.local, rtol=0, atol=2e-5)
        np.testing.assert_allclose(a.rotation, b.rotation, rtol=0, atol=2e-5)
        np.testing.assert_allclose(a.translation, b.translation, rtol=0, atol=2e-6)
    # and what it says the data know of the constants is the Schur complement
    information = sum(s.reduced(0.0).matrix for s in systems)
    rest = normal[n:, n:]
    schur = normal[:n, :n] - normal[:n, n:] @ np.linalg.solve(rest, normal[n:, :n])
    np.testing.assert_allclose(
        information, schur - moves.precision, rtol=0, atol=1e-5 * np.abs(schur).max()
    )


@pytest.mark.parametrize("loss", [{}, {"spread": 0.003, "worth": 0.3}])
def test_variances_are_those_of_poses_with_known_constants(loss):
    """Of all joints, whatever the loss thinks of them and the clip is worth."""
    rng = np.random.default_rng(9)
    (clip,), moves, _, (poses,) = problem(rng, frames=2, noise=0.002)
    clip = replace(clip, hand=replace(clip.hand, loose=np.full(4, 1e6), strict=1e6))
    free = rng.normal(0, 0.01, moves.n)

    def at(x: np.ndarray) -> np.ndarray:
        part = x.reshape(2, 26)
        turned = poses.rotation @ vector_to_matrix(part[:, 20:23])
        moved = Poses(
            poses.local + part[:, :20].reshape(-1, 5, 4), turned, poses.translation + part[:, 23:]
        )
        return residuals([clip], np.eye(moves.n), free, [moved])

    steps = STEP * np.eye(52)
    jacobian = np.stack([(at(d) - at(-d)) / (2 * STEP) for d in steps], 1)
    covariance = np.linalg.inv(jacobian.T @ jacobian + bundle._TRACE * np.eye(52))
    wanted = np.diag(covariance).reshape(2, 26)[:, :20].reshape(2, 5, 4)
    (system,) = bundle._systems([replace(clip, **loss)], free, [poses])
    np.testing.assert_allclose(system.variance(), wanted, rtol=1e-3)


def test_the_solver_descends_to_a_stationary_point():
    rng = np.random.default_rng(5)
    clips, moves, _, poses = problem(rng, frames=20)
    first = solve(clips, moves.precision, np.zeros(moves.n), poses, max_steps=1)
    last = solve(clips, moves.precision, np.zeros(moves.n), poses, max_steps=60, tolerance=1e-12)
    assert last.cost < first.cost
    again = solve(clips, moves.precision, last.free, last.poses, max_steps=3, tolerance=0)
    assert again.cost == pytest.approx(last.cost, rel=1e-8)
    np.testing.assert_allclose(again.free, last.free, rtol=0, atol=1e-4)


def test_clean_frames_are_explained_whole():
    rng = np.random.default_rng(6)
    clips, moves, _, poses = problem(rng, frames=40, noise=0.0)
    clips = [replace(c, hand=replace(c.hand, loose=np.full(4, 1e3), strict=1e3)) for c in clips]
    weak = 1e-6 * moves.precision
    found = solve(clips, weak, np.zeros(moves.n), poses, max_steps=200, tolerance=1e-6)
    off = clips[0].distances(found.free, found.poses[0])[clips[0].weights > 0]
    assert off.max() < 2e-5


def test_strays_hardly_pull():
    """In units of how well the constants are known; the median of draws.

    Some draws bend a hand far beyond its limits: there a robust fit leaves joints instead.
    """
    pulled = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        (clip,), moves, _, poses = problem(rng, frames=40, noise=0.001)
        clip = replace(clip, hand=replace(clip.hand, loose=np.full(4, 1e3), strict=1e3))
        bad = clip.targets.copy()
        bad[rng.random(bad.shape[:2]) < 0.03] += 0.08
        clean = solve([clip], moves.precision, np.zeros(moves.n), poses)
        begun = moves.precision, clean.free, clean.poses
        plain = solve([replace(clip, targets=bad)], *begun).free
        kept = solve([replace(clip, targets=bad, spread=0.008)], *begun, max_steps=100).free
        apart = [free - clean.free for free in (kept, plain)]
        pulled.append([d @ clean.information @ d / moves.n for d in apart])
    robust, plain = np.median(pulled, 0)
    assert plain > 50
    assert robust < 0.1 * plain


def test_constants_that_are_kept_stay():
    rng = np.random.default_rng(8)
    (clip,), moves, true, poses = problem(rng, frames=10)
    origin = (moves.basis @ true).reshape(5, SIZE)
    kept = replace(clip, origin=origin, basis=np.zeros((5 * SIZE, 0)))
    found = solve([kept], np.zeros((0, 0)), np.zeros(0), poses)
    assert found.free.shape == (0,)
    off = kept.distances(found.free, found.poses[0])[clip.weights > 0]
    assert 0.001 < off.mean() < 0.004  # the noise
