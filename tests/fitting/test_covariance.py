"""The covariance of a fit against its definition and against repeated measurement."""

from __future__ import annotations

import numpy as np
import pytest
from fit_cases import SADDLES, ellipse_value, jacobian, some_poses
from scipy.spatial.transform import Rotation

from handtrack.errors import SettingsError
from handtrack.fitting.fit import fit
from handtrack.fitting.result import N_POSE, Fit
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS

FREE = Limits("wide open", np.full(20, -2.0), np.full(20, 2.0))
SIGMA = 0.001


def world_jacobian(model: HandModel, found: Fit) -> np.ndarray:
    """(63, 26) for a small turn of the world on the left of R and the translation itself."""
    j = jacobian(model, found.angles, found.rotation, found.translation)
    # the fitter's own unknowns are R exp(omega) and t + R v
    j[:, 20:23] = j[:, 20:23] @ found.rotation.T
    j[:, 23:] = j[:, 23:] @ found.rotation.T
    return j


def unit_covariance(found: Fit, seen: int) -> np.ndarray:
    """As if the joints had a variance of 1 m^2; by default the residual shows their noise."""
    return found.covariance / residual_noise(found, seen)


def residual_noise(found: Fit, seen: int) -> float:
    """Variance per coordinate [m^2]; a pose takes 26 freedoms of the 3 that each joint has."""
    return found.objective / max(3 * seen - 26, 1)


def relative_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Greatest difference, in standard deviations of the two unknowns."""
    s = np.sqrt(np.diagonal(b))
    return float(np.abs((a - b) / np.outer(s, s)).max())


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("hand", HANDS)
def test_it_is_the_inverse_of_the_gauss_newton_hessian(hand, weighted):
    model = HandModel.default(hand).with_limits(FREE)
    rng = np.random.default_rng(1)
    poses = some_poses(HandModel.default(hand), 10, SIGMA, seed=2, margin=0.2)
    for i, joints in enumerate(poses.joints):
        weights = rng.uniform(0.3, 2, 21) if weighted else np.ones(21)
        if i % 2:
            weights[[5, 9, 20]] = 0
            joints[0] = np.nan
        found = fit(model, joints, start=poses.angles[i], weights=weights)
        w = np.where(np.isnan(joints[:, 0]), 0, weights)
        j = world_jacobian(model, found)
        if w[20] == 0:
            # the little finger's last hinge moves nothing that is seen
            assert np.isinf(found.covariance[19, 19])
            known = np.delete(np.arange(N_POSE), 19)
        else:
            known = np.arange(N_POSE)
        square = np.ix_(known, known)
        expected = np.linalg.inv((j.T @ (np.repeat(w, 3)[:, None] * j))[square])
        found_unit = unit_covariance(found, int((w > 0).sum()))[square]
        # a finger that is straight with a joint hidden is as good as not observed
        open_ = np.isinf(np.diagonal(found_unit))
        assert (np.diagonal(expected)[open_] > 1e7).all()
        rest = np.ix_(~open_, ~open_)
        assert relative_difference(found_unit[rest], expected[rest]) < 1e-5
        assert np.array_equal(np.diagonal(found.covariance)[:20], found.variance)


def test_it_is_symmetric_and_positive():
    for hand in HANDS:
        model = HandModel.default(hand)
        for joints in some_poses(model, 20, 0.01, seed=3).joints:
            c = fit(model, joints).covariance
            assert c.shape == (N_POSE, N_POSE)
            s = np.sqrt(np.maximum(np.diagonal(c), 1e-12))
            scaled = c / np.outer(s, s)
            assert np.abs(scaled - scaled.T).max() < 1e-9
            assert np.linalg.eigvalsh((scaled + scaled.T) / 2).min() > -1e-9


@pytest.mark.parametrize("seen", [21, 10, 6])
def test_the_noise_may_be_given(seen):
    model = HandModel.default()
    joints = some_poses(model, 1, SIGMA, seed=5).joints[0]
    joints[seen:] = np.nan
    estimated, given = fit(model, joints), fit(model, joints, noise_mm=3.0)
    np.testing.assert_array_equal(given.angles, estimated.angles)
    known = np.isfinite(np.diagonal(given.covariance))
    assert known.sum() == {21: 26, 10: 6 + 8, 6: 6 + 4}[seen]
    np.testing.assert_allclose(
        given.covariance[known][:, known],
        3e-3**2 * unit_covariance(estimated, seen)[known][:, known],
        rtol=1e-12,
    )
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(SettingsError, match="noise_mm"):
            fit(model, joints, noise_mm=bad)


# ---- limits that hold an angle ----


def held_case(seed: int) -> tuple[HandModel, np.ndarray, Fit]:
    """A noisy frame whose fit under Table 1 has some angles at their limits."""
    wide = HandModel.default("right")
    model = wide.with_limits("li2021")
    joints = some_poses(wide, 1, 0.002, seed=seed).joints[0]
    return model, joints, fit(model, joints, tolerance=1e-13)


def face_basis(
    model: HandModel, found: Fit, gradient: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """(26, m) directions that the active limits leave, and the boundary's curvature (26, 26)."""
    limits, basis = model.limits, np.eye(N_POSE)
    curve, drop = np.zeros((N_POSE, N_POSE)), []
    for a in np.setdiff1d(np.arange(20), SADDLES):
        if found.angles[a] in (limits.lower[a], limits.upper[a]):
            drop.append(a)
    on_edge = ellipse_value(limits, found.angles) > 1 - 1e-9
    for z, y in SADDLES[on_edge]:
        x = found.angles[[z, y]]
        inverse = 1 / np.where(x < 0, limits.lower[[z, y]], limits.upper[[z, y]]) ** 2
        normal = x * inverse
        multiplier = -(gradient[[z, y]] @ normal) / (normal @ normal)
        curve[[z, y], [z, y]] = multiplier * inverse
        normal = normal / np.linalg.norm(normal)
        basis[[z, y], z] = -normal[1], normal[0]
        drop.append(y)
    return np.delete(basis, drop, axis=1), curve, int(on_edge.sum())


def test_what_a_limit_holds_has_no_variance():
    hinges = saddles = 0
    for seed in range(40):
        model, joints, found = held_case(seed)
        j = world_jacobian(model, found)
        gradient = j.T @ (found.joints - joints).ravel()
        basis, curve, edges = face_basis(model, found, gradient)
        h = basis.T @ (j.T @ j + curve) @ basis
        expected = basis @ np.linalg.inv(h) @ basis.T
        unit = unit_covariance(found, 21)
        scale = np.sqrt(np.maximum(np.diagonal(expected), 1e-4 * np.diagonal(expected).max()))
        assert np.abs((unit - expected) / np.outer(scale, scale)).max() < 1e-4
        held = np.diagonal(expected) == 0
        assert (found.variance[held[:20]] == 0).all()
        saddles += edges
        hinges += int(held.sum())
    assert saddles > 20
    assert hinges > 20


# ---- repeated measurement ----


@pytest.mark.parametrize("hand", HANDS)
def test_predicted_deviations_are_those_of_repeated_measurement(hand):
    model = HandModel.default(hand).with_limits(FREE)
    rng = np.random.default_rng(4)
    angles = np.deg2rad([5, 5, 25, 30] + [30, 4, 40, 35] * 4)
    rotation = Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
    translation = np.array([0.2, -0.1, 0.9])
    truth = model.joints(angles, rotation, translation)
    n = 800
    steps, noise = np.empty((n, N_POSE)), np.empty(n)
    for i in range(n):
        found = fit(model, truth + rng.normal(0, SIGMA, truth.shape))
        turn = Rotation.from_matrix(found.rotation @ rotation.T).as_rotvec()
        steps[i] = np.concatenate([found.angles - angles, turn, found.translation - translation])
        noise[i] = residual_noise(found, 21)
    perfect = fit(model, truth + 1e-7 * rng.normal(size=truth.shape))
    predicted = unit_covariance(perfect, 21) * SIGMA**2
    ratio = np.sqrt(np.diagonal(predicted)) / steps.std(0)
    assert np.abs(ratio - 1).max() < 0.15
    # which unknowns move together, too
    s = np.sqrt(np.diagonal(predicted))
    found_correlation = np.corrcoef(steps.T)
    assert np.abs(found_correlation - predicted / np.outer(s, s)).max() < 0.2
    assert np.abs(steps.mean(0) / steps.std(0)).max() < 0.25  # next to no bias
    # the noise that each residual shows is right on average
    assert noise.mean() == pytest.approx(SIGMA**2, rel=0.03, abs=0)
