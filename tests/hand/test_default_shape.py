"""The default hand's shape coefficients: each changes what it is named after, and no more."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.errors import SettingsError
from handtrack.hand.default import SHAPES, default_shape
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_JOINT, BASES, PALM

HANDS = ("right", "left")


def one(name: str, value: float = 1.0) -> np.ndarray:
    return value * np.array([float(n == name) for n in SHAPES])


def slices(model: HandModel) -> tuple[np.ndarray, np.ndarray]:
    """Width and height [m] of the skin in the middle of index to little's proximal bones."""
    widths, heights = [], []
    for base in BASES[1:]:
        a, b = model.rest_joints[base : base + 2]
        bone = (b - a) / np.linalg.norm(b - a)
        hinge = model.axes[4 * ((base - 1) // 4)]
        local = model.rest_vertices - (a + b) / 2
        part = 1 + 3 * ((base - 1) // 4)
        mine = (np.abs(local @ bone) < 0.004) & (model.weights[:, part : part + 2].sum(1) > 0.9)
        widths.append(np.ptp(local[mine] @ hinge))
        heights.append(np.ptp(local[mine] @ np.cross(bone, hinge)))
    return np.array(widths), np.array(heights)


@pytest.mark.parametrize("hand", HANDS)
def test_size_scales_everything(hand):
    mean, big = HandModel.default(hand), HandModel.default(hand, shape=one("size", 2))
    factor = 1 + 2 * SHAPES["size"]
    assert np.abs(big.rest_joints - factor * mean.rest_joints).max() < 1e-12
    assert np.abs(big.rest_vertices - factor * mean.rest_vertices).max() < 1e-9


@pytest.mark.parametrize("hand", HANDS)
def test_finger_length_leaves_the_palm(hand):
    mean, long = HandModel.default(hand), HandModel.default(hand, shape=one("finger_length", 2))
    assert np.abs(long.rest_joints[PALM] - mean.rest_joints[PALM]).max() < 1e-12
    grown = long.bone_lengths / mean.bone_lengths
    fingers = [k - 1 for base in BASES for k in range(base + 1, base + 4)]
    assert np.abs(grown[fingers] - 1 - 2 * SHAPES["finger_length"]).max() < 1e-9
    # the skin goes with it, no thicker
    tips = [np.linalg.norm(m.rest_vertices, axis=1).max() for m in (mean, long)]
    assert tips[1] - tips[0] > 0.004
    for before, after in zip(slices(mean), slices(long), strict=True):
        assert np.abs(after / before - 1).max() < 0.03


@pytest.mark.parametrize("hand", HANDS)
def test_palm_width_moves_the_knuckles_apart(hand):
    mean, wide = HandModel.default(hand), HandModel.default(hand, shape=one("palm_width", -2))
    across = [m.rest_joints[5, 1] - m.rest_joints[17, 1] for m in (mean, wide)]
    assert across[1] / across[0] == pytest.approx(1 - 2 * SHAPES["palm_width"], abs=1e-9)
    fingers = [k - 1 for base in BASES for k in range(base + 1, base + 4)]
    assert np.abs(wide.bone_lengths - mean.bone_lengths)[fingers].max() < 1e-12


@pytest.mark.parametrize("hand", HANDS)
def test_thickness_leaves_the_bones(hand):
    mean, thick = HandModel.default(hand), HandModel.default(hand, shape=one("thickness", 2))
    assert np.abs(thick.rest_joints - mean.rest_joints).max() < 1e-12
    for before, after in zip(slices(mean), slices(thick), strict=True):
        assert after / before == pytest.approx(1 + 2 * SHAPES["thickness"], abs=0.02)
    palm = mean.weights[:, 0] > 0.999
    height = [np.ptp(m.rest_vertices[palm, 2]) for m in (mean, thick)]
    assert height[1] / height[0] == pytest.approx(1 + 2 * SHAPES["thickness"], abs=0.03)


@pytest.mark.parametrize("hand", HANDS)
def test_shapes_are_linear_and_keep_the_axes_across_the_bones(hand):
    c = np.array([1.0, -2.0, 0.5, 1.5])
    model, space = HandModel.default(hand, shape=c), default_shape(hand)
    assert np.array_equal(model.shape, c)
    assert np.abs(model.rest_joints - space.joint_template - space.joint_basis @ c).max() < 1e-15
    bones = model.rest_joints[ANGLE_JOINT + 1] - model.rest_joints[ANGLE_JOINT]
    off = (model.axes * bones).sum(1) / np.linalg.norm(bones, axis=1)
    assert np.abs(off).max() < 1e-9
    assert np.array_equal(HandModel.default(hand, shape=[]).rest_vertices, space.template)


def test_left_mirrors_right():
    c = [0.7, 1, -1, 2]
    right, left = (HandModel.default(hand, shape=c) for hand in HANDS)
    mirror = np.array([1, -1, 1])
    assert np.abs(right.rest_vertices * mirror - left.rest_vertices).max() < 1e-12
    assert np.abs(right.rest_joints * mirror - left.rest_joints).max() < 1e-12


@pytest.mark.parametrize("hand", HANDS)
def test_shapes_do_not_turn_the_skin_inside_out(hand):
    """Two standard deviations of everything at once: the volume grows as the lengths do."""

    def volume(model):
        a, b, c = (model.rest_vertices[model.faces[:, i]] for i in range(3))
        return (np.cross(a, b) * c).sum() / 6

    mean = volume(HandModel.default(hand))
    for signs in np.array(np.meshgrid(*[[-2, 2]] * 4)).reshape(4, -1).T:
        size, finger, palm, thick = 1 + signs * list(SHAPES.values())
        # most of the volume is palm; fingers get thicker in two directions
        grown = size**3 * finger**0.3 * palm**0.7 * thick**1.3
        assert 0.9 < volume(HandModel.default(hand, shape=signs)) / mean / grown < 1.1


@pytest.mark.parametrize("shape", [np.zeros(5), [np.nan], [6.0], np.zeros((2, 2))])
def test_impossible_shapes_are_refused(shape):
    with pytest.raises(SettingsError, match="size, finger_length, palm_width, thickness"):
        HandModel.default("right", shape=shape)
