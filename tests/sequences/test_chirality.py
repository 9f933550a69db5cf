"""Which hand it is, from the fingers."""

import numpy as np
import pytest

from handtrack.errors import InputError
from handtrack.hand.model import HandModel
from handtrack.sequences.chirality import DECIDED, STRONG, chirality


def fist(hand: str, bend: float) -> np.ndarray:
    angles = np.zeros(20)
    for finger in range(1, 5):
        angles[[4 * finger, 4 * finger + 2, 4 * finger + 3]] = bend
    return HandModel.default(hand).joints(angles)


@pytest.mark.parametrize(("hand", "sign"), [("right", 1), ("left", -1)])
@pytest.mark.parametrize("bend", [0.15, 0.5, 1.0, 1.4])
def test_sign_is_that_of_the_model(hand, sign, bend):
    assert sign * chirality(fist(hand, bend)) > STRONG


def test_turning_moving_and_scaling_change_nothing():
    q = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    q *= np.linalg.det(q)
    joints = fist("right", 0.8)
    moved = 1000 * joints @ q.T + [5, 6, 7]
    assert chirality(moved) == pytest.approx(chirality(joints))


def test_mirroring_turns_the_sign(right):
    assert chirality(right * [-1, 1, 1]) == pytest.approx(-chirality(right))


def test_noise_on_a_straight_hand_decides_nothing():
    rng = np.random.default_rng(2)
    flat = fist("right", 0.0)
    scores = [abs(chirality(flat + rng.normal(0, 0.005, (60, 21, 3)))) for _ in range(40)]
    assert max(scores) < DECIDED


def test_noise_on_a_bent_hand_does_not_hide_it():
    rng = np.random.default_rng(3)
    noisy = fist("left", 0.9) + rng.normal(0, 0.005, (60, 21, 3))
    assert chirality(noisy) < -STRONG


def test_straight_frames_do_not_outvote_bent_ones():
    joints = np.concatenate([np.repeat(fist("right", 0.0)[None], 500, 0), fist("right", 1.0)[None]])
    assert chirality(joints) > STRONG


def test_missing_joints():
    joints = fist("right", 0.8)
    joints[[0, 5, 9]] = np.nan  # wrist, and the base of two fingers
    assert chirality(joints) > STRONG
    assert chirality(np.full((3, 21, 3), np.nan)) == 0.0
    assert chirality(np.zeros((3, 21, 3))) == 0.0


def test_wrong_shape():
    with pytest.raises(InputError, match=r"expected \(frames, 21, 3\)"):
        chirality(np.zeros((3, 20, 3)))
