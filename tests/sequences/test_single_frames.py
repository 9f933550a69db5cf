"""Folders of one file a frame, and real samples of formats that people bring."""

import csv
import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import ORDERS


@pytest.mark.parametrize("form", ["npy", "txt"])
def test_files_of_one_frame_are_one_sequence(tmp_path, right, form):
    for t, joints in enumerate(right, 1):
        path = tmp_path / f"joints_{t}.{form}"
        np.save(path, joints) if form == "npy" else np.savetxt(path, joints)
    (sequence,) = ht.load(tmp_path)
    np.testing.assert_allclose(sequence.joints, right)
    assert list(sequence.frame_index) == list(range(1, 13))
    (part,) = ht.load(tmp_path, frames=(2, 10))
    np.testing.assert_allclose(part.joints, right[1:10])


def test_clips_with_numbers_stay_apart(tmp_path, right):
    for i in range(4):
        np.save(tmp_path / f"clip{i}.npy", right)
    assert len(ht.load(tmp_path)) == 4


def test_a_frame_of_another_shape_is_named(tmp_path, right):
    for t in range(5):
        np.save(tmp_path / f"f{t}.npy", right if t == 2 else right[t])
    with pytest.raises(ht.InputError, match=r"f2.npy: holds 12 frame"):
        ht.load(tmp_path)


@pytest.fixture(scope="session")
def formats(shared_data):
    if not (shared_data / "formats").is_dir():
        pytest.skip("samples of formats not there")
    return shared_data / "formats"


def test_dexmv(formats):
    (sequence,) = ht.load(formats / "dexmv")
    truth = [np.load(formats / "dexmv" / f"joints_{n}.npy") for n in range(1, 123)]
    np.testing.assert_allclose(sequence.joints, truth)


@pytest.mark.parametrize("hand", ["left", "right"])
def test_dexcap(formats, hand):
    path = formats / "dexcap" / f"{hand}_hand_joint.txt"
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints[0], np.loadtxt(path))
    assert sequence.hand == hand


@pytest.mark.parametrize("version", ["v1", "v2"])
def test_aria(formats, version):
    path = formats / "aria" / f"hand_tracking_results_{version}.csv"
    with path.open() as file:
        rows = list(csv.DictReader(file))
    for sequence in ht.load(path):
        hand = sequence.hand
        for t, row in enumerate(rows):
            if float(row[f"{hand}_tracking_confidence"]) < 0:
                assert not sequence.present[t].any()
                continue
            for joint, theirs in enumerate(ORDERS["umetrack"]):
                given = (
                    [float(row[f"t{a}_{hand}_landmark_{theirs}_device"]) for a in "xyz"]
                    if theirs >= 0
                    else [np.nan] * 3
                )
                np.testing.assert_allclose(sequence.joints[t, joint], given)


def test_mrtk(formats):
    for path in (formats / "unity").glob("*.json"):
        items = json.loads(path.read_text(encoding="utf-8-sig"))["items"]
        at = {i["joint"]: [i["pose"]["position"][a] for a in "xyz"] for i in items}
        (sequence,) = ht.load(path)
        for joint, name in (
            (0, "Wrist"),
            (1, "ThumbMetacarpalJoint"),
            (4, "ThumbTip"),
            (5, "IndexKnuckle"),
            (19, "PinkyDistalJoint"),
            (20, "PinkyTip"),
        ):
            np.testing.assert_allclose(sequence.joints[0, joint], at[name])


def test_pixels_are_refused(formats):
    with pytest.raises(ht.InputError, match=r"only x and y .*world landmarks"):
        ht.load(formats / "mediapipe" / "pixels_xy.csv")
