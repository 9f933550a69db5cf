"""Fits to pictures: the truth from pictures of it, and the least squares of SciPy."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from plain import plain, workspace
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.kernels import image_fit
from handtrack.kernels.image_fit import fit_views
from handtrack.kernels.pixel_objective import weigh_pixels
from handtrack.kernels.workspace import CONVERGED, LIMIT, NORMAL

sys.path.append(str(Path(__file__).resolve().parents[1] / "cameras"))
from rigs import rig

MODEL = HandModel.default("right")
CAMERAS = rig(3)
HAND = (
    np.array(MODEL.rest_joints),
    np.array(MODEL.axes),
    np.array(MODEL.limits.lower),
    np.array(MODEL.limits.upper),
    0.0,
    np.zeros((21, 3)),
)


def pose(seed: int) -> tuple:
    rng = np.random.default_rng(seed)
    limits = MODEL.limits
    angles = 0.5 * (limits.lower + limits.upper) + 0.15 * rng.uniform(-1, 1, 20)
    angles[[0, 1, 4, 5, 8, 9, 12, 13, 16, 17]] = 0.05 * rng.normal(size=10)
    rotation = Rotation.random(rng=rng).as_matrix()
    return angles, rotation, -MODEL.joints(angles, rotation, np.zeros(3)).mean(0)


def shown(angles, rotation, shift) -> np.ndarray:
    joints = MODEL.joints(angles, rotation, shift)
    return np.stack([c.project(joints) for c in CAMERAS])


def fitted(pixels, weights, start, root, spread=0.0, stiffness=0.0, most=100):
    """Angles, root, objective, steps, state and covariance of one frame."""
    starts, roots = start[None].copy(), root[None].copy()
    out = tuple(np.zeros((1, *s)) for s in ((21, 3), (), (), (), (26, 26)))
    cameras = np.stack([c.lens for c in CAMERAS])
    settings = float(most), 1e-12
    prior, stiff = np.zeros((1, 20)), np.full(20, stiffness)
    fit_views(
        HAND, cameras, pixels[None], weights[None], spread, prior, stiff, starts, roots,
        settings, out,
    )  # fmt: skip
    return starts[0], roots[0], *(a[0] for a in out)


def start_near(angles, rotation, shift, seed=0) -> tuple:
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(rng.normal(0, 0.1, 3)).as_matrix()
    start = MODEL.limits.clamp(angles + rng.normal(0, 0.1, 20))
    return start, np.append(turn @ rotation, shift + rng.normal(0, 0.01, 3))


@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_the_truth_is_found_from_its_pictures(spread):
    truth = pose(0)
    pixels, weights = shown(*truth), np.ones((3, 21))
    if spread:
        # Huber's loss of what is wildly off is nearly nothing
        weights[1, 4], pixels[1, 4] = 1e-6, (0.0, 0.0)
    angles, root, joints, cost, steps, state, _ = fitted(
        pixels, weights, *start_near(*truth), spread=spread
    )
    assert state == CONVERGED
    assert steps < 30
    np.testing.assert_allclose(joints, MODEL.joints(*truth), atol=1e-6)
    np.testing.assert_allclose(angles, truth[0], atol=1e-4)
    np.testing.assert_allclose(root, np.append(truth[1], truth[2]), atol=1e-5)
    assert cost < 1e-2


def test_a_noisy_fit_and_its_covariance_are_scipys():
    truth, rng = pose(1), np.random.default_rng(1)
    pixels = shown(*truth) + rng.normal(0, 1.0, (3, 21, 2))
    weights = rng.uniform(0.3, 1.0, (3, 21))
    weights[2, 3] = 0.0
    stiffness = 4.0
    angles, root, _, cost, _, state, covariance = fitted(
        pixels, weights, *start_near(*truth), stiffness=stiffness
    )
    assert state == CONVERGED
    rotation = root[:9].reshape(3, 3)

    def residuals(d: np.ndarray) -> np.ndarray:
        turned = rotation @ Rotation.from_rotvec(d[20:23]).as_matrix()
        at = shown(angles + d[:20], turned, root[9:] + rotation @ d[23:])
        off = np.sqrt(weights)[..., None] * (at - pixels)
        return np.append(off, np.sqrt(stiffness) * (angles + d[:20]))

    assert cost == pytest.approx(np.square(residuals(np.zeros(26))).sum(), rel=1e-9)
    low = np.append(MODEL.limits.lower - angles, np.full(6, -1.0)) - 1e-9
    high = np.append(MODEL.limits.upper - angles, np.full(6, 1.0)) + 1e-9
    best = least_squares(residuals, np.zeros(26), bounds=(low, high), xtol=1e-14, x_scale="jac")
    # as good as it gets, and there
    assert cost <= 2 * best.cost * (1 + 1e-6)
    np.testing.assert_allclose(best.x, 0.0, atol=2e-3)
    h = 1e-6
    slopes = [(residuals(h * e) - residuals(-h * e)) / (2 * h) for e in np.eye(26)]
    expected = np.linalg.inv(np.array(slopes) @ np.array(slopes).T)
    scale = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(
        covariance / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-4
    )


def test_steps_are_at_most_as_many_as_asked_and_none_is_worse():
    truth = pose(2)
    pixels, weights = shown(*truth), np.ones((3, 21))
    start, root = start_near(*truth, seed=5)
    costs = [fitted(pixels, weights, start, root, most=m)[3] for m in range(5)]
    assert (np.diff(costs) < 0).all()
    found = fitted(pixels, weights, start, root, most=3)
    assert (found[4], found[5]) == (3, LIMIT)


def test_what_no_camera_sees_is_not_known():
    truth = pose(3)
    weights = np.ones((3, 21))
    weights[:, 9:13] = 0.0
    covariance = fitted(shown(*truth), weights, *start_near(*truth))[6]
    variance = np.diagonal(covariance)
    unseen = np.isin(np.arange(26), range(8, 12))
    # [rad^2] at a noise of a pixel
    assert (variance[unseen] > 1e8).all()
    assert (variance[~unseen] < 1.0).all()


def test_a_step_out_of_a_limit_is_held_there():
    """What is at a bound and would leave it is held; what comes back from it is not."""
    angles = 0.5 * np.array(MODEL.limits.upper)
    upper, lower = MODEL.limits.upper, MODEL.limits.lower
    angles[2], angles[7], angles[10], angles[15] = upper[2], upper[7], lower[10], lower[15]
    angles[[4, 5]] = upper[4], 0.0
    angles[[8, 9]] = 0.0, lower[9]
    w = workspace(MODEL, np.zeros((21, 3)), np.ones(21), angles, np.eye(3), np.zeros(3))
    w.angle_before[:], w.free[:] = w.angle, 1.0
    g, x = np.zeros(26), np.zeros(26)
    assert not plain(image_fit.hold_leaving)(w, g, x)
    x[[2, 7, 10, 15]] = 1.0, -1.0, -1.0, 1.0
    x[[4, 5]], x[[8, 9]] = (1.0, 0.0), (0.0, 1.0)
    g[4] = -2.0
    assert plain(image_fit.hold_leaving)(w, g, x)
    held = {(2, 0), (2, 2), (NORMAL, 1)}
    assert {(a, f) for a in range(4) for f in range(5) if w.free[a, f] == 0} == held
    np.testing.assert_allclose(w.normal[:, 1], [1.0, 0.0], atol=1e-12)
    # at (a, 0) the pull outwards over the radius of curvature b^2 / a
    b = upper[5]
    assert w.curvature[1] == pytest.approx(2.0 * upper[4] / b**2, rel=1e-9)
    # what is held already is not found again
    assert not plain(image_fit.hold_leaving)(w, g, x)


def test_the_step_damped_is_levenberg_and_marquardts():
    truth = pose(4)
    start, root = start_near(*truth, seed=2)
    w = workspace(MODEL, np.zeros((21, 3)), np.ones(21), start, root[:9].reshape(3, 3), root[9:])
    cameras = np.stack([c.lens for c in CAMERAS]).view(np.recarray)
    seen = cameras, shown(*truth), np.ones((3, 21)), 0.0, np.zeros(20), np.zeros(20)
    plain(weigh_pixels)(w, seen)
    square = (26, 26)
    room = np.zeros(26), np.zeros(square), np.zeros(square), np.zeros(square), np.zeros(26)
    plain(image_fit.differentiate_on_faces)(w, seen, room)
    w.angle_before[:] = w.angle
    assert (w.free == 1).all()
    for damping in (0.0, 0.3):
        promise = plain(image_fit.damped_step)(w, room, damping)
        g, h = room[0], room[1]
        system = h + damping * np.diag(np.diagonal(h)) + 1e-9 * np.eye(26)
        expected = -np.linalg.solve(system, g)
        found = np.append(w.step[:, :5].T.ravel(), w.root_step)
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-8)
        assert promise == pytest.approx(-g @ expected, rel=1e-6)
