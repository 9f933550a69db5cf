"""The name of a file or of its folder says the hand where nothing in the file does."""

import json
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.sequences.hands import hand_in_name


@pytest.mark.parametrize(
    ("name", "hand"),
    [
        ("left_hand_joint.txt", "left"),
        ("session3_R.csv", "right"),
        ("L_take2.npy", "left"),
        ("RightHand.npz", "right"),
        ("clip-lh-01.csv", "left"),
        ("right/0001.csv", "right"),
        ("Hand_Left/a.npy", "left"),
        ("l/a.npy", "left"),
        ("left_vs_right.csv", None),
        ("left_and_right_L.csv", None),
        ("upright_pose.csv", None),
        ("L515_capture.csv", None),
        ("clip_before_left_turn0/a.csv", None),
        ("R2.csv", None),
    ],
)
def test_hand_in_name(name, hand):
    assert hand_in_name(Path("/data") / name) == hand


@pytest.fixture
def save(tmp_path):
    def write(joints, name):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        np.save(path, joints)
        return path

    return write


@pytest.mark.parametrize("name", ["left_hand.npy", "clip_L.npy", "left/a.npy"])
def test_one_frame_never_overrules_a_name(save, right, name):
    (sequence,) = ht.load(save(right[-1:], name))
    assert (sequence.hand, sequence.notes) == (
        "left",
        ("no hand named: taken as left from the file's name",),
    )


def test_what_the_file_says_counts_for_more(tmp_path, right):
    path = tmp_path / "left.json"
    path.write_text(json.dumps({"hand": "right", "joints": right.tolist(), "fps": 30}))
    assert ht.load(path)[0].hand == "right"


def test_a_name_against_the_fingers_is_doubted(save, right):
    (sequence,) = ht.load(save(right, "left.npy"))
    assert sequence.hand == "left"
    assert any("but the fingers flex like a right hand's" in note for note in sequence.notes)


def test_the_caller_counts_for_more(save, right):
    assert ht.load(save(right, "left.npy"), hand="right")[0].hand == "right"


def flat(model_joints):
    """A hand that does not bend."""
    return np.repeat(model_joints, 6, axis=0)


@pytest.fixture
def straight():
    from handtrack.hand.model import HandModel

    angles, turn, place = np.zeros((1, 20)), np.eye(3)[None], np.zeros((1, 3)) + 0.3
    return flat(HandModel.default("right").joints(angles, turn, place))


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_numbers_that_the_fingers_do_not_tell(tmp_path, straight, right, form):
    def write(of):
        path = tmp_path / f"a.{form}"
        lines = []
        for t in range(6):
            for k, joints in enumerate(of):
                if form == "jsonl":
                    lines.append(
                        json.dumps({"t": t, "handedness": k, "joints": joints[t].tolist()})
                    )
                else:
                    lines.append(f"{t},{k}," + ",".join(f"{v:.6f}" for v in joints[t].ravel()))
        if form == "csv":
            lines.insert(
                0, "frame,handedness," + ",".join(f"{a}{i}" for i in range(21) for a in "xyz")
            )
        path.write_text("\n".join(lines))
        return path

    with pytest.raises(ht.InputError, match=r"numbered there.*--hand"):
        ht.load(write([straight]))
    assert ht.load(write([straight]), hand="left")[0].hand == "left"
    a, b = ht.load(write([straight, right]))
    assert (a.hand, b.hand) == ("left", "right")
