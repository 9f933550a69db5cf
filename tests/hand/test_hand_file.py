"""hand.json: what is written comes back, and what is wrong with a file is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from handtrack.errors import InputError, ModelError
from handtrack.hand.hand_file import load_hand, read_hand, save_hand
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import HANDS, Hand


def subject(hand: Hand) -> HandModel:
    """The default hand with other joints and axes."""
    rng = np.random.default_rng(3)
    model = HandModel.default(hand, "li2021")
    turn = about_axis(np.array([0.6, 0.0, 0.8]), 0.1)
    rest = model.rest_joints * 1.07 + rng.normal(0, 0.001, (21, 3))
    return reshaped(model, rest, model.axes @ turn.T)


@pytest.fixture
def file(tmp_path) -> Path:
    return save_hand(subject("right"), tmp_path / "hand.json", {"method": "full", "frames": 120})


@pytest.mark.parametrize("hand", HANDS)
def test_a_hand_comes_back_to_the_bit(hand, tmp_path):
    given = subject(hand)
    back = load_hand(save_hand(given, tmp_path / "new" / "hand.json"))
    assert back.hand == hand
    for name in ("rest_joints", "axes", "faces", "weights"):
        np.testing.assert_array_equal(getattr(back, name), getattr(given, name))
    np.testing.assert_array_equal(back.limits.lower, given.limits.lower)
    np.testing.assert_array_equal(back.limits.upper, given.limits.upper)
    assert back.limits.name == "li2021"
    # its skin is the default hand's, brought to these joints
    np.testing.assert_allclose(back.rest_vertices, given.rest_vertices, rtol=0, atol=1e-12)


def test_a_file_says_what_is_in_it(file):
    content = json.loads(file.read_text())
    assert (content["format"], content["version"]) == ("handtrack hand", 1)
    assert set(content["joints"]) >= {"wrist", "thumb_cmc", "little_tip"}
    assert "metres" in content["units"]
    assert read_hand(file).calibration == {"method": "full", "frames": 120}
    assert "rest_vertices" not in file.read_text()


def change(path: Path, **values: object) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"format": "other"}, 'is no hand file: "format" is not "handtrack hand"'),
        ({"version": 2}, "is a hand file of version 2, expected 1"),
        ({"hand": "both"}, "hand is both, expected left or right"),
        ({"joints": {}}, "joints lacks wrist"),
        ({"joints": None}, "joints is missing or no object"),
        ({"axes": {"thumb_cmc_flexion": [1, 0, 0]}}, "axes lacks thumb_cmc_abduction"),
        ({"base": {"name": "clay"}}, "base is clay, expected default, mano, gltf"),
        ({"thumb_twist": "much"}, "thumb_twist is much, expected numbers"),
        ({"calibration": 3}, "calibration is missing or no object"),
    ],
)
def test_what_is_wrong_is_said(values, message, file):
    change(file, **values)
    with pytest.raises(InputError) as raised:
        load_hand(file)
    assert message in str(raised.value)
    assert raised.value.path == file


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ([0.0, 0.0], "joints.wrist has 2 numbers, expected 3 numbers"),
        ([0.0, 0.0, "x"], "joints.wrist is"),
        ([0.0, 0.0, True], "joints.wrist is"),
        ([0.0, 0.0, float("nan")], "joints.wrist holds a number that is not finite"),
    ],
)
def test_wrong_numbers_are_named(point, message, file):
    joints = json.loads(file.read_text())["joints"] | {"wrist": point}
    change(file, joints=joints)
    with pytest.raises(InputError) as raised:
        read_hand(file)
    assert message in str(raised.value)


def test_what_is_no_hand_at_all(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_hand(tmp_path / "none.json")
    for data in (b"", b"{", b"\xff\xfe", b"[1, 2]"):
        (tmp_path / "bad.json").write_bytes(data)
        with pytest.raises(InputError, match=r"bad.json: is no hand file"):
            load_hand(tmp_path / "bad.json")


def test_another_hand_is_refused(file):
    with pytest.raises(InputError, match="is a right hand, the model a left one"):
        load_hand(file, HandModel.default("left"))


def test_a_base_needs_its_file(tmp_path):
    with pytest.raises(ModelError, match="mano needs the name of its file"):
        save_hand(subject("right"), tmp_path / "hand.json", base="mano")
    with pytest.raises(ModelError, match="base 'clay' is unknown"):
        save_hand(subject("right"), tmp_path / "hand.json", base="clay", base_file="a")
    gone = tmp_path / "MANO_RIGHT.pkl"
    path = save_hand(subject("right"), tmp_path / "hand.json", base="mano", base_file=gone)
    with pytest.raises(InputError, match=r"hand.json: its mano hand: .*MANO_RIGHT.pkl"):
        load_hand(path)
    # with the model at hand, the file is not needed
    assert load_hand(path, HandModel.default("right")).hand == "right"


def test_a_file_that_cannot_be_finished_leaves_the_old_one(file):
    before = file.read_text()
    with pytest.raises(ValueError, match="JSON compliant"):
        save_hand(subject("right"), file, {"noise": float("nan")})
    assert file.read_text() == before
    assert list(file.parent.iterdir()) == [file]
