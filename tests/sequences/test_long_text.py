"""Large text files are read in blocks, as they are read whole."""

import json

import numpy as np
import pytest

from handtrack import InputError, load
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers import long_text

N = 60
AXES = [f"{name}_{axis}" for name in JOINT_NAMES for axis in "xyz"]


@pytest.fixture(scope="module")
def hand() -> np.ndarray:
    """(N, 21, 3) [m] a hand that goes on."""
    rest = HandModel.default("right").rest_joints
    return rest + np.linspace(0, 0.1, N)[:, None, None] + 0.3


def wide(hand):
    rows = [f"{i / 60},{','.join(map(str, x.ravel()))}" for i, x in enumerate(hand)]
    return "\n".join([f"time,{','.join(AXES)}", *rows, ""])


def by_joint(hand):
    rows = [
        f"{i},{i / 60},Right,{name},{','.join(map(str, p))}"
        for i, x in enumerate(hand)
        for name, p in zip(JOINT_NAMES, x, strict=True)
    ]
    return "\n".join(["frame,time,hand,joint,x,y,z", *rows])


def lines(hand):
    return "\n\n".join(json.dumps({"t": i / 60, "joints": x.tolist()}) for i, x in enumerate(hand))


def listed(hand):
    """One line, or as editors write it; a hand's frames hold objects themselves."""
    frames = [
        {"t": i / 60, "joints": [dict(zip("xyz", p, strict=True)) for p in x.tolist()]}
        for i, x in enumerate(hand)
    ]
    return json.dumps(frames)


def indented(hand):
    return json.dumps(json.loads(listed(hand)), indent=1)


@pytest.fixture
def in_blocks(monkeypatch):
    """Blocks of some frames, and how many files were read so."""
    found, read = [], long_text.read_long_text

    def counted(*args):
        found.append(read(*args))
        return found[-1]

    monkeypatch.setattr(long_text, "LARGE", 1000)
    monkeypatch.setattr(long_text, "_BLOCK", 7000)
    monkeypatch.setattr(long_text, "read_long_text", counted)
    return found


@pytest.mark.parametrize("text", [wide, by_joint, lines, listed, indented])
def test_the_same_as_whole(text, hand, tmp_path, in_blocks):
    path = tmp_path / "a.txt"
    path.write_text(text(hand))
    (found,) = load(path, hand="right")
    assert in_blocks[-1] is not None
    np.testing.assert_array_equal(found.joints, hand)
    np.testing.assert_array_equal(found.time_ns, np.round(np.arange(N) / 60 * 1e9).astype(int))
    assert len(in_blocks) == 1


@pytest.mark.parametrize("text", [wide, by_joint, lines])
def test_what_is_wrong_is_named_as_of_the_whole(text, hand, tmp_path, in_blocks):
    rows = text(hand).splitlines()
    at = 2 * len(rows) // 3
    at += not rows[at]
    rows[at] = rows[at].replace("0.3", "0.3!", 1)
    path = tmp_path / "a.txt"
    path.write_text("\n".join(rows))
    with pytest.raises(InputError, match=f"line {at + 1}"):
        load(path)
    assert in_blocks == [None]


@pytest.mark.parametrize("damage", ["cut", "a bracket", "more behind it", "no number"])
def test_a_damaged_list_is_refused_as_a_whole_one(hand, damage, tmp_path, in_blocks, monkeypatch):
    text = listed(hand)
    middle = text.index('{"t"', len(text) // 2)
    spoilt = {
        "cut": text[:-300],
        "a bracket": text[:middle] + "]" + text[middle:],
        "more behind it": text + "[",
        "no number": text[:middle] + text[middle:].replace("0.3", "0.3!", 1),
    }[damage]
    path = tmp_path / "a.json"
    path.write_text(spoilt)
    with pytest.raises(InputError) as quick:
        load(path)
    assert in_blocks == [None]
    monkeypatch.setattr(long_text, "LARGE", 10**9)
    with pytest.raises(InputError) as whole:
        load(path)
    assert str(quick.value) == str(whole.value)


def test_a_hand_that_comes_later_is_read_whole(hand, tmp_path, in_blocks):
    text = by_joint(hand) + by_joint(hand[-3:]).partition("\n")[2].replace("Right", "Left")
    path = tmp_path / "a.csv"
    path.write_text(by_joint(hand) + "\n" + text[len(by_joint(hand)) :].replace("\n0,", "\n59,"))
    assert len(load(path)) >= 1
    assert in_blocks[-1] is None


def test_too_large_a_file_names_the_option(hand, tmp_path, in_blocks):
    path = tmp_path / "a.csv"
    path.write_text(wide(hand))
    with pytest.raises(InputError, match="--max-size raises it"):
        load(path, max_size="20kB")
