"""Procrustes alignment against SciPy, against loops and against transforms that are known."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.spatial
from scipy.spatial.transform import Rotation

from handtrack.evaluation import alignment, metrics


def hands(seed=0, frames=60, joints=21):
    rng = np.random.default_rng(seed)
    b = rng.normal(size=(frames, joints, 3)) * 0.05 + rng.normal(size=(frames, 1, 3))
    a = b + rng.normal(size=b.shape) * 0.01
    turn = Rotation.random(frames, random_state=seed).as_matrix()
    a = np.einsum("tij,tkj->tki", turn, a) * rng.uniform(0.5, 2, (frames, 1, 1)) + 0.3
    return a, b


def one_frame(a, b, scale, reflection):
    """A single frame, from textbooks: Umeyama 1991 eq. 40-43."""
    ma, mb = a.mean(0), b.mean(0)
    covariance = (b - mb).T @ (a - ma) / len(a)
    u, d, vt = np.linalg.svd(covariance)
    s = np.eye(3)
    if not reflection and np.linalg.det(u) * np.linalg.det(vt) < 0:
        s[2, 2] = -1
    r = u @ s @ vt
    c = np.trace(np.diag(d) @ s) / ((a - ma) ** 2).sum(1).mean() if scale else 1.0
    return np.linalg.norm((c * (r @ a.T).T + mb - c * r @ ma) - b, axis=1).mean()


@pytest.mark.parametrize(
    ("metric", "scale", "reflection"),
    [
        (metrics.pa_mpjpe, True, False),
        (metrics.rigid_pa_mpjpe, False, False),
        (metrics.reflection_pa_mpjpe, True, True),
        (metrics.pa_mpvpe, True, False),
    ],
)
def test_against_a_loop_with_missing_joints(metric, scale, reflection):
    a, b = hands(2)
    b[::2] = b[::2] * [1, 1, -1]  # half of the frames are mirrored
    rng = np.random.default_rng(0)
    a[rng.random(a.shape[:2]) < 0.2] = np.nan
    b[rng.random(b.shape[:2]) < 0.1, 1] = np.nan  # one coordinate makes the joint missing
    got = metric(a, b)
    for t in range(len(a)):
        keep = ~(np.isnan(a[t]).any(1) | np.isnan(b[t]).any(1))
        expected = one_frame(a[t, keep], b[t, keep], scale, reflection)
        assert got[t] == pytest.approx(expected, abs=1e-12)


def test_against_scipy_spatial_procrustes():
    # SciPy allows reflections and normalises the reference: undo its scale
    a, b = hands(3)
    for t in range(len(a)):
        reference, moved, _ = scipy.spatial.procrustes(b[t], a[t])
        size = np.linalg.norm(b[t] - b[t].mean(0))
        expected = np.linalg.norm(reference - moved, axis=1).mean() * size
        assert metrics.reflection_pa_mpjpe(a, b)[t] == pytest.approx(expected, abs=1e-9)
        # these frames need no reflection, so the proper one is the same
        assert metrics.pa_mpjpe(a, b)[t] == pytest.approx(expected, abs=1e-9)


def test_reflection_variant_against_freihands_steps():
    a, b = hands(4)
    a = a * [1, -1, 1]
    got = metrics.reflection_pa_mpjpe(a, b)
    for t in range(len(a)):
        p, q = b[t] - b[t].mean(0), a[t] - a[t].mean(0)
        s1, s2 = np.linalg.norm(p), np.linalg.norm(q)
        r, s = scipy.linalg.orthogonal_procrustes(p / s1, q / s2)
        moved = (q / s2) @ r.T * s * s1
        assert got[t] == pytest.approx(np.linalg.norm(moved - p, axis=1).mean(), abs=1e-12)
    assert (metrics.pa_mpjpe(a, b) > 1.5 * got).all()


def test_a_known_transform_is_found():
    rng = np.random.default_rng(5)
    a = rng.normal(size=(50, 21, 3))
    r = Rotation.random(50, random_state=1).as_matrix()
    s, t = rng.uniform(0.1, 10, 50), rng.normal(size=(50, 3))
    b = s[:, None, None] * np.einsum("tij,tkj->tki", r, a) + t[:, None]
    got_s, got_r, got_t = metrics.procrustes(a, b)
    np.testing.assert_allclose(got_s, s, rtol=1e-12)
    np.testing.assert_allclose(got_r, r, atol=1e-12)
    np.testing.assert_allclose(got_t, t, atol=1e-12)
    np.testing.assert_allclose(metrics.align(a, b), b, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(got_r), 1.0)
    # the order matters: the estimate is moved, so the error is in the reference's size
    noisy = a + rng.normal(size=a.shape) * 0.01
    ratio = metrics.pa_mpjpe(noisy, b) / metrics.pa_mpjpe(noisy, a)
    np.testing.assert_allclose(ratio, s, rtol=1e-9)


def test_similarity_is_the_least_squares_optimum():
    a, b = hands(6, frames=5)
    best = ((metrics.align(a, b) - b) ** 2).sum((1, 2))
    rng = np.random.default_rng(0)
    s, r, t = metrics.procrustes(a, b)
    for _ in range(50):
        r2 = r @ Rotation.from_rotvec(rng.normal(size=3) * 0.05).as_matrix()
        s2 = s * (1 + rng.normal() * 0.02)
        moved = s2[:, None, None] * np.einsum("tij,tkj->tki", r2, a) + t[:, None]
        moved += (b - moved).mean(1, keepdims=True)
        assert (((moved - b) ** 2).sum((1, 2)) >= best - 1e-12).all()


def test_a_mirrored_hand_is_an_error():
    _, b = hands(7)
    mirrored = b * [-1, 1, 1]
    assert metrics.reflection_pa_mpjpe(mirrored, b).max() < 1e-12
    assert metrics.pa_mpjpe(mirrored, b).min() > 0.005


def test_degenerate_frames():
    line = np.linspace(0, 1, 21)[:, None] * np.array([1.0, 2.0, 3.0])
    a = np.stack([line] * 6)
    b = np.stack([line @ Rotation.random(random_state=3).as_matrix().T * 2 + 1] * 6)
    b[1] = np.random.default_rng(0).normal(size=(21, 3))
    a[2, 2:] = np.nan  # two joints left
    a[3, 3:] = np.nan  # three left, on a line
    a[4] = 7.0  # all at one point
    a[5] = np.nan
    with np.errstate(all="raise"):
        out = metrics.pa_mpjpe(a, b)
        rigid = metrics.rigid_pa_mpjpe(a, b)
    assert out[0] == pytest.approx(0, abs=1e-12)
    assert np.isfinite(out[1])
    assert np.isnan(out[[2, 5]]).all()
    assert np.isnan(rigid[[2, 5]]).all()
    assert out[3] == pytest.approx(0, abs=1e-12)
    # nothing but the barycentre can be met
    assert out[4] == pytest.approx(np.linalg.norm(b[4] - b[4].mean(0), axis=1).mean())
    assert np.isnan(metrics.procrustes(a, b)[1][2]).all()


def test_a_flat_hand_is_no_reflection():
    rng = np.random.default_rng(8)
    flat = rng.normal(size=(20, 21, 3)) * [1, 1, 0]
    r = Rotation.random(20, random_state=2).as_matrix()
    np.testing.assert_allclose(
        metrics.pa_mpjpe(flat, np.einsum("tij,tkj->tki", r, flat)), 0, atol=1e-12
    )


def test_joints_only_in_the_estimate_are_moved_along():
    a, b = hands(9)
    holes = b.copy()
    holes[:, 4] = np.nan
    moved = metrics.align(a, holes)
    assert not np.isnan(moved).any()
    others = np.delete(np.arange(21), 4)
    np.testing.assert_allclose(moved[:, others], metrics.align(a[:, others], b[:, others]))


def test_blocks_make_no_difference():
    a, b = hands(10, frames=50, joints=30_000)
    np.testing.assert_allclose(
        metrics.pa_mpvpe(a, b)[[0, 49]], metrics.pa_mpvpe(a[[0, 49]], b[[0, 49]]), rtol=1e-12
    )


def test_the_fast_rotation_is_the_svds():
    rng = np.random.default_rng(11)
    m = rng.normal(size=(5000, 3, 3))
    m[:1000] *= [1, 0.3, 0.01]  # flat
    m[1000:2000] *= [1, 1e-3, 1e-3]  # nearly a line
    m[2000:2500] *= [1, 0, 0]  # a line
    m[2500:2600] = 0
    m *= 10 ** rng.uniform(-6, 6, (5000, 1, 1))
    fast, gain, sure = alignment._by_quaternion(m)
    slow, trace = alignment._by_svd(m, False)
    assert sure[:1000].mean() > 0.5
    assert sure[2600:].mean() > 0.95
    assert not sure[2000:2600].any()
    np.testing.assert_allclose(fast[sure], slow[sure], atol=1e-11)
    np.testing.assert_allclose(gain[sure], trace[sure], rtol=1e-12)
    whole, best = alignment._best_rotation(m.reshape(50, 100, 3, 3), False)
    np.testing.assert_allclose(best.ravel(), trace, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(whole), 1.0)
