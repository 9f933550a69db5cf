"""Every reader's sound sample spoilt in the ways that happen: one line, file and cure."""

from __future__ import annotations

import re

import numpy as np
import pytest

from handtrack.errors import InputError
from tools.fuzz.corpus import motion
from tools.fuzz.kinds import kinds

KINDS = {
    name: kind
    for name, kind in kinds().items()
    if name not in ("glb", "hand.json", "toml", "yaml", "cameras.json", "mano", "mano npz")
    and not name.startswith("recording")
}
CUT_IS_TOLD = ("c3d",)
"""Of which the frames before the cut are read, with a note."""
WHOLE_BEFORE_THE_CUT = ("foxglove frames", "ros joints", "protobuf change")
"""Whose sample is all there when its index is cut off."""
_WORD = re.compile(rb"[A-Za-z]{3,}")
_KEPT = (b"null", b"true", b"false", b"NaN", b"nan")


@pytest.fixture(scope="module")
def joints():
    return motion()


def read(kind, files, folder):
    for name, data in files.items():
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_bytes(data)
    return kind.read(folder / kind.target)


def refused(kind, files, folder):
    with pytest.raises(InputError) as caught:
        read(kind, files, folder)
    text = str(caught.value)
    assert text.startswith(str(folder))
    assert "\n" not in text
    return text.removeprefix(str(folder))


def main_file(kind, files):
    return kind.target or sorted(files)[0]


@pytest.mark.parametrize("name", KINDS)
def test_empty(name, tmp_path, joints):
    kind = KINDS[name]
    files = kind.make(joints)
    assert re.search(
        r"is empty|it ends|no lines|cut short",
        refused(kind, {**files, main_file(kind, files): b""}, tmp_path),
    )


@pytest.mark.parametrize("name", [k for k in KINDS if k not in WHOLE_BEFORE_THE_CUT])
def test_cut_short(name, tmp_path, joints):
    kind = KINDS[name]
    files = kind.make(joints)
    file = main_file(kind, files)
    spoilt = {**files, file: files[file][: len(files[file]) * 7 // 10 - 3]}
    if name in CUT_IS_TOLD:
        (sequence,) = read(kind, spoilt, tmp_path)
        assert any("the header tells of" in note for note in sequence.notes)
    else:
        refused(kind, spoilt, tmp_path)


@pytest.mark.parametrize("name", KINDS)
def test_a_thousand_times_too_large(name, tmp_path, joints):
    kind = KINDS[name]
    try:
        files = kind.make(joints * 1000)
    except (ValueError, OverflowError):
        pytest.skip("its sample has no such joints")
    if files == kind.make(joints):
        pytest.skip("its sample has no places, but angles")
    told = ""
    try:
        found = read(kind, files, tmp_path)
    except InputError as error:
        found, told = [], str(error)
    assert not told or re.search(r"--unit|none of m, cm, mm would fit|far from", told)
    for sequence in found if isinstance(found, list) else []:
        size = np.linalg.norm(np.diff(sequence.joints[:, [0, 9]], axis=1), axis=-1)
        assert not np.nanmedian(size) > 0.2


@pytest.mark.parametrize("name", KINDS)
def test_words_that_mean_nothing(name, tmp_path, joints):
    kind = KINDS[name]
    files = kind.make(joints)
    file = main_file(kind, files)
    try:
        files[file][:3000].decode()
    except UnicodeDecodeError:
        pytest.skip("no text")
    spoilt = _WORD.sub(lambda m: m[0] if m[0] in _KEPT else m[0][::-1], files[file])
    if spoilt == files[file]:
        pytest.skip("no words in it")
    refused(kind, {**files, file: spoilt}, tmp_path)


@pytest.mark.parametrize(
    ("name", "cure"),
    [
        ("hot3d", "--profile"),
        ("emg2pose", "--profile|generic_hand_model.json"),
        ("trc markers", "--markers"),
        ("npz mano", "--mano"),
        ("freihand mano", "--mano"),
    ],
)
def test_without_its_companion(name, cure, tmp_path, joints):
    import handtrack as ht

    kind = kinds()[name]
    files = kind.make(joints)
    (tmp_path / kind.target).write_bytes(files[kind.target])
    with pytest.raises(InputError, match=cure):
        ht.load(tmp_path / kind.target)


_FINGERS = [
    (rb"(?i)index", b"qvzxq"),
    (rb"(?i)middle", b"wvbkpw"),
    (rb"(?i)ring(?=[_\d\-\"'FMPIDTK])", b"kqvx"),
    (rb"(?i)pinky", b"vvqqx"),
    (rb"(?i)little", b"vvqqxx"),
]
NAMED = ("csv", "json capitals", "webxr", "visionpro", "rosbridge", "manus", "trc", "c3d", "bvh")


@pytest.mark.parametrize("name", NAMED)
def test_most_joints_not_understood(name, tmp_path, joints):
    kind = KINDS[name]
    files = kind.make(joints)
    file = main_file(kind, files)
    data = files[file]
    for pattern, other in _FINGERS:
        data = re.sub(pattern, other, data)
    text = refused(kind, {**files, file: data}, tmp_path).lower()
    assert "qvzxq" in text
    assert "understood" in text
    assert re.search("thumb|hand|wrist", text.partition("understood are")[2])
