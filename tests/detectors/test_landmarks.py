"""Landmarks beside joints: in kinematics, in every fit, in pictures, against truth."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.detectors.profile import IN_SPACE, Noise, Profile
from handtrack.fitting.fit import fit_batch
from handtrack.fitting.images import fit_2d
from handtrack.hand.reshape import reshaped
from handtrack.hand.rotations import vector_to_matrix

MM = np.full(21, 1e-3)


def profile(seed: int = 3) -> Profile:
    offsets = np.random.default_rng(seed).normal(0.0, 0.08, (21, 3))
    return Profile("made", "made", IN_SPACE, offsets, Noise(MM, MM, MM, 0.3))


def poses(model: ht.HandModel, n: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    low, high = model.limits.lower, model.limits.upper
    angles = model.limits.clamp(low + rng.uniform(0.2, 0.8, (n, 20)) * (high - low))
    turns = np.array([vector_to_matrix(v) for v in rng.normal(0, 1.0, (n, 3))])
    return angles, turns, rng.normal(0, 0.3, (n, 3))


def test_a_landmark_moves_with_its_bone():
    model = profile().on(ht.HandModel.default())
    angles, turns, shifts = poses(model, 4)
    marks, joints = (f(angles, turns, shifts) for f in (model.landmarks, model.joints))
    away = np.linalg.norm(marks - joints, axis=-1)
    np.testing.assert_allclose(away, np.broadcast_to(away[0], away.shape), atol=1e-12)
    # a point that is a joint's own bone further on turns as that bone does
    tip = np.zeros((21, 3))
    tip[8] = model.rest_joints[8] - model.rest_joints[7]
    longer = ht.HandModel.default()
    longer = type(longer)(**{**vars_of(longer), "landmark_offsets": tip})
    seen = longer.landmarks(angles, turns, shifts)
    plain = longer.joints(angles, turns, shifts)
    np.testing.assert_allclose(seen[:, 8], 2 * plain[:, 8] - plain[:, 7], atol=1e-12)


def vars_of(model: ht.HandModel):
    from dataclasses import fields

    return {f.name: getattr(model, f.name) for f in fields(model)}


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("options", [{}, {"method": "bcd"}, {"robust": "huber"}])
def test_a_fit_finds_the_joints_from_landmarks(hand, options):
    model = profile().on(ht.HandModel.default(hand))
    angles, turns, shifts = poses(model, 12)
    batch = fit_batch(model, model.landmarks(angles, turns, shifts), **options)
    off = np.linalg.norm(batch.joints - model.joints(angles, turns, shifts), axis=-1).max(1)
    # Algorithm 1 alone creeps; a cold start may end in another bend
    assert np.median(off) < (2e-3 if options.get("method") else 1e-6)
    assert (off < 5e-3).mean() > 0.9


def test_the_mirror_image_gives_the_mirror_image():
    right, left = (profile().on(ht.HandModel.default(h)) for h in ("right", "left"))
    mirror = np.array([1, -1, 1])
    np.testing.assert_allclose(left.landmark_offsets, right.landmark_offsets * mirror, atol=1e-12)


def test_gradient_and_hessian_are_those_of_landmarks():
    """The dense gradient of the kernel, against differences of the objective."""
    from handtrack.fitting.solver import constants

    model = profile().on(ht.HandModel.default())
    angles, turns, shifts = poses(model, 1)
    target = model.landmarks(angles, turns, shifts)[0] + np.random.default_rng(1).normal(
        0, 5e-3, (21, 3)
    )
    fit = ht.fit(model, target)
    assert len(constants(model)) == 6

    def cost(a, w, t):
        turn = vector_to_matrix(w) @ fit.rotation
        return np.square(model.landmarks(a, turn, t) - target).sum()

    base = cost(fit.angles, np.zeros(3), fit.translation)
    assert base == pytest.approx(fit.objective, rel=1e-9)
    inside = (fit.angles > model.limits.lower + 1e-3) & (fit.angles < model.limits.upper - 1e-3)
    for i in np.flatnonzero(inside):
        if i % 4 < 2:
            continue  # held by the ellipse, perhaps
        step = np.zeros(20)
        step[i] = 1e-5
        both = [cost(fit.angles + s * step, np.zeros(3), fit.translation) for s in (1, -1)]
        assert abs(both[0] - both[1]) / 2e-5 < 1e-6
        assert both[0] + both[1] > 2 * base
    for i in range(3):
        step = 1e-5 * np.eye(3)[i]
        both = [cost(fit.angles, s * step, fit.translation) for s in (1, -1)]
        assert abs(both[0] - both[1]) / 2e-5 < 1e-6


def test_pictures_show_landmarks():
    model = profile().on(ht.HandModel.default())
    angles, turns, _ = poses(model, 1)
    joints = model.joints(angles[0], turns[0], [0, 0, 0.5])
    marks = model.landmarks(angles[0], turns[0], [0, 0, 0.5])
    k = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    side = vector_to_matrix(np.array([0.0, 0.7, 0.0]))
    cameras = [
        ht.Camera("a", k, np.zeros(5), np.eye(3), np.zeros(3)),
        ht.Camera("b", k, np.zeros(5), side, np.array([-0.3, 0.0, 0.1])),
    ]
    pixels = np.array([c.project(marks) for c in cameras])
    found = fit_2d(model, pixels, cameras)
    np.testing.assert_allclose(found.joints, joints, atol=2e-4)
    assert np.nanmax(found.reprojection) < 0.1


def test_landmarks_go_with_the_shape():
    model = profile().on(ht.HandModel.default())
    np.testing.assert_allclose(
        model.scaled(1.2).landmark_offsets, 1.2 * model.landmark_offsets, atol=1e-15
    )
    other = ht.HandModel.default(shape=[1.0, 1.0, -1.0])
    np.testing.assert_allclose(
        reshaped(model, other.rest_joints).landmark_offsets,
        profile().on(other).landmark_offsets,
        atol=1e-12,
    )


def test_no_profile_changes_nothing():
    model = ht.HandModel.default()
    assert not model.has_landmarks
    angles, turns, shifts = poses(model, 3)
    assert np.array_equal(
        model.joints(angles, turns, shifts), model.landmarks(angles, turns, shifts)
    )


def test_one_cameras_offsets_hold_the_detectors_size():
    """A detector whose hands are 0.9 of the true ones: so are the landmarks of its profile."""
    from handtrack.detectors.profile import ONE_CAMERA
    from handtrack.evaluation.landmarks import Seen, estimate_profile

    model, rng = profile().on(ht.HandModel.default()), np.random.default_rng(4)
    clips = []
    for seed, size in enumerate((0.85, 0.9, 0.953)):
        angles, turns, _ = poses(model, 40, seed)
        truth, marks = (
            f(angles, turns, np.zeros((40, 3))) for f in (model.joints, model.landmarks)
        )
        scale = size * np.exp(rng.normal(0, 0.02, (40, 1, 1)))
        turned = scale * marks @ vector_to_matrix([0.1, 0.2, 0.3]).T + 0.1
        seen = ht.Sequence(np.arange(40) * 33_000_000, turned, hand="right", name="made")
        clips.append(Seen.of(seen, truth, ht.HandModel.default()))
    found = estimate_profile(clips, "made", input=ONE_CAMERA)

    def extent(x):
        return np.linalg.norm(x - x.mean(-2, keepdims=True), axis=(-2, -1))

    own = found.on(ht.HandModel.default())
    angles, turns, shifts = poses(model, 20, 9)
    ratio = extent(own.landmarks(angles, turns, shifts)) / extent(
        model.landmarks(angles, turns, shifts)
    )
    assert np.mean(ratio) == pytest.approx(0.9, abs=0.01)
    assert found.noise.size == pytest.approx(np.std(np.log([0.85, 0.9, 0.953])), abs=0.012)
    assert 0.01 < found.noise.scale < 0.04
