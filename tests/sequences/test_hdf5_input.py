"""EgoDex, emg2pose and other HDF5 files, made after their documented layouts."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError, InputError

h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")

from handtrack.sequences.readers.hdf5_arrays import said  # noqa: E402
from tools.make.hdf5_files import write_egodex, write_emg2pose, write_profile  # noqa: E402


def test_egodex_has_both_hands(tmp_path, left, right):
    path = write_egodex(tmp_path / "42.hdf5", {"left": left, "right": right})
    sequences = ht.load(path)
    assert [(s.name, s.hand) for s in sequences] == [("42 left", "left"), ("42 right", "right")]
    for sequence, truth in zip(sequences, (left, right), strict=True):
        np.testing.assert_allclose(sequence.joints, truth, atol=1e-12)
        assert sequence.fps == pytest.approx(30, abs=1e-3)
        np.testing.assert_allclose(sequence.confidence, 0.8)
        assert not sequence.notes
    # read again without the reader: one joint, by hand
    with h5py.File(path) as file:
        np.testing.assert_allclose(
            sequences[1].joints[:, 11],
            file["transforms/rightMiddleFingerIntermediateTip"][:, :3, 3],
        )


def test_egodex_of_one_hand_without_confidences(tmp_path, right):
    path = write_egodex(tmp_path / "a.h5", {"right": right}, confidence=None)
    (sequence,) = ht.load(tmp_path)
    assert sequence.name == "a right"
    assert sequence.source == str(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-12)
    assert (sequence.confidence == 1).all()


def test_egodex_joints_of_confidence_zero_are_missing(tmp_path, left, right):
    path = write_egodex(tmp_path / "a.hdf5", {"left": left, "right": right})
    with h5py.File(path, "r+") as file:
        file["confidences/leftRingFingerTip"][3:5] = 0.0
    sequence = ht.load(path, hand="left")[0]
    assert (~sequence.present).sum() == 2
    assert np.isnan(sequence.joints[3:5, 16]).all()


def test_arrays_under_their_names(tmp_path, right):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("episode/obs/joints_mm", data=1e3 * right)
        file["episode/obs"].attrs["hand"] = "right"
        file.create_dataset("episode/obs/time_s", data=0.1 * np.arange(len(right)))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-9)
    assert (sequence.hand, sequence.fps) == ("right", pytest.approx(10))


def test_visionos_streams_come_into_the_world(tmp_path, right):
    wrist = np.tile(np.eye(4), (len(right), 1, 1, 1))
    wrist[:, 0, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    wrist[:, 0, :3, 3] = right[:, 0]
    fingers = np.tile(np.eye(4), (len(right), 25, 1, 1))
    ours = [0, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24]
    fingers[..., :3, 3][:, ours] = (right - right[:, :1]) @ wrist[0, 0, :3, :3]
    fingers[:, 0] = wrist[:, 0]
    fields = {"right_wrist": wrist, "right_fingers": fingers}
    np.savez(tmp_path / "a.npz", **fields)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, value in fields.items():
            file[name] = value
    for name in ("a.npz", "a.h5"):
        (sequence,) = ht.load(tmp_path / name)
        np.testing.assert_allclose(sequence.joints, right, atol=1e-12)
        assert sequence.hand == "right"


def one_line(path, **options) -> str:
    with pytest.raises(HandtrackError) as caught:
        ht.load(path, **options)
    text = str(caught.value)
    assert "\n" not in text
    assert str(path) in text
    return text


def test_what_is_wrong_is_said(tmp_path, right):
    path = write_egodex(tmp_path / "a.hdf5", {"right": right})
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert "damaged or cut short" in one_line(path)
    path.write_bytes(whole[:8])
    assert "damaged or cut short" in one_line(path)
    with h5py.File(tmp_path / "b.hdf5", "w") as file:
        file["emg/raw"] = np.zeros((5, 8))
    assert "no joints in it" in one_line(tmp_path / "b.hdf5")
    with h5py.File(tmp_path / "c.hdf5", "w") as file:
        file["transforms/camera"] = np.zeros((5, 4, 4))
    assert "holds no hand" in one_line(tmp_path / "c.hdf5")
    write_egodex(tmp_path / "d.hdf5", {"right": right})
    with h5py.File(tmp_path / "d.hdf5", "r+") as file:
        del file["transforms/rightThumbTip"]
        file["transforms/rightThumbTip"] = np.zeros((len(right), 3))
    assert "rightThumbTip has shape" in one_line(tmp_path / "d.hdf5")
    write_egodex(tmp_path / "e.hdf5", {"right": 1000 * right})
    assert "--unit mm would fit" in one_line(tmp_path / "e.hdf5")


def test_nothing_outside_of_the_file_is_read(tmp_path, right):
    write_egodex(tmp_path / "in.hdf5", {"right": right})
    path = write_egodex(tmp_path / "a.hdf5", {"right": right})
    with h5py.File(path, "r+") as file:
        del file["transforms/rightHand"]
        file["transforms/rightHand"] = h5py.ExternalLink("in.hdf5", "transforms/rightHand")
    assert "leads to another file" in one_line(path)


def test_emg2pose_needs_a_profile(tmp_path):
    angles = np.linspace(0.05, 0.5, 60)[:, None] * np.ones(20)
    angles[:, 4::4] = 0.0
    path = write_emg2pose(tmp_path / "session_left.hdf5", angles, "left")
    assert "--profile FILE" in one_line(path)
    profile = write_profile(tmp_path / "hand.json")
    (sequence,) = ht.load(path, profile=profile)
    assert (sequence.hand, sequence.subject) == ("left", "d387095792")
    assert sequence.fps == pytest.approx(2000, rel=1e-3)
    write_profile(tmp_path / "generic_hand_model.json", scale=1.0)  # in metres
    (beside,) = ht.load(path)
    np.testing.assert_allclose(beside.joints, sequence.joints, atol=1e-12)
    angles[7:9] = 0.0
    write_emg2pose(path, angles, "left")
    (sequence,) = ht.load(path)
    assert not sequence.present[7:9].any()
    assert sequence.present[:7, 2:].all()
    assert any("2 frames without a pose" in note for note in sequence.notes)
    write_emg2pose(path, angles, "middle")
    path = path.rename(tmp_path / "a.hdf5")
    assert "which hand" in one_line(path)
    profile.write_text('{"hand_model": {"a": 1}}')
    path = write_emg2pose(tmp_path / "b.hdf5", angles)
    with pytest.raises(InputError, match="no profile of UmeTrack"):
        ht.load(path, profile=profile)


def test_a_piece_larger_than_the_file_is_not_made_room_for(tmp_path):
    angles = np.linspace(0.05, 0.5, 60)[:, None] * np.ones(20)
    path = write_emg2pose(tmp_path / "a_left.hdf5", angles, "left")
    with h5py.File(path) as file:
        sizes: list[int] = []
        file["emg2pose/timeseries"].id.chunk_iter(lambda info: sizes.append(info.size))
    data = path.read_bytes()
    stored = sizes[0].to_bytes(4, "little")
    assert data.count(stored) == 1
    path.write_bytes(data.replace(stored, (2_000_000_000).to_bytes(4, "little")))
    assert "tells of 2000000000 bytes in one piece" in one_line(path)


def test_texts_larger_than_the_file_are_not_made_room_for(tmp_path):
    angles = np.linspace(0.05, 0.5, 60)[:, None] * np.ones(20)
    path = write_emg2pose(tmp_path / "a_left.hdf5", angles, "left")
    data = path.read_bytes()
    at = data.index(b"GCOL") + 8
    path.write_bytes(data[:at] + (2_000_000_000).to_bytes(8, "little") + data[at + 8 :])
    assert "2000000000 bytes of text" in one_line(path)


def test_texts_longer_than_the_file_are_not_made_room_for(tmp_path, right):
    path = tmp_path / "a.hdf5"
    for latest in (False, True):
        with h5py.File(path, "w", libver="latest" if latest else "earliest") as file:
            file["joints_m"], file.attrs["handed"] = right, "right"
            file.attrs["hand"] = "right"
        (sequence,) = ht.load(path)
        assert sequence.hand == "right"
        data = path.read_bytes()
        told = (5).to_bytes(4, "little")
        at = data.index(told, data.rindex(b"hand\0") + 20)
        path.write_bytes(data[:at] + (2_000_000_000).to_bytes(4, "little") + data[at + 4 :])
        # the newer layout has checksums of its own
        assert ("checksum" if latest else "hand tells of 2000000000 bytes") in one_line(path)


@pytest.mark.parametrize("packed", [{}, {"chunks": (6,)}, {"compression": "gzip"}])
def test_lists_of_texts_are_as_long_as_the_file(tmp_path, right, packed):
    path = tmp_path / "a.hdf5"
    sides = ["right"] * 6 + ["left"] * 6
    with h5py.File(path, "w") as file:
        file["joints_m"] = np.concatenate([right[:6], right[:6] * [-1, 1, 1]])
        file.create_dataset("hand", data=sides, dtype=h5py.string_dtype(), **packed)
    assert ht.load(path)
    if "compression" in packed:
        return
    with h5py.File(path) as file:
        places: list[int] = []
        data = file["hand"].id
        if packed:
            data.chunk_iter(lambda info: places.append(info.byte_offset))
        at = places[0] if packed else data.get_offset()
    data = path.read_bytes()
    path.write_bytes(data[:at] + (2_000_000_000).to_bytes(4, "little") + data[at + 4 :])
    assert "hand tells of 2000000" in one_line(path)


def test_a_heap_of_texts_with_an_object_of_no_length_is_refused(tmp_path):
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        file.attrs["side"] = "right"
    data = bytearray(path.read_bytes())
    at = data.index(b"GCOL") + 16  # its first object's number, count and size
    assert data[at : at + 2] == b"\1\0"
    data[at : at + 16] = bytes(16)
    path.write_bytes(data)
    with h5py.File(path) as file, pytest.raises(InputError, match="heap of texts"):
        said(file, "side", path)


@pytest.mark.parametrize("group", ["transforms", "emg2pose", "other"])
def test_long_names_are_not_repeated_whole(group, tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        for i in range(8):
            file[f"{group}/{i}{'x' * 1900}"] = np.zeros((2, 4, 4))
        if group == "emg2pose":
            file["emg2pose/timeseries"] = np.zeros(3, [("y" * 1900, float), ("z", float)])
    with pytest.raises(ht.InputError) as refused:
        ht.load(tmp_path / "a.hdf5")
    assert len(str(refused.value)) - len(str(tmp_path)) < 500
