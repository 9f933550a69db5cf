"""Packed files: one file in .gz, .bz2, .xz or .zip reads as the file itself does."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zipfile

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from tools.fuzz.corpus import motion
from tools.fuzz.kinds import kinds


def zipped(data: bytes, name: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("folder/", "")
        archive.writestr(f"folder/{name}", data)
        archive.writestr("__MACOSX/._a", "")
    return out.getvalue()


PACKERS = {
    ".gz": lambda data, name: gzip.compress(data),
    ".bz2": lambda data, name: bz2.compress(data),
    ".xz": lambda data, name: lzma.compress(data),
    ".zip": zipped,
}


@pytest.mark.parametrize("suffix", PACKERS)
@pytest.mark.parametrize("kind", ["csv", "jsonl", "npz", "npy", "mcap", "hdf5", "parquet", "trc"])
def test_a_packed_file_reads_as_the_file(tmp_path, kind, suffix):
    (name, data), *_ = kinds()[kind].make(motion()).items()
    plain, packed = tmp_path / name, tmp_path / f"{name}{suffix}"
    plain.write_bytes(data)
    packed.write_bytes(PACKERS[suffix](data, name))
    for a, b in zip(ht.load(plain), ht.load(packed), strict=True):
        np.testing.assert_array_equal(a.joints, b.joints)
        np.testing.assert_array_equal(a.time_ns, b.time_ns)
        assert (a.name, a.hand, str(packed)) == (b.name, b.hand, b.source)


@pytest.mark.parametrize("suffix", PACKERS)
def test_a_packed_file_cut_short_is_one_line(tmp_path, suffix):
    (name, data), *_ = kinds()["mcap"].make(motion()).items()
    path = tmp_path / f"{name}{suffix}"
    path.write_bytes(PACKERS[suffix](data, name)[:-200])
    with pytest.raises(InputError, match="damaged or cut short") as refused:
        ht.load(path)
    assert str(refused.value).startswith(f"{path}: ")


def test_what_is_damaged_inside_names_the_packed_file(tmp_path):
    (name, data), *_ = kinds()["mcap"].make(motion()).items()
    path = tmp_path / f"{name}.gz"
    path.write_bytes(gzip.compress(data[: len(data) // 2]))
    with pytest.raises(InputError, match="MCAP") as refused:
        ht.load(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "handtrack-" not in str(refused.value)


def test_what_zstd_packed_says_what_to_do(tmp_path):
    (tmp_path / "a.csv.zst").write_bytes(b"\x28\xb5\x2f\xfd" + bytes(99))
    with pytest.raises(InputError, match="zstd -d"):
        ht.load(tmp_path / "a.csv.zst")


def test_a_zip_of_files_without_joints_names_them(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("a.csv", "x")
        archive.writestr("b.csv", "x")
    with pytest.raises(InputError, match=r"a\.zip: no joint sequence found \(a\.csv: .*and 1 more"):
        ht.load(tmp_path / "a.zip")


def test_the_only_array_of_an_npz_may_have_any_name(tmp_path):
    joints = motion()
    np.savez(tmp_path / "a.npz", mine=joints)
    (sequence,) = ht.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(sequence.joints, joints)
    np.savez(tmp_path / "b.npz", mine=np.zeros((9, 778, 3)))
    with pytest.raises(InputError, match="no joints in it"):
        ht.load(tmp_path / "b.npz")


@pytest.mark.parametrize(("kind", "companion"), [("hot3d", 1), ("trc markers", 1), ("panoptic", 0)])
def test_companions_in_utf_16(tmp_path, kind, companion):
    made = kinds()[kind]
    files = made.make(motion())
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    before = made.read(tmp_path / made.target)
    name = list(files)[companion]
    (tmp_path / name).write_bytes(files[name].decode().encode("utf-16"))
    for a, b in zip(before, made.read(tmp_path / made.target), strict=True):
        np.testing.assert_array_equal(a.joints, b.joints)


def test_a_damaged_zip_of_lzma(tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("a.csv", ",".join(map(str, range(4000))))
    data = bytearray(path.read_bytes())
    data[60:400] = b"\xff" * 340  # within the packed bytes
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"the \.zip file is damaged"):
        ht.load(path)
