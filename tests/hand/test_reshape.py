"""Other proportions: joints land where they are told, and the skin goes with the bones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handtrack.errors import ModelError
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import BASES, HANDS, PALM, PARENTS, PART_JOINT


@pytest.fixture(scope="module", params=HANDS)
def model(request) -> HandModel:
    return HandModel.default(request.param)


def other_proportions(model: HandModel, seed: int = 0) -> np.ndarray:
    """Bones 10 % longer or shorter, turned a little; bases moved by some millimetres."""
    rng = np.random.default_rng(seed)
    new = np.array(model.rest_joints)
    for k in range(1, 21):
        bone = model.rest_joints[k] - model.rest_joints[PARENTS[k]]
        new[k] = new[PARENTS[k]] + bone * rng.uniform(0.9, 1.1) + rng.normal(0, 0.001, 3)
    return new


def with_marks(model: HandModel, points: np.ndarray, parts: list[int]) -> HandModel:
    """The model with these points for its skin, each fully on one part."""
    return replace(
        model,
        rest_vertices=points,
        faces=np.zeros((0, 3), dtype=np.int32),
        weights=np.eye(16)[parts],
    )


def test_joints_are_exactly_those_given(model):
    new = other_proportions(model)
    out = reshaped(model, new)
    assert np.array_equal(out.rest_joints, new)
    assert np.array_equal(out.axes, model.axes)
    assert np.array_equal(out.weights, model.weights)
    assert np.array_equal(out.faces, model.faces)
    assert out.limits is model.limits
    assert (out.hand, out.name) == (model.hand, model.name)


def test_the_same_proportions_change_nothing(model):
    out = reshaped(model, model.rest_joints)
    assert np.allclose(out.rest_vertices, model.rest_vertices, rtol=0, atol=1e-12)


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.7])
def test_one_factor_is_a_scaled_hand(model, factor):
    out = reshaped(model, model.rest_joints * factor)
    expected = model.scaled(factor)
    assert np.allclose(out.rest_vertices, expected.rest_vertices, rtol=0, atol=1e-12)


def test_a_shift_of_the_root_frame_shifts_the_skin(model):
    shift = np.array([0.1, -0.2, 0.3])
    out = reshaped(model, model.rest_joints + shift)
    assert np.allclose(out.rest_vertices, model.rest_vertices + shift, rtol=0, atol=1e-12)


def test_skin_on_a_bone_goes_with_both_its_ends(model):
    parts = list(range(1, 16))
    starts, ends = model.rest_joints[PART_JOINT[1:]], model.rest_joints[PART_JOINT[1:] + 1]
    marked = with_marks(model, np.concatenate([starts, ends, (starts + ends) / 2]), parts * 3)
    new = other_proportions(model)
    first, last, middle = reshaped(marked, new).rest_vertices.reshape(3, 15, 3)
    assert np.allclose(first, new[PART_JOINT[1:]], rtol=0, atol=1e-14)
    assert np.allclose(last, new[PART_JOINT[1:] + 1], rtol=0, atol=1e-14)
    assert np.allclose(middle, (first + last) / 2, rtol=0, atol=1e-14)


def test_the_palm_goes_with_its_six_joints(model):
    marked = with_marks(model, model.rest_joints[PALM], [0] * 6)
    new = other_proportions(model)
    assert np.allclose(reshaped(marked, new).rest_vertices, new[PALM], rtol=0, atol=1e-12)
    # and smoothly between: neighbours move alike
    grid = model.rest_vertices[model.weights[:, 0] > 0.99]
    near = with_marks(model, np.concatenate([grid, grid + 1e-5]), [0] * 2 * len(grid))
    a, b = reshaped(near, new).rest_vertices.reshape(2, -1, 3)
    assert np.abs((b - a) - 1e-5).max() < 0.5e-5


def test_a_longer_bone_stretches_its_skin_but_not_its_thickness(model):
    # the index finger's first bone, joints 5 to 6, alone
    longer = 1.2
    new = np.array(model.rest_joints)
    bone = new[6] - new[5]
    new[6:9] += (longer - 1) * bone
    on_it = np.array([5, 5, 4, 6, 7])
    across = np.cross(bone, [0.3, 0.4, 0.5])
    across *= 0.008 / np.linalg.norm(across)
    points = np.stack(
        [
            model.rest_joints[5] + 0.5 * bone,
            model.rest_joints[6] + across,
            model.rest_joints[5] + 0.5 * bone + across,
            model.rest_joints[7] + across,
            model.rest_joints[10] + across,
        ]
    )
    out = reshaped(with_marks(model, points, on_it.tolist()), new).rest_vertices
    stretch = (longer - 1) * bone
    assert np.allclose(out[2], new[5] + 0.5 * longer * bone + across, rtol=0, atol=1e-14)
    # what hangs on the next bones moves on unchanged; another finger stays
    assert np.allclose(out[[0, 1, 3]], points[[0, 1, 3]] + stretch, rtol=0, atol=1e-14)
    assert np.allclose(out[4], points[4], rtol=0, atol=1e-14)


def test_a_turned_bone_turns_its_skin(model):
    # the little finger's last bone bent by 30 degrees about an axis across it
    bone = model.rest_joints[20] - model.rest_joints[19]
    axis = np.cross(bone, [0.0, 0.0, 1.0])
    axis /= np.linalg.norm(axis)
    side = np.cross(axis, bone)
    angle = np.deg2rad(30)
    new = np.array(model.rest_joints)
    new[20] = new[19] + np.cos(angle) * bone + np.sin(angle) * side
    points = model.rest_joints[19] + np.stack([0.4 * bone + 0.1 * side, 0.4 * bone + 0.005 * axis])
    out = reshaped(with_marks(model, points, [15, 15]), new).rest_vertices - new[19]
    turned_bone = np.cos(angle) * bone + np.sin(angle) * side
    turned_side = np.cos(angle) * side - np.sin(angle) * bone
    assert np.allclose(out[0], 0.4 * turned_bone + 0.1 * turned_side, rtol=0, atol=1e-14)
    assert np.allclose(out[1], 0.4 * turned_bone + 0.005 * axis, rtol=0, atol=1e-14)


def test_the_reshaped_skin_stays_near_its_joints(model):
    new = other_proportions(model)
    out = reshaped(model, new)
    # the joints moved by less than the skin could be off if it followed something else
    moved = np.linalg.norm(new - model.rest_joints, axis=1)
    skin = np.linalg.norm(out.rest_vertices - model.rest_vertices, axis=1)
    assert 0.001 < skin.max() < moved.max() + 0.005


def test_axes_can_be_given(model):
    axes = np.roll(model.axes, 1, axis=0)
    assert np.array_equal(reshaped(model, model.rest_joints, axes).axes, axes)
    with pytest.raises(ModelError, match="unit length"):
        reshaped(model, model.rest_joints, 2 * axes)


def test_a_skeleton_can_be_reshaped(model):
    bare = replace(
        model,
        rest_vertices=np.zeros((0, 3)),
        faces=np.zeros((0, 3), dtype=np.int32),
        weights=np.zeros((0, 16)),
    )
    new = other_proportions(model)
    assert np.array_equal(reshaped(bare, new).rest_joints, new)


def test_impossible_hands_are_refused(model):
    new = np.array(model.rest_joints)
    new[8] = new[7]
    with pytest.raises(ModelError, match="joint 8 has no length"):
        reshaped(model, new)
    new[8] = np.nan
    with pytest.raises(ModelError, match="not finite"):
        reshaped(model, new)
    with pytest.raises(ModelError, match="shape"):
        reshaped(model, new[:20])
    new = np.array(model.rest_joints)
    new[BASES[2]] = new[0]
    with pytest.raises(ModelError, match="joint 9 has no length"):
        reshaped(model, new)


def test_palm_joints_at_one_place_leave_the_skin_finite():
    model = HandModel.default()
    rest = model.rest_joints.copy()
    rest[5] = rest[9]
    odd = reshaped(model, rest)
    assert np.isfinite(odd.rest_vertices).all()
    back = reshaped(odd, model.rest_joints)
    moved = np.linalg.norm(back.rest_vertices - model.rest_vertices, axis=1)
    assert moved.max() < 0.05
