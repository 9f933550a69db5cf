"""Coordinates that are no places in space, worlds that are mirrored, joints at one place."""

from __future__ import annotations

import numpy as np
import pytest
from test_joint_order import moving_hand

import handtrack as ht

JOINTS = moving_hand(90)
T = np.linspace(0, 1, 90)[:, None, None]


def pictured(width: float, height: float) -> np.ndarray:
    """As MediaPipe's normalised landmarks: over the picture's size, depth from the wrist."""
    x = JOINTS - JOINTS[:, :1] * [0, 0, 1]
    return x / [1.0, height / width, 1.0] + [0.4, 0.4, 0]


DOUBTFUL = {
    "a scale that drifts": (JOINTS * (1 + 0.3 * T), "size drifts by 30 %"),
    "a scale that shrinks": (JOINTS * (1.3 - 0.4 * T), "size drifts"),
    "pixels over width and height": (pictured(1920, 1080), "image coordinates"),
    "pixels upright": (pictured(720, 1280), "image coordinates"),
    "square pixels": (pictured(720, 720), "the wrist's z is always 0"),
    "z at half scale": (JOINTS * [1, 1, 0.5], "axes are scaled"),
    "y stretched": (JOINTS * [1, 1.5, 1], "axes are scaled"),
}
NO_HAND = {
    "z is 0": JOINTS * [1, 1, 0],
    "z is the same": JOINTS * [1, 1, 0] + [0, 0, 0.4],
    "a tilted plane": (JOINTS * [1, 1, 0]) @ np.linalg.qr(np.eye(3) + 0.5)[0],
    "x is 0": JOINTS * [0, 1, 1],
    "half in another unit": np.concatenate([JOINTS[:45], 10 * JOINTS[45:]]),
}


@pytest.mark.parametrize("name", DOUBTFUL)
def test_doubts(tmp_path, name):
    joints, words = DOUBTFUL[name]
    np.savez(tmp_path / "a.npz", joints_m=joints, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert any(words in note for note in found.notes), found.notes


@pytest.mark.parametrize("name", NO_HAND)
def test_refused(tmp_path, name):
    np.savez(tmp_path / "a.npz", joints_m=NO_HAND[name], fps=30, hand="right")
    with pytest.raises(ht.InputError, match=r"a.npz: .*(plane|unit)"):
        ht.load(tmp_path / "a.npz")


def test_hands_are_not_doubted(tmp_path):
    noise = np.random.default_rng(1).normal(0, 4e-3, JOINTS.shape)
    for joints in (JOINTS, JOINTS + noise, JOINTS * (1 + 0.08 * np.sin(40 * T)), JOINTS[:1]):
        np.savez(tmp_path / "a.npz", joints_m=joints, fps=30, hand="right")
        assert ht.load(tmp_path / "a.npz")[0].notes == ()


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_left_handed_world(tmp_path, axis):
    turned = JOINTS * np.where(np.array(list("xyz")) == axis, -1.0, 1.0)
    np.savez(tmp_path / "a.npz", joints_m=turned, truth_m=turned, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert "--mirror z" in found.notes[0]
    (found,) = ht.load(tmp_path / "a.npz", mirror=axis)
    assert (found.hand, found.notes) == ("right", ())
    np.testing.assert_array_equal(found.joints, JOINTS)
    np.testing.assert_array_equal(found.truth, JOINTS)
    # any axis will do: what is left is a turn
    (found,) = ht.load(tmp_path / "a.npz", mirror="z")
    assert found.notes == ()
    with pytest.raises(ht.SettingsError, match="mirror is 'w', expected x, y or z"):
        ht.load(tmp_path / "a.npz", mirror="w")


def test_both_hands_of_a_left_handed_world_keep_their_names(tmp_path):
    left = JOINTS * [-1, 1, 1]
    np.savez(tmp_path / "a.npz", left_joints_m=JOINTS, right_joints_m=left, fps=30)
    found = ht.load(tmp_path / "a.npz")
    assert [s.hand for s in found] == ["left", "right"]
    assert all("--hand swap" in s.notes[0] and "--mirror z" in s.notes[0] for s in found)
    found = ht.load(tmp_path / "a.npz", mirror="x")
    assert [(s.hand, s.notes) for s in found] == [("left", ()), ("right", ())]
    np.testing.assert_array_equal(found[1].joints, JOINTS)


@pytest.mark.parametrize(
    ("kept", "lost"), [(1, 2), (2, 1), (3, 4), (8, 12), (12, 8), (17, 18), (0, 1), (1, 0)]
)
def test_of_two_joints_at_one_place_the_one_that_is_there_is_kept(tmp_path, kept, lost):
    for off in (0.0, 1e-7):
        joints = JOINTS.copy()
        joints[:, lost] = joints[:, kept] + off
        np.savez(tmp_path / "a.npz", joints_m=joints, fps=30, hand="right")
        (found,) = ht.load(tmp_path / "a.npz")
        assert (~found.present).any(0).nonzero()[0].tolist() == [lost]
        assert "at one place in 90 frames" in found.notes[0]


def test_more_joints_at_one_place_are_none(tmp_path):
    joints = JOINTS.copy()
    joints[:, 3] = joints[:, 4] = joints[:, 2]
    joints[5] = joints[5, 0]
    np.savez(tmp_path / "a.npz", joints_m=joints, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert not found.present[5].any()
    assert (~found.present[0]).nonzero()[0].tolist() == [2, 3, 4]


def test_two_joints_exchanged(tmp_path):
    for a, b in [(8, 12), (11, 15), (3, 4), (0, 9), (5, 9), (19, 20)]:
        places = list(range(21))
        places[a], places[b] = b, a
        np.save(tmp_path / "a.npy", JOINTS[:, places])
        try:
            said = " ".join(ht.load(tmp_path / "a.npy")[0].notes)
        except ht.InputError as error:
            said = str(error)
        assert "--order" in said, (a, b)
