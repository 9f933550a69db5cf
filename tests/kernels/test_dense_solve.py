"""The arrowhead's steps and covariances against dense systems of 26 unknowns in NumPy.

Directions of a face are columns of a matrix: what is free of a pose, a saddle on its ellipse by
the tangent alone. The dense step on a face is -Q (Q' H Q)^-1 Q' g.
"""

from __future__ import annotations

import numpy as np
import pytest
from dense_systems import dense, directions
from kernel_cases import by_finger
from plain import plain, positive, record, workspace
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.kernels import arrowhead, faces, newton, pose_information
from handtrack.kernels.joint_objective import place
from handtrack.kernels.workspace import GRADIENT, NORMAL, ROOT, WORK

N, FINGERS = 26, 5
# which of a finger's directions (normal, tangent, hinges) are free, for each finger
FACES = {
    "all free": np.ones((4, FINGERS)),
    "hinges held": np.array([[1, 1, 1, 1, 1]] * 2 + [[1, 0, 1, 0, 1], [0, 1, 1, 0, 1]]),
    "saddles held": np.array([[0, 1, 0, 1, 0], [1, 1, 1, 1, 1]] + [[1, 1, 1, 1, 1]] * 2),
    "both": np.array([[0, 1, 0, 0, 1], [1, 1, 1, 1, 1], [0, 0, 1, 1, 1], [1, 0, 0, 1, 1]]),
}


def arrow(seed: int, faces: np.ndarray):
    """A workspace with a random arrowhead that has a minimum, on these faces."""
    rng = np.random.default_rng(seed)
    w = record(WORK)
    h = np.zeros((N, N))
    for f in range(FINGERS):
        own, coupling = positive(rng, 4), 0.15 * rng.normal(size=(4, 6))
        part = slice(4 * f, 4 * f + 4)
        h[part, part], h[part, 20:], h[20:, part] = own, coupling, coupling.T
        w.hessian[:, :, f] = own
        w.row[:, :ROOT, f] = coupling
    g = rng.normal(size=N)
    for f in range(FINGERS):
        w.row[:, GRADIENT, f] = g[4 * f : 4 * f + 4]
    for f in range(FINGERS, 8):
        w.hessian[:, :, f] = np.eye(4)
    w.free[:] = 1.0
    w.free[:, :FINGERS] = faces
    turn = rng.uniform(0, 2 * np.pi, 8)
    w.normal[0], w.normal[1] = np.cos(turn), np.sin(turn)
    w.curvature[:FINGERS] = np.where(faces[NORMAL] == 0, rng.uniform(0.1, 1.0, FINGERS), 0.0)
    return w, h, g


def root_of(w, h: np.ndarray, g: np.ndarray, seed: int) -> None:
    """The root's own part of the dense system and of the workspace's."""
    rng = np.random.default_rng(seed)
    h[20:, 20:] = positive(rng, 6) + np.eye(6)
    w.system[:, :ROOT], w.system[:, GRADIENT] = h[20:, 20:], g[20:]
    w.system[:, arrowhead.LEAST] = 1e-12


def dense_step(w, h: np.ndarray, g: np.ndarray) -> np.ndarray:
    q, bend = directions(w)
    return -q @ np.linalg.solve(q.T @ (h + bend) @ q, q.T @ g)


@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize("seed", range(3))
def test_the_arrowheads_step_is_the_dense_systems(face, seed):
    w, h, g = arrow(seed, FACES[face])
    root_of(w, h, g, seed)
    plain(arrowhead.factor_faces)(w)
    plain(arrowhead.eliminate_fingers)(w)
    assert plain(arrowhead.solve_root)(w)
    plain(arrowhead.move_along_faces)(w, True)
    expected = dense_step(w, h, g)
    np.testing.assert_allclose(w.root_change[:ROOT], expected[20:], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(by_finger(w.step), expected[:20], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_fingers_answer_a_later_change_of_the_root(seed):
    """In two parts, the second from the gradient that the first has left: the same step."""
    w, h, g = arrow(seed, FACES["both"])
    root_of(w, h, g, seed)
    own = np.array(w.system)
    plain(arrowhead.factor_faces)(w)
    w.root_change[:ROOT] = np.random.default_rng(seed).normal(size=ROOT)
    w.root_step[:] = w.root_change[:ROOT]
    plain(arrowhead.move_along_faces)(w, True)
    plain(arrowhead.add_model_gradient)(w)
    left = h[20:] @ np.append(by_finger(w.step), w.root_step) + g[20:]
    np.testing.assert_allclose(w.system[:, GRADIENT], left, atol=1e-12)
    w.system[:, :ROOT] = own[:, :ROOT]
    plain(arrowhead.eliminate_fingers)(w)
    assert plain(arrowhead.solve_root)(w)
    w.root_step[:] += w.root_change[:ROOT]
    plain(arrowhead.move_along_faces)(w, False)
    expected = dense_step(w, h, g)
    np.testing.assert_allclose(w.root_step, expected[20:], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(by_finger(w.step), expected[:20], rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_a_finger_without_a_minimum_is_given_one(seed):
    """Pivots end at the share asked for; a finger that has a minimum is left as it is."""
    w, _, _ = arrow(seed, FACES["all free"])
    w.diagonal[:] = np.abs(np.random.default_rng(seed).normal(size=w.diagonal.shape)) + 1.0
    for f in (1, 3):
        w.hessian[:, :, f] -= 3.0 * np.eye(4)
    before, share = np.array(w.hessian), 0.05
    plain(arrowhead.lift_pivots)(w, share)
    for f in range(FINGERS):
        lower = np.linalg.cholesky(w.hessian[:, :, f])
        pivots = np.square(np.diagonal(lower))
        least = share * w.diagonal[:, f] + arrowhead.PIVOT_FLOOR
        assert (pivots > least * (1 - 1e-6)).all()
        raised = np.diagonal(w.hessian[:, :, f] - before[:, :, f])
        np.testing.assert_allclose(w.hessian[:, :, f] - np.diag(raised), before[:, :, f])
        if np.linalg.eigvalsh(before[:, :, f])[0] < 0:
            # the pivots that were lifted end exactly where they may
            assert (np.abs(pivots / least - 1) < 1e-6).any()
        elif (np.square(np.diagonal(np.linalg.cholesky(before[:, :, f]))) > least).all():
            np.testing.assert_allclose(raised, 0.0, atol=1e-14)


def test_a_root_without_a_minimum_is_told():
    w, h, g = arrow(0, FACES["all free"])
    root_of(w, h, g, 0)
    w.system[:, :ROOT] -= 9.0 * np.eye(6)
    w.system[:, arrowhead.LEAST] = 1e-3
    assert not plain(arrowhead.solve_root)(w)
    assert np.isfinite(w.root_change[:ROOT]).all()
    assert (np.diagonal(w.system[:, :ROOT]) > 0).all()


@pytest.mark.parametrize("face", FACES)
def test_a_dense_system_is_held_to_the_same_faces(face):
    """`faces` on the dense system, with what has a prior: the root's turns couple all fingers."""
    w, _, g = arrow(4, FACES[face])
    h = positive(np.random.default_rng(5), N)
    expected = dense_step(w, h, g)
    system, x = h.copy(), -g
    found = plain(faces.hold_faces)(w, system, x)
    assert found == (FACES[face] == 0).any()
    np.testing.assert_allclose(system, system.T, atol=1e-14)
    x = np.linalg.solve(system, x)
    plain(faces.leave_faces)(w, x)
    np.testing.assert_allclose(x, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(by_finger(w.step), expected[:20], rtol=1e-9, atol=1e-12)
    plain(faces.put_gradient)(w, g)
    np.testing.assert_array_equal(by_finger(w.row[:, GRADIENT]), g[:20])


# ---- of real poses ----


def posed(hand: str, seed: int, unseen: tuple[int, ...] = ()):
    """A workspace at a pose near its noisy joints."""
    rng = np.random.default_rng(seed)
    model = HandModel.default(hand)
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper)) * 0.9
    angles[2::4] = limits.lower[2::4] * 0.5 + limits.upper[2::4] * 0.5
    angles[3::4] = limits.lower[3::4] * 0.5 + limits.upper[3::4] * 0.5
    rotation, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    joints = model.joints(angles, rotation, shift) + rng.normal(0, 3e-4, (21, 3))
    weights = rng.uniform(0.3, 1.0, 21)
    weights[list(unseen)] = 0.0
    return workspace(model, joints, weights, angles, rotation, shift)


@pytest.mark.parametrize("hand", ["left", "right"])
def test_newtons_step_inside_the_limits_minimises_the_model(hand):
    w = posed(hand, 3)
    g, h = dense(w, 0.0)
    plain(arrowhead.lift_pivots)(w, 1e-3)
    assert plain(newton.find_step)(w)
    expected = -np.linalg.solve(h, g)
    assert np.abs(expected[:20]).max() < 0.2
    np.testing.assert_allclose(by_finger(w.step), expected[:20], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(w.root_step, expected[20:], rtol=1e-6, atol=1e-9)
    slope = plain(newton.slope_of_step)(w)
    assert slope == pytest.approx(g @ expected, rel=1e-6)


@pytest.mark.parametrize("unseen", [(), (3,), (17, 18, 19, 20)])
def test_the_covariance_is_the_dense_inverse(unseen):
    """What nothing sees is infinite and covaries with nothing; a turn is the world's."""
    w = posed("right", 7, unseen)
    _, h = dense(w, 0.0)
    w.full = 1
    plain(pose_information.unit_covariance)(w)
    dead = np.diagonal(h) < 1e-15
    assert dead.sum() == (4 if len(unseen) == 4 else 0)
    live = np.flatnonzero(~dead)
    expected = np.zeros((N, N))
    world = np.eye(N)
    world[20:23, 20:23] = world[23:, 23:] = w.rotation
    inverse = np.zeros((N, N))
    inverse[np.ix_(live, live)] = np.linalg.inv(h[np.ix_(live, live)])
    expected = world @ inverse @ world.T
    scale = np.sqrt(np.abs(np.diagonal(expected)))
    scale = np.outer(np.where(dead, 1.0, scale), np.where(dead, 1.0, scale))
    found = np.array(w.covariance)
    assert (np.diagonal(found)[dead] == np.inf).all()
    found[dead, dead] = 0.0
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-6)
    np.testing.assert_array_equal(np.isinf(w.variance), dead[:20])
    np.testing.assert_allclose(
        w.variance[~dead[:20]], np.diagonal(expected)[:20][~dead[:20]], rtol=1e-6
    )


def test_what_a_limit_holds_has_no_variance():
    """A hinge at its bound whose joint pulls it further, and the same hinge pulled back."""
    for pull in (1.0, -1.0):
        w = posed("right", 9)
        a, f = 3, 2
        w.angle[a, f] = w.upper[a, f] - pull * 0.1
        plain(place)(w)
        w.target[3, :, f] = w.rotation @ w.joint[3, :, f] + w.translation
        w.angle[a, f] = w.upper[a, f]
        w.weight[3, f] = 1.0
        w.full = 1
        plain(pose_information.unit_covariance)(w)
        assert np.sign(w.row[a, GRADIENT, f]) == pull
        held_now = (np.array(w.covariance)[4 * f + a] == 0).all()
        assert held_now == (pull < 0)
        assert (w.variance[4 * f + a] == 0.0) == (pull < 0)
