"""Folders, missing and empty things, names."""

import gzip
import os
import subprocess
import sys

import numpy as np
import pytest

import handtrack as ht


def test_missing_and_empty(tmp_path):
    with pytest.raises(ht.InputError, match=r"nothing\.npz: no such file or folder"):
        ht.load(tmp_path / "nothing.npz")
    with pytest.raises(ht.InputError, match=r"no joint sequence found$"):
        ht.load(tmp_path)
    (tmp_path / "a.npz").touch()
    with pytest.raises(ht.InputError, match=r"a\.npz: the file is empty"):
        ht.load(tmp_path)
    with pytest.raises(ht.InputError, match="the file is empty"):
        ht.load(tmp_path / "a.npz")


def test_what_is_passed_over(tmp_path, right):
    for name in ("README.md", "LICENSE", "license.txt", ".hidden.npz", "video.mp4", "a.pkl"):
        (tmp_path / name).write_bytes(b"\0\1\2")
    (tmp_path / ".cache").mkdir()
    (tmp_path / ".cache" / "b.npz").write_bytes(b"x")
    np.savez(tmp_path / "camera.npz", matrix=np.eye(3))
    with pytest.raises(ht.InputError, match=r"no joint sequence found \(camera.npz: no joints"):
        ht.load(tmp_path)
    np.savez(tmp_path / "joints.npz", joints_m=right, fps=30, hand="right")
    (tmp_path / "notes.txt").write_text("What was done, and when:\nfirst this\n\nthen, that\n")
    (tmp_path / "weights.csv").write_text("1,2\n3\n")
    (sequence,) = ht.load(tmp_path)
    assert sequence.name == "joints"
    assert "and 2 more" in sequence.notes[-1]
    assert sequence.notes[-1].startswith("passed over: camera.npz: no joints in it")


def test_one_damaged_file_is_an_error_and_not_passed_over(tmp_path, right):
    np.savez(tmp_path / "a.npz", joints_m=right)
    (tmp_path / "b.npz").write_bytes((tmp_path / "a.npz").read_bytes()[:500])
    with pytest.raises(ht.InputError, match=r"b\.npz: the \.npz file is damaged or cut short"):
        ht.load(tmp_path)


def test_equal_names_get_their_folder(tmp_path, right):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        np.savez(tmp_path / folder / "joints.npz", joints_m=right, fps=30, hand="right")
    np.save(tmp_path / "other.npy", right)
    np.savez(tmp_path / "one" / "x.npz", joints_m=right, name="same")
    np.savez(tmp_path / "one" / "y.npz", joints_m=right, name="same")
    names = [s.name for s in ht.load(tmp_path)]
    assert names == ["other", "one joints", "one same 1", "one same 2", "two joints"]


def test_frames(tmp_path, right):
    np.savez(tmp_path / "short.npz", joints_m=right[:4], fps=30)
    np.savez(tmp_path / "long.npz", joints_m=right, fps=30)
    assert [len(s) for s in ht.load(tmp_path, frames=(2, 6))] == [5, 2]
    (only,) = ht.load(tmp_path, frames=(6, 9))  # the short one has none of them
    assert only.frame_index.tolist() == [6, 7, 8, 9]
    with pytest.raises(ht.InputError, match="no joint in frames 50:60, there are 0:"):
        ht.load(tmp_path, frames=(50, 60))


def test_compressed_text(tmp_path, right):
    import json

    path = tmp_path / "a.json.gz"
    path.write_bytes(gzip.compress(json.dumps(right.tolist()).encode()))
    (sequence,) = ht.load(path)
    np.testing.assert_array_equal(sequence.joints, right)
    assert sequence.name == "a"


@pytest.mark.parametrize("data", [b"\0\1\2", b"hello world", b"# only\n", b"%PDF-"])
def test_something_else(tmp_path, data):
    path = tmp_path / "a.json"
    path.write_bytes(data)
    with pytest.raises(ht.InputError) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_recognised_by_content_not_by_name(tmp_path, right):
    np.savez(tmp_path / "a.npz", joints_m=right, fps=30, hand="right")
    (tmp_path / "a.npz").rename(tmp_path / "a.txt")
    assert len(ht.load(str(tmp_path / "a.txt"))) == 1


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable(tmp_path, right):
    np.save(tmp_path / "a.npy", right)
    (tmp_path / "a.npy").chmod(0)
    with pytest.raises(ht.InputError, match="cannot be read: Permission denied"):
        ht.load(tmp_path / "a.npy")


def test_slow_packages_are_not_imported():
    slow = ("mcap", "google.protobuf", "scipy", "rerun", "numba")
    code = "import sys, handtrack.sequences.load\n"
    code += f"print([m for m in {slow} if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
