"""Clips inside of others' files: whole clips some names deep, arrays of a frame each, archives of
them, MATLAB's HDF5, what NumPy prints, Blender's bones."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES


def same(path, right):
    found = {s.hand: s for s in ht.load(path)}
    np.testing.assert_allclose(found["right"].joints, right, atol=1e-8)
    return found


def rate(sequence):
    return 1e9 / np.median(np.diff(sequence.time_ns))


WRAPPED = {
    "one name": lambda x: {"data": {"fps": 60, "joints": x}},
    "unlisted name": lambda x: {"version": 1, "content": {"fps": 60, "landmarks": x}},
    "about inside": lambda x: {"take": {"meta": {"fps": 60, "hand": "right"}, "keypoints": x}},
    "three names": lambda x: {"a": {"b": {"c": {"fps": 60, "joints": x}}}},
    "by side": lambda x: {"payload": {"fps": 60, "right": x}},
}


@pytest.mark.parametrize("wrap", WRAPPED)
def test_a_whole_clip_some_names_deep(tmp_path, right, wrap):
    (tmp_path / "a.json").write_text(json.dumps(WRAPPED[wrap](right.tolist())))
    assert rate(same(tmp_path / "a.json", right)["right"]) == pytest.approx(60, rel=1e-6)


def test_a_clip_of_three_frames_inside_is_no_frame_of_three_hands(tmp_path, right):
    value = {"data": {"fps": 30, "joints": right[:3].tolist()}}
    (tmp_path / "a.json").write_text(json.dumps(value))
    assert len(ht.load(tmp_path / "a.json")) == 1
    same(tmp_path / "a.json", right[:3])


@pytest.mark.parametrize("key", ["000012.jpg", "{t:06d}.png", "frame_{t}"])
def test_frames_under_names_of_pictures(tmp_path, right, key):
    value = {key.format(t=t) if "{" in key else f"{t:06d}.jpg": x for t, x in enumerate(right)}
    frames = {name: x.tolist() for name, x in value.items()}
    (tmp_path / "a.json").write_text(json.dumps(frames))
    assert same(tmp_path / "a.json", right)["right"].frame_index.tolist() == [*range(len(right))]


def test_joints_by_name_with_lists_of_x_y_and_z(tmp_path, right):
    joints = {
        name: {axis: right[:, j, i].tolist() for i, axis in enumerate("xyz")}
        for j, name in enumerate(JOINT_NAMES)
    }
    (tmp_path / "a.json").write_text(json.dumps({"fps": 30, "joints": joints}))
    same(tmp_path / "a.json", right)
    joints["wrist"]["x"] = joints["wrist"]["x"][:-1]
    (tmp_path / "a.json").write_text(json.dumps({"fps": 30, "joints": joints}))
    with pytest.raises(InputError, match="wrist: x, y, z are of different length"):
        ht.load(tmp_path / "a.json")


def test_frames_whose_joints_stand_under_pos(tmp_path, right):
    frames = [
        {"t": t / 72, "pos": [dict(zip("xyz", p, strict=True)) for p in frame]}
        for t, frame in enumerate(right.tolist())
    ]
    (tmp_path / "a.json").write_text(json.dumps({"frames": frames}))
    assert rate(same(tmp_path / "a.json", right)["right"]) == pytest.approx(72, rel=1e-6)


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


@pytest.mark.parametrize("folder", ["", "take1/"])
def test_a_zip_of_an_array_a_frame(tmp_path, right, folder):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for t, frame in enumerate(right):
            archive.writestr(f"{folder}joints_{t}.npy", npy(frame))
    same(tmp_path / "a.zip", right)


def test_a_zip_of_an_array_a_hand(tmp_path, right, left):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("take/left.npy", npy(left))
        archive.writestr("take/right.npy", npy(right))
    found = same(tmp_path / "a.zip", right)
    np.testing.assert_array_equal(found["left"].joints, left)


def test_an_npz_of_an_array_a_frame_in_the_order_of_their_numbers(tmp_path, right):
    np.savez(tmp_path / "a.npz", **{f"hand3d_{t}": right[t] for t in reversed(range(len(right)))})
    same(tmp_path / "a.npz", right)


def test_arrays_as_numpy_prints_them(tmp_path, right):
    text = "\n".join(np.array2string(frame, precision=9) for frame in right)
    (tmp_path / "a.txt").write_text(text)
    same(tmp_path / "a.txt", right)


def test_blenders_bones_with_their_heads_and_tails(tmp_path, right):
    rows = ["frame,bone,head_x,head_y,head_z,tail_x,tail_y,tail_z"]
    fingers = ("thumb", "f_index", "f_middle", "f_ring", "f_pinky")
    for t, x in enumerate(right):
        ends = [("hand.R", 0, 9)]
        for f, finger in enumerate(fingers):
            ends += [(f"{finger}.0{k}.R", 4 * f + k, 4 * f + k + 1) for k in (1, 2, 3)]
        rows += [f"{t},{n}," + ",".join(map(repr, [*x[a], *x[b]])) for n, a, b in ends]
    (tmp_path / "a.csv").write_text("\n".join(rows).replace("np.float64(", "").replace(")", ""))
    same(tmp_path / "a.csv", right)


def test_hdf5_of_a_group_a_frame_and_what_data_sets_say_of_themselves(tmp_path, right):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for t, frame in enumerate(right):
            file[f"frame_{t:04d}/joints"] = frame
    assert len(ht.load(tmp_path / "a.h5")) == 1
    same(tmp_path / "a.h5", right)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        data = file.create_dataset("keypoints", data=1000 * right)
        data.attrs["unit"], data.attrs["fps"] = "mm", 50
    assert rate(same(tmp_path / "b.h5", right)["right"]) == pytest.approx(50, rel=1e-6)


def test_matlabs_files_of_either_age(tmp_path, motion):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    right = motion("right", 40)
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["joints"] = right.transpose(2, 1, 0)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
    path.write_bytes(head + path.read_bytes()[len(head) :])
    same(path, right)
    path.write_bytes(b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(600))
    with pytest.raises(InputError, match=r"-v7\.3"):
        ht.load(path)
