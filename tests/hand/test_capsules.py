"""A hand as capsules: radii from its skin, and which may meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handtrack.evaluation.metrics import self_intersection
from handtrack.hand.capsules import (
    FINGER_RADII,
    bone_joints,
    capsule_radii,
    contact_depths,
    contacts,
)
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import BONES, HANDS


def skinless(model: HandModel) -> HandModel:
    return replace(
        model,
        rest_vertices=np.empty((0, 3)),
        faces=np.empty((0, 3), dtype=np.int32),
        weights=np.empty((0, 16)),
    )


@pytest.mark.parametrize("hand", HANDS)
def test_radii_are_those_of_the_skin(hand):
    model = HandModel.default(hand)
    radii = capsule_radii(model)
    # fingers get thinner to the tip; the skin is nowhere much nearer, and mostly farther
    assert (np.diff(radii[:15].reshape(5, 3), axis=1) < 0).all()
    np.testing.assert_allclose(radii[:15].reshape(5, 3), FINGER_RADII, atol=0.003)
    for bone in range(15):
        first, last = model.rest_joints[bone_joints()[bone]]
        along = (last - first) / np.linalg.norm(last - first)
        skin = model.rest_vertices[model.weights[:, bone + 1] > 0.9] - first
        beside = (skin @ along > 0.3 * np.linalg.norm(last - first)) & (
            skin @ along < 0.8 * np.linalg.norm(last - first)
        )
        far = np.linalg.norm(np.cross(skin[beside], along), axis=1)
        assert far.min() - 0.001 < radii[bone] < np.median(far) + 0.0005
    np.testing.assert_allclose(capsule_radii(model.scaled(1.3)), 1.3 * radii, rtol=1e-12)


def test_a_hand_without_a_skin_has_standard_radii_of_its_size():
    model = HandModel.default("left")
    bare = capsule_radii(skinless(model))
    np.testing.assert_allclose(bare[:15].reshape(5, 3), FINGER_RADII, rtol=0.01)
    np.testing.assert_allclose(capsule_radii(skinless(model.scaled(0.5))), 0.5 * bare)


def test_bones_are_the_hands():
    assert {tuple(b) for b in bone_joints()} < {tuple(b) for b in BONES}


@pytest.mark.parametrize("hand", HANDS)
def test_open_hands_do_not_touch_and_fists_do(hand):
    model = HandModel.default(hand)
    pairs = contacts(model)
    assert len({(a, b) for a, b in pairs[:, :2]}) == len(pairs) == 90 + 10 * 4
    assert (pairs[:, 0] < pairs[:, 1]).all()
    fist = np.deg2rad([20.0, 10, 40, 40] + [90.0, 0, 105, 80] * 4)
    poses = model.joints(np.stack([np.zeros(20), model.mean_angles, fist]))
    deepest = contact_depths(poses, pairs).max(1)
    assert (deepest[:2] <= 0).all()
    assert deepest[2] > 0.003
    # nothing but where the hand is
    moved = contact_depths(poses[:, :, [1, 2, 0]] + 5.0, pairs)
    np.testing.assert_allclose(moved, contact_depths(poses, pairs), atol=1e-12)


def test_a_fingertip_is_where_the_skin_ends():
    """The index tip, standing on the middle finger's side, touches it and sinks in no radius."""
    model = HandModel.default("right")
    pairs = contacts(model)
    radii = capsule_radii(model)
    (at,) = np.flatnonzero((pairs[:, 0] == 5) & (pairs[:, 1] == 7))
    x = np.full((1, 21, 3), 9.0)
    x[0, [10, 11]] = [[-0.01, 0, 0], [0.01, 0, 0]]
    x[0, [7, 8]] = [[0, 0.04, 0], [0, radii[7], 0]]
    # a model's own last bone tells how much of it is the tip's cap
    x[0, 7] = [0, radii[7] + model.bone_lengths[7], 0]
    full = pairs[at].copy()
    full[2] = radii[5] + radii[7]
    assert contact_depths(x, full[None])[0, 0] == pytest.approx(0, abs=1e-12)


def test_depths_agree_with_the_metric():
    model = HandModel.default("right")
    rng = np.random.default_rng(1)
    x = model.joints(model.limits.clamp(rng.normal(size=(50, 20))))
    radii = capsule_radii(model)[:15]
    first, second = np.triu_indices(15, 1)
    other = first // 3 != second // 3
    pairs = np.column_stack([first, second, radii[first] + radii[second]])[other]
    deepest = np.maximum(contact_depths(x, pairs).max(1), 0)
    np.testing.assert_allclose(self_intersection(x, radii.reshape(5, 3)), deepest)
    assert (deepest > 0).mean() > 0.2
