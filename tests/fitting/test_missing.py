"""Any subset of the joints: what can be seen is fitted, what cannot is said to be unknown."""

from __future__ import annotations

import numpy as np
import pytest
from fit_cases import beyond, distances, ellipse_value, some_poses
from hypothesis import given, settings
from hypothesis import strategies as st

from handtrack.errors import InputError
from handtrack.fitting.fit import fit
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import BASES, HANDS, TIPS

MODELS = {hand: HandModel.default(hand) for hand in HANDS}
STATUSES = ("converged", "iteration limit", "underdetermined")


def only(joints: np.ndarray, keep) -> np.ndarray:
    out = np.full_like(joints, np.nan)
    out[list(keep)] = joints[list(keep)]
    return out


def check(found, model: HandModel) -> None:
    """A result without a NaN that keeps its promises."""
    assert found.status in STATUSES
    for name in ("angles", "rotation", "translation", "joints"):
        assert np.isfinite(getattr(found, name)).all(), name
    assert found.objective >= 0
    assert np.isfinite(found.objective)
    limits = model.limits
    assert model.limits.contains(found.angles, tolerance=1e-14)
    assert ellipse_value(limits, found.angles).max() <= 1 + 1e-14
    assert np.allclose(found.rotation @ found.rotation.T, np.eye(3), rtol=0, atol=1e-9)
    assert np.linalg.det(found.rotation) > 0


@settings(max_examples=150, deadline=None)
@given(
    hand=st.sampled_from(HANDS),
    seen=st.sets(st.integers(0, 20), min_size=1),
    sigma=st.sampled_from([0.001, 0.01]),
    method=st.sampled_from(["newton", "bcd"]),
    seed=st.integers(0, 10_000),
)
def test_any_subset(hand, seen, sigma, method, seed):
    model = MODELS[hand]
    joints = only(some_poses(model, 1, sigma, seed).joints[0], seen)
    rng = np.random.default_rng(seed)
    start = model.limits.clamp(rng.uniform(model.limits.lower, model.limits.upper))
    found = fit(model, joints, start=start, method=method)
    check(found, model)
    assert not np.isnan(found.covariance).any()
    if len(seen) < 3:
        assert found.status == "underdetermined"
    for a in range(20):
        if not seen.intersection(beyond(a)):
            # nothing depends on it: it stays, and is known to be unknown
            assert found.angles[a] == pytest.approx(start[a], rel=0, abs=1e-14)
            assert np.isinf(found.variance[a])
            assert np.array_equal(np.delete(found.covariance[a], a), np.zeros(25))


@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_nothing_is_known_of_the_angles_where_one_joint_is_met_exactly():
    model = MODELS["right"]
    joints = np.full((21, 3), np.nan)
    joints[0] = 0.0
    found = fit(model, joints)
    assert found.objective == 0
    assert np.isinf(found.variance).all()
    assert not np.isnan(found.covariance).any()


def test_no_joint_at_all_is_an_error():
    with pytest.raises(InputError, match="missing"):
        fit(MODELS["right"], np.full((21, 3), np.nan))


def test_a_joint_with_one_missing_coordinate_is_missing():
    model = MODELS["right"]
    joints = some_poses(model, 1, 0.003, seed=1).joints[0]
    whole, part = joints.copy(), joints.copy()
    whole[7] = np.nan
    part[7, 1] = np.nan
    assert np.array_equal(fit(model, whole).angles, fit(model, part).angles)


@pytest.mark.parametrize("method", ["newton", "bcd"])
@pytest.mark.parametrize(
    "seen", [(0,), (4,), (0, 5), (8, 20)], ids=["wrist", "tip", "palm bone", "two tips"]
)
def test_fewer_than_three_joints_are_underdetermined(seen, method):
    model = MODELS["left"]
    joints = some_poses(model, 1, 0.0, seed=2).joints[0]
    found = fit(model, only(joints, seen) + 1e-3, method=method)
    assert found.status == "underdetermined"
    assert distances(found.joints, joints + 1e-3)[list(seen)].max() < 0.03


@pytest.mark.parametrize("n", [3, 4, 21])
def test_joints_on_a_line_are_underdetermined(n):
    model = MODELS["right"]
    # the flat index finger is straight, with its own joints on one line
    on_line = np.full((21, 3), np.nan)
    along = np.array([0.3, -0.5, 0.8])
    on_line[:n] = np.arange(n)[:, None] * 0.02 * along + [0.1, 0.2, 0.3]
    found = fit(model, on_line)
    check(found, model)
    assert found.status == "underdetermined"
    off = on_line.copy()
    off[1] += [0.01, 0, 0]
    assert fit(model, off).status != "underdetermined"


@pytest.mark.parametrize("hand", HANDS)
def test_fingertips_alone_are_met(hand):
    model = MODELS[hand]
    for truth in some_poses(model, 40, seed=3, margin=0.2).joints:
        found = fit(model, only(truth, TIPS))
        check(found, model)
        assert distances(found.joints, truth)[TIPS].max() < 1e-5


def test_fingertips_alone_are_met_from_several_starts():
    model = MODELS["right"]
    for truth in some_poses(model, 40, seed=3, margin=0.2).joints:
        found = fit(model, only(truth, TIPS), starts=8)
        check(found, model)
        assert distances(found.joints, truth)[TIPS].max() < 1e-5


@pytest.mark.parametrize("hand", HANDS)
def test_a_missing_wrist_does_not_matter(hand):
    model = MODELS[hand]
    poses = some_poses(model, 20, seed=4, margin=0.1)
    for i, truth in enumerate(poses.joints):
        joints = truth.copy()
        joints[0] = np.nan
        found = fit(model, joints)
        assert found.status == "converged"
        assert distances(found.joints, truth).max() < 1e-6
        assert np.allclose(found.angles, poses.angles[i], rtol=0, atol=1e-4)
        assert np.isfinite(found.covariance).all()


@pytest.mark.parametrize("finger", range(5))
def test_a_finger_that_is_not_seen_stays_and_the_others_do_not_care(finger):
    model = MODELS["right"]
    poses = some_poses(model, 10, seed=5, margin=0.1)
    base = int(BASES[finger])
    own = slice(4 * finger, 4 * finger + 4)
    start = model.limits.clamp(model.mean_angles + 0.1)
    for i, truth in enumerate(poses.joints):
        joints = truth.copy()
        joints[base + 1 : base + 4] = np.nan
        found = fit(model, joints, start=start)
        assert np.array_equal(found.angles[own], start[own])
        assert np.isinf(found.variance[own]).all()
        others = np.delete(np.arange(20), range(4 * finger, 4 * finger + 4))
        assert np.allclose(found.angles[others], poses.angles[i][others], rtol=0, atol=1e-4)
        assert np.isfinite(found.variance[others]).all()


def test_bases_and_tips_are_met_with_the_joints_between_hidden():
    model = MODELS["right"]
    seen = [0, *BASES, *TIPS]
    for truth in some_poses(model, 20, seed=6, margin=0.1).joints:
        # a finger that folds the other way is a local minimum, so more than one start
        found = fit(model, only(truth, seen), starts=6)
        check(found, model)
        assert distances(found.joints, truth)[seen].max() < 1e-5


def one_hidden_joint_in_three_fingers(n: int):
    model = MODELS["right"]
    for truth in some_poses(model, n, seed=6, margin=0.1).joints:
        joints = truth.copy()
        joints[[6, 11, 18]] = np.nan
        yield fit(model, joints), truth


def test_a_hidden_joint_is_found_from_its_neighbours():
    seen = np.delete(np.arange(21), [6, 11, 18])
    worst = []
    for found, truth in one_hidden_joint_in_three_fingers(100):
        assert distances(found.joints, truth)[seen].max() < 1e-3
        worst.append(distances(found.joints, truth).max())
    # next to a straight finger the hidden joint is hardly determined
    assert np.median(worst) < 1e-6
    assert max(worst) < 0.01


def test_a_hidden_joint_does_not_take_all_the_steps_there_are():
    fits = [found for found, _ in one_hidden_joint_in_three_fingers(100)]
    assert np.mean([found.status == "converged" for found in fits]) > 0.95
