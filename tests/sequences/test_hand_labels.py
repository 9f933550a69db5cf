"""Labels, the way the fingers flex, and what the caller says."""

import numpy as np
import pytest

import handtrack as ht


@pytest.fixture
def save(tmp_path):
    def write(joints, name="a.npz", **fields):
        path = tmp_path / name
        np.savez(path, joints=joints, fps=30, **fields)
        return path

    return write


def two_hands(tmp_path, first, second, labels=("left", "right")):
    import json

    lines = []
    for i, pair in enumerate(zip(first, second, strict=True)):
        for hand, joints in zip(labels, pair, strict=True):
            lines.append(json.dumps({"time": i / 30, "joints": joints.tolist(), "hand": hand}))
    path = tmp_path / "two.jsonl"
    path.write_text("\n".join(lines))
    return path


def test_true_label_needs_no_word(save, left):
    (sequence,) = ht.load(save(left, hand="Left"))
    assert (sequence.hand, sequence.notes, sequence.name) == ("left", (), "a")


def test_wrong_label_is_kept_and_said(save, right):
    (sequence,) = ht.load(save(right, hand="left"))
    assert sequence.hand == "left"
    assert sequence.notes == (
        "labelled left, but the fingers flex like a right hand's: pass --hand right to override,"
        " or pass --mirror z if its world is left-handed (Unity, Unreal), which keeps its name",
    )


def test_override_of_a_wrong_label(save, right):
    (sequence,) = ht.load(save(right, hand="left"), hand="right")
    assert sequence.hand == "right"
    assert sequence.notes == ("labelled left, taken as right as asked",)


def test_override_against_the_fingers_is_said(save, right):
    (sequence,) = ht.load(save(right), hand="left")
    assert sequence.hand == "left"
    assert "flex like a right hand's" in sequence.notes[0]


@pytest.mark.parametrize("hand", ["left", "right"])
def test_no_label(save, motion, hand):
    (sequence,) = ht.load(save(motion(hand)))
    assert sequence.hand == hand
    assert sequence.notes == (f"no hand named: taken as {hand} from the way the fingers flex",)


def test_no_label_and_straight_fingers(save):
    flat = ht.HandModel.default("left").joints(np.zeros(20))[None]
    assert ht.load(save(flat, "x_left.npz"))[0].hand == "left"
    assert "from the file's name" in ht.load(save(flat, "x_left.npz"))[0].notes[0]
    (sequence,) = ht.load(save(flat))
    assert sequence.hand == "right"
    assert "hardly bend" in sequence.notes[0]


def test_two_labels_are_chosen_from(tmp_path, left, right):
    path = two_hands(tmp_path, left, right)
    assert [(s.hand, s.name) for s in ht.load(path)] == [
        ("left", "two left"),
        ("right", "two right"),
    ]
    (only,) = ht.load(path, hand="left")
    np.testing.assert_array_equal(only.joints, left)
    assert only.name == "two left"


def test_swapped_labels(tmp_path, left, right):
    path = two_hands(tmp_path, right, left)
    for sequence in ht.load(path):
        assert "pass --hand swap to override" in sequence.notes[0]
    a, b = ht.load(path, hand="swap")
    assert (a.hand, b.hand, a.name, b.name) == ("right", "left", "two right", "two left")
    assert a.notes == b.notes == ()
    np.testing.assert_array_equal(a.joints, right)


def test_swap_without_labels(save, right):
    with pytest.raises(ht.SettingsError, match="no hand is named there"):
        ht.load(save(right), hand="swap")


def test_never_seen_hand_is_left_out_and_not_taken_for_the_other(tmp_path, left):
    path = two_hands(tmp_path, left, np.full_like(left, np.nan))
    (sequence,) = ht.load(path)
    assert sequence.hand == "left"
    assert "left out, as every joint is missing: two right" in sequence.notes[0]
    with pytest.raises(ht.InputError, match="every joint of the right hand is missing"):
        ht.load(path, hand="right")
