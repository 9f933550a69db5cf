"""In which order joints are, told by their bones: named, refused with the cure, or right."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import ORDER_JOINTS, ORDERS
from handtrack.sequences.skeleton_check import GOOD, best_order, orders_of

WHOLE = [name for name, picks in orders_of(21).items() if min(picks) >= 0]


def moving_hand(frames: int = 60, seed: int = 0, noise: float = 5e-4) -> np.ndarray:
    """(T, 21, 3) joints of the default hand flexing its fingers, turning and moving [m]."""
    random = np.random.default_rng(seed)
    model = ht.HandModel.default("right")
    t = np.linspace(0, 2 * np.pi, frames)[:, None]
    phase = random.uniform(0, 2 * np.pi, 20)
    middle = (model.limits.lower + model.limits.upper) / 2
    angles = middle + 0.35 * (model.limits.upper - model.limits.lower) * np.sin(t + phase)
    turn = np.array([[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]
                     for a in 0.5 * np.sin(t[:, 0])])  # fmt: skip
    place = np.hstack([0.05 * np.sin(t), 0.1 * np.cos(t), 0.5 + 0 * t])
    joints = model.joints(angles, turn, place)
    return joints + random.normal(0, noise, joints.shape)


def as_source(joints: np.ndarray, order: str) -> np.ndarray:
    """Joints in a source's order, with what we do not have where it is."""
    picks = np.array(ORDERS[order])
    out = np.full((len(joints), ORDER_JOINTS[order], 3), np.nan)
    out[:, picks[picks >= 0]] = joints[:, picks >= 0]
    wrist, middle = joints[:, 0], joints[:, 9]
    for place in np.flatnonzero(np.isnan(out[0, :, 0])):
        if order == "ultraleap" and place == 0:
            out[:, place] = joints[:, 1]  # the thumb's metacarpal has no length
        elif order == "arkit":
            out[:, place] = wrist + (wrist - middle) * (place - 24)
        elif order in ("umetrack", "openxr", "unity") and place in (0, 1, 20):
            out[:, place] = (wrist + middle) / 2
        else:  # a metacarpal's base, before the finger's
            base = joints[:, ORDERS[order].index(place + 1)]
            out[:, place] = wrist + 0.25 * (base - wrist)
    return out


@pytest.mark.parametrize("order", list(ORDERS))
def test_the_best_order_is_the_true_one(order):
    joints = as_source(moving_hand(), order)
    best = best_order(joints)[0]
    assert ORDERS[best.name] == ORDERS[order]
    assert ORDER_JOINTS[best.name] == ORDER_JOINTS[order]
    assert best.misfit < GOOD / 4


@pytest.mark.parametrize("stated", [None, *WHOLE])
@pytest.mark.parametrize("order", WHOLE)
def test_orders_mistaken_for_each_other(tmp_path, order, stated):
    joints = moving_hand(30)
    np.savez(tmp_path / "a.npz", joints_m=as_source(joints, order), fps=30, hand="right")
    right = order == (stated or "handtrack")
    if stated is None and not right:
        with pytest.raises(ht.InputError, match=f"--order {order} "):
            ht.load(tmp_path / "a.npz")
        return
    (found,) = ht.load(tmp_path / "a.npz", order=stated)
    assert right == (not any("--order" in note for note in found.notes)), found.notes
    assert right or any(f"is it --order {order}?" in note for note in found.notes)


def test_random_orders_are_no_hand(tmp_path):
    joints = moving_hand(30)
    random = np.random.default_rng(3)
    for _ in range(60):
        np.save(tmp_path / "a.npy", joints[:, random.permutation(21)])
        try:
            said = " ".join(ht.load(tmp_path / "a.npy")[0].notes)
        except ht.InputError as error:
            said = str(error)
        assert "--order" in said


@pytest.mark.parametrize("fingers", [(0, 4, 3, 2, 1), (0, 2, 1, 3, 4), (1, 0, 2, 3, 4)])
def test_exchanged_fingers_are_named_by_their_places(tmp_path, fingers):
    joints = moving_hand()
    places = [0, *(1 + 4 * f + i for f in fingers for i in range(4))]
    np.save(tmp_path / "a.npy", joints[:, places])
    with pytest.raises(ht.InputError, match=r"--order 0,\d+,") as error:
        ht.load(tmp_path / "a.npy")
    cure = str(error.value).split("--order ")[1].split()[0]
    (found,) = ht.load(tmp_path / "a.npy", order=cure)
    np.testing.assert_array_equal(found.joints, joints)


def test_all_x_then_all_y_then_all_z(tmp_path):
    joints = moving_hand()
    for origin in (0, joints[:, :1]):
        np.save(tmp_path / "a.npy", (joints - origin).transpose(0, 2, 1).reshape(len(joints), 63))
        with pytest.raises(ht.InputError, match="--order axis-major"):
            ht.load(tmp_path / "a.npy")
        (found,) = ht.load(tmp_path / "a.npy", order="axis-major")
        np.testing.assert_allclose(found.joints, joints - origin)


@pytest.mark.parametrize(("order", "n"), [("mano16", 16), ("no-wrist", 20)])
def test_fewer_joints_need_a_name(tmp_path, order, n):
    joints = as_source(moving_hand(), order)
    np.save(tmp_path / "a.npy", joints)
    with pytest.raises(ht.InputError, match=f"a frame has {n} joints.*--order {order}"):
        ht.load(tmp_path / "a.npy")
    (found,) = ht.load(tmp_path / "a.npy", order=order)
    assert found.present.all(0).sum() == n


@pytest.mark.parametrize("order", ["ultraleap", "manus", "unity"])
def test_of_several_orders_with_as_many_joints_the_bones_decide(tmp_path, order):
    joints = moving_hand()
    np.save(tmp_path / "a.npy", as_source(joints, order))
    (found,) = ht.load(tmp_path / "a.npy")
    assert f"in the order {order}" in " ".join(found.notes)
    there = np.array(ORDERS[order]) >= 0
    np.testing.assert_array_equal(found.joints[:, there], joints[:, there])


@pytest.mark.parametrize("order", ["1,2,3", "0," * 20 + "0", "wrist", "0,x", ",".join("9" * 21)])
def test_places_that_are_none(tmp_path, order):
    np.save(tmp_path / "a.npy", moving_hand(3))
    with pytest.raises(ht.SettingsError, match="unknown joint order"):
        ht.load(tmp_path / "a.npy", order=order)


def test_single_frames_and_noise_are_not_doubted(tmp_path):
    for seed in range(30):
        np.save(tmp_path / "a.npy", moving_hand(8, seed, noise=4e-3)[seed % 8][None])
        (found,) = ht.load(tmp_path / "a.npy")
        assert not any("order" in note for note in found.notes)
