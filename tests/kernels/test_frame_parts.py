"""The parts of a frame's fit: in and out of the workspace, steps, active faces, what is looked at.

Truth is the hand model, SciPy's rotations, and the conditions of Karush, Kuhn and Tucker.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_cases import by_finger
from plain import plain, record, workspace
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.kernels import (
    arrowhead,
    exchange,
    faces,
    filter_loop,
    frame_loop,
    newton,
    pose_steps,
)
from handtrack.kernels import derivatives as kernel_derivatives
from handtrack.kernels.filter_state import FILTER, KEPT
from handtrack.kernels.joint_objective import place
from handtrack.kernels.workspace import FINGERS, GRADIENT, NORMAL, ROOT, WORK

SADDLES = np.arange(20).reshape(5, 4)[:, :2]


def random_pose(model: HandModel, rng: np.random.Generator) -> tuple:
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper))
    return angles, Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)


# ---- exchange ----


@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_pose_comes_out_as_it_went_in_and_its_joints_are_the_models(hand):
    rng, model = np.random.default_rng(0), HandModel.default(hand)
    angles, rotation, shift = random_pose(model, rng)
    w = workspace(model, np.zeros((21, 3)), np.ones(21), angles, rotation, shift)
    plain(place)(w)
    joints, out, root = np.zeros((21, 3)), np.zeros(20), np.zeros(12)
    plain(exchange.store_joints)(w, joints)
    np.testing.assert_allclose(joints, model.joints(angles, rotation, shift), atol=1e-12)
    plain(exchange.store_pose)(w, out, root)
    np.testing.assert_array_equal(out, angles)
    np.testing.assert_array_equal(root, np.append(rotation, shift))


def test_a_missing_joint_is_not_read_and_weights_are_over_the_greatest():
    targets, weights = np.random.default_rng(1).normal(size=(21, 3)), np.arange(21.0)
    targets[[0, 7]], weights[7] = math.nan, 0.0
    w = record(WORK)
    plain(exchange.load_frame)(w, targets, weights, 20.0)
    # lanes 0-4 are the fingers, lane 5 begins with the wrist
    rows = [w.target[0, :, 5], *(w.target[j, :, f] for f in range(5) for j in range(4))]
    np.testing.assert_array_equal(rows, np.where(weights[:, None] > 0, targets, 0.0))
    shares = [w.weight[0, 5], *(w.weight[j, f] for f in range(5) for j in range(4))]
    np.testing.assert_allclose(shares, weights / 20.0)
    assert (w.weight[1:, 5] == 0).all()
    assert (w.weight[:, 6:] == 0).all()


def test_the_thumbs_twist_and_landmarks_reach_their_lanes():
    model, w = HandModel.default("right"), record(WORK)
    offsets = np.zeros((21, 3))
    hand = (model.rest_joints, model.axes, model.limits.lower, model.limits.upper, 0.4)
    plain(exchange.load_model)(w, (*hand, offsets))
    assert w.offset == 0
    assert w.twist.tolist() == [0.4] + [0.0] * 7
    bones = np.diff(model.rest_joints[1:].reshape(5, 4, 3), axis=1)
    np.testing.assert_allclose(w.rest_bone[:, :, :5], bones.transpose(1, 2, 0), atol=1e-15)
    lengths = np.linalg.norm(bones[:, 0], axis=-1)
    np.testing.assert_allclose(w.rest_along[:, :5], bones[:, 0].T / lengths, atol=1e-15)
    offsets[6], offsets[0] = (0.001, 0.0, 0.002), (0.0, 0.003, 0.0)
    plain(exchange.load_model)(w, (*hand, offsets))
    assert w.offset == 1
    np.testing.assert_array_equal(w.rest_offset[1, :, 1], offsets[6])
    np.testing.assert_array_equal(w.rest_offset[0, :, 5], offsets[0])
    assert np.count_nonzero(w.rest_offset) == 3


# ---- steps ----


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_step_is_taken_from_the_pose_before_and_stays_inside_the_limits(share):
    rng, model = np.random.default_rng(2), HandModel.default("left")
    angles, rotation, shift = random_pose(model, rng)
    w = workspace(model, np.zeros((21, 3)), np.ones(21), angles, rotation, shift)
    plain(pose_steps.keep_pose)(w)
    w.step[:, :5], w.root_step[:] = rng.normal(0, 0.3, (4, 5)), rng.normal(0, 0.5, ROOT)
    taken, root = by_finger(w.step), w.root_step.copy()
    w.angle[:], w.rotation[:] = 99.0, 99.0
    plain(pose_steps.take_step)(w, share)
    turn = Rotation.from_rotvec(share * root[:3]).as_matrix()
    np.testing.assert_allclose(w.rotation, rotation @ turn, atol=1e-12)
    np.testing.assert_allclose(w.translation, shift + rotation @ (share * root[3:]), atol=1e-12)
    asked, limits = angles + share * taken, model.limits
    found = by_finger(w.angle)
    hinges = np.setdiff1d(np.arange(20), SADDLES)
    clipped = np.clip(asked, limits.lower, limits.upper)
    np.testing.assert_allclose(found[hinges], clipped[hinges], atol=1e-12)
    for z, y in SADDLES:
        pair = asked[[z, y]]
        star = np.where(pair < 0, limits.lower[[z, y]], limits.upper[[z, y]])
        size = np.linalg.norm(pair / star)
        # towards zero, along the ray, until it is on the ellipse
        np.testing.assert_allclose(found[[z, y]], pair / max(size, 1.0), atol=1e-12)
    plain(pose_steps.clear_step)(w)
    assert (w.step == 0).all()
    assert (w.root_step == 0).all()


# ---- faces ----


def at_limits(seed: int):
    """A pose with hinges at their bounds and saddles on their ellipses, random gradients."""
    rng, model = np.random.default_rng(seed), HandModel.default("right")
    limits = model.limits
    angles = np.where(rng.random(20) < 0.5, limits.lower, limits.upper)
    angles[rng.choice(20, 6, replace=False)] *= 0.5
    turn = rng.uniform(0, 2 * np.pi, 5)
    pairs = np.stack([np.cos(turn), np.sin(turn)], -1)
    star = np.where(pairs < 0, limits.lower[SADDLES], limits.upper[SADDLES])
    on = np.array([True, True, True, False, True])
    angles[SADDLES] = np.abs(star) * pairs * np.where(on, 1 + 1e-12, 0.7)[:, None]
    w = workspace(model, np.zeros((21, 3)), np.ones(21), angles, np.eye(3), np.zeros(3))
    w.row[:, GRADIENT, :5] = rng.normal(size=(4, 5))
    return w, model, angles, star


@pytest.mark.parametrize("seed", range(4))
def test_a_limit_is_active_where_descent_would_leave_it(seed):
    w, model, angles, star = at_limits(seed)
    plain(faces.guess_faces)(w)
    g = w.row[:, GRADIENT]
    for f in range(FINGERS):
        for a in (2, 3):
            k = 4 * f + a
            low, high = angles[k] <= model.limits.lower[k], angles[k] >= model.limits.upper[k]
            leaves = (low and -g[a, f] < 0) or (high and -g[a, f] > 0)
            assert w.free[a, f] == (not leaves)
        normal = 2 * angles[SADDLES[f]] / star[f] ** 2
        outside = np.square(angles[SADDLES[f]] / star[f]).sum() >= 1 - 1e-9
        leaves = outside and -g[:2, f] @ normal > 0
        assert w.free[NORMAL, f] == (not leaves)
        if leaves:
            unit = normal / np.linalg.norm(normal)
            np.testing.assert_allclose(w.normal[:, f], unit, atol=1e-12)
        else:
            assert w.normal[:, f].tolist() == [1.0, 0.0]
            assert w.curvature[f] == 0.0
    assert (w.free[1] == 1).all()


def test_curvature_is_what_the_boundary_bends_the_objective():
    """Along the ellipse, by its angle at the centre: second differences of a linear objective."""
    w, _, angles, star = at_limits(11)
    held = 0
    for f in range(FINGERS):
        normal = angles[SADDLES[f]] / star[f] ** 2
        # descent pushes straight outwards: the point is the least on the ellipse
        push = 0.7
        w.row[:2, GRADIENT, f] = -push * normal
        plain(faces.guess_faces)(w)
        if w.free[NORMAL, f] == 1.0:
            continue
        held += 1
        a, b = np.abs(star[f])
        at = math.atan2(angles[4 * f + 1] / b, angles[4 * f] / a)

        def cost(t: float, a=a, b=b, slope=-push * normal) -> float:
            return float(slope @ [a * math.cos(t), b * math.sin(t)])

        h = 1e-4
        second = (cost(at + h) - 2 * cost(at) + cost(at - h)) / h**2
        speed2 = (a * math.sin(at)) ** 2 + (b * math.cos(at)) ** 2
        assert w.curvature[f] == pytest.approx(second / speed2, rel=1e-4)
    assert held == 4


def test_a_finger_keeps_its_limits_or_has_to_be_solved():
    """By a step out of a bound, out of the ellipse, or one whose held hinge wants to come back."""
    model = HandModel.default("right")
    middle = 0.4 * model.limits.upper
    keeps = plain(faces.keeps_limits)

    def fresh():
        w = workspace(model, np.zeros((21, 3)), np.ones(21), middle, np.eye(3), np.zeros(3))
        w.free[:] = 1.0
        for f in range(5):
            w.hessian[:, :, f] = np.eye(4)
        return w

    w = fresh()
    assert all(keeps(w, f) for f in range(5))
    for a, f, sign in [(2, 1, 1), (2, 3, -1), (3, 2, 1), (3, 4, -1)]:
        w = fresh()
        w.step[a, f] = sign * 3.0
        assert [keeps(w, g) for g in range(5)] == [g != f for g in range(5)]
    w = fresh()
    w.step[:2, 2] = 0.9 * model.limits.upper[8:10]
    assert not keeps(w, 2)
    w = fresh()
    w.free[NORMAL, 1] = 0.0
    assert not keeps(w, 1)
    # held at the upper bound: the multiplier pushes outwards where the slope there is negative
    for a, other in ((2, 3), (3, 2)):
        for slope, kept in ((-1.0, True), (1.0, False)):
            for how in ("own", "root", "flexion", "abduction", "other"):
                w = fresh()
                w.angle[a, 1], w.free[a, 1] = w.upper[a, 1], 0.0
                if how == "own":
                    w.row[a, GRADIENT, 1] = slope
                elif how == "root":
                    w.row[a, 4, 1], w.root_step[4] = slope, 1.0
                else:
                    b = {"flexion": 0, "abduction": 1, "other": other}[how]
                    w.hessian[a, b, 1], w.step[b, 1] = 100 * slope, 0.01
                assert keeps(w, 1) == kept


@pytest.mark.parametrize("seed", range(3))
def test_a_step_of_newton_minimises_the_model_under_the_limits(seed):
    """Projected gradient of the quadratic model at the step, within the box and the ellipse."""
    rng, model = np.random.default_rng(seed), HandModel.default("left")
    angles, rotation, shift = random_pose(model, rng)
    near = model.limits.clamp(angles + rng.normal(0, 0.15, 20))
    joints = model.joints(near, rotation, shift) + rng.normal(0, 3e-3, (21, 3))
    w = workspace(model, joints, np.ones(21), angles, rotation, shift)
    plain(place)(w)
    plain(kernel_derivatives.differentiate)(w, 0.0)
    plain(arrowhead.lift_pivots)(w, 0.05)
    g, h = np.zeros(26), np.zeros((26, 26))
    plain(arrowhead.root_hessian)(w)
    for f in range(FINGERS):
        part = slice(4 * f, 4 * f + 4)
        h[part, part], h[part, 20:] = w.hessian[:, :, f], w.row[:, :ROOT, f]
        h[20:, part], g[part] = h[part, 20:].T, w.row[:, GRADIENT, f]
    h[20:, 20:], g[20:] = w.system[:, :ROOT], w.system[:, GRADIENT]
    plain(newton.find_step)(w)
    step = np.append(by_finger(w.step), w.root_step)
    slope = g + h @ step
    end = angles + step[:20]
    # the root's answer stops once little is left; the fingers' is exact given the root's
    assert np.abs(slope[20:]).max() < 0.1 * np.abs(g[20:]).max()
    for f in range(FINGERS):
        for a in (2, 3):
            k = 4 * f + a
            low, high = model.limits.lower[k], model.limits.upper[k]
            assert low - 1e-9 <= end[k] <= high + 1e-9
            if low + 1e-9 < end[k] < high - 1e-9:
                assert abs(slope[k]) < 1e-6 * np.abs(g[:20]).max()
            else:
                assert slope[k] * (1 if end[k] < high - 1e-9 else -1) > -1e-6 * np.abs(g).max()
    assert g @ step < 0
    assert plain(newton.slope_of_step)(w) == pytest.approx(g @ step, rel=1e-9)


# ---- the loop over frames ----


def test_joints_on_a_line_are_those_with_one_spread_alone():
    rng, on_a_line = np.random.default_rng(4), plain(frame_loop.on_a_line)
    for wide in (0.0, 0.5e-4, 3e-4, 0.02):
        along = rng.normal(0, 0.05, 21)
        off = wide * np.append([1.0, -1.0], np.zeros(19)) / math.sqrt(2)
        turn = Rotation.random(rng=rng).as_matrix()
        points = np.stack([along, off, np.zeros(21)], -1) @ turn + rng.normal(size=3)
        weights = np.ones(21)
        middle = np.linalg.svd(points - points.mean(0))[1][1]
        assert on_a_line(points, weights) == (middle <= frame_loop.LINE)
    points = rng.normal(size=(21, 3))
    weights[2:] = 0.0
    assert on_a_line(points, weights)
    weights[2] = 0.1
    assert not on_a_line(points, weights)


@pytest.mark.parametrize(
    ("joint", "weight", "wrong"),
    [
        (math.nan, 1.0, frame_loop.GOOD),
        (math.inf, 1.0, frame_loop.INFINITE_JOINT),
        (-math.inf, 0.0, frame_loop.INFINITE_JOINT),
        (0.1, -1.0, frame_loop.BAD_WEIGHT),
        (0.1, math.nan, frame_loop.BAD_WEIGHT),
        (0.1, math.inf, frame_loop.BAD_WEIGHT),
        (0.1, 0.0, frame_loop.GOOD),
    ],
)
@pytest.mark.parametrize("axis", range(3))
def test_a_frame_is_cleaned_or_refused(joint, weight, wrong, axis):
    targets, weights = np.full((21, 3), 0.1), np.ones(21)
    targets[5, axis], weights[5] = joint, weight
    assert plain(frame_loop.clean)(targets, weights) == wrong
    missing = math.isnan(joint)
    assert np.isnan(targets[5]).all() == missing
    assert not np.isnan(np.delete(targets, 5, 0)).any()
    if missing:
        assert weights[5] == 0.0
    seen, top = plain(frame_loop.count_seen)(np.array([0.0, 0.3, 2.0, 0.0]).repeat(6)[:21])
    assert (seen, top) == (12, 2.0)


def test_the_greatest_distance_is_of_seen_joints_alone():
    rng, model = np.random.default_rng(6), HandModel.default("right")
    angles, rotation, shift = random_pose(model, rng)
    truth = model.joints(angles, rotation, shift)
    joints, weights = truth + rng.normal(0, 1e-3, (21, 3)), np.ones(21)
    joints[8] += 0.5
    for unseen in ([], [8], [8, 0]):
        weights[unseen] = 0.0
        w = workspace(model, joints, weights, angles, rotation, shift)
        plain(place)(w)
        far = np.linalg.norm(truth - joints, axis=-1)[weights > 0].max()
        assert plain(frame_loop.greatest_distance)(w) == pytest.approx(far, rel=1e-9)


def test_what_a_smoother_is_left_is_the_states():
    s, kept = record(FILTER, 7), record(KEPT, 8)
    plain(filter_loop.keep_prediction)(s, kept)
    shared = set(vars(kept)) & set(vars(s)) - {"pull"}
    assert {"pose_pose", "pose_speed", "angles", "rotation", "translation", "q01"} < shared
    for name in shared:
        np.testing.assert_array_equal(getattr(kept, name), getattr(s, name), err_msg=name)
    # the measurement is still to come
    assert (kept.information == 0).all()
    assert (kept.pull == 0).all()


def test_no_two_fields_of_a_workspace_share_room():
    ends = 0
    for name in WORK.names:
        kind, offset = WORK.fields[name][:2]
        assert offset >= ends
        assert offset % 8 == 0
        ends = offset + kind.itemsize
    assert WORK.itemsize >= ends
    # what is looped over by lanes has them last, side by side
    assert WORK["hessian"].shape[-1] == WORK["step"].shape[-1] == 8
