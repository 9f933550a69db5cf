"""Files that are small and ask for much, and what is no file: one line, soon, in little memory."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import os
import struct
import tarfile
import zipfile

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError, InputError, SettingsError, shown
from handtrack.files import budget
from handtrack.files.npz import read_npz

MB = 10**6


def refused(path, match, **options):
    with pytest.raises(InputError, match=match) as error:
        ht.load(path, **options)
    text = str(error.value)
    assert text.isprintable()
    assert text.count(str(path)) <= 1
    assert len(text) < len(str(path)) + 500


@pytest.mark.parametrize("tool", [gzip, bz2, lzma], ids=lambda t: t.__name__)
def test_what_unpacks_to_many_times_its_size(tmp_path, tool):
    """Each piece alone is small; one after another they are 200 MB."""
    suffix = {"gzip": "gz", "bz2": "bz2", "lzma": "xz"}[tool.__name__]
    block = tarfile.TarInfo("x").tobuf()
    path = tmp_path / f"a.{suffix}"
    big = tarfile.TarInfo("big")
    big.size = 200 * MB
    path.write_bytes(tool.compress(big.tobuf()) + tool.compress(bytes(20 * MB)) * 10)
    refused(path, "unpacks to .* more than the 128 MB that are read: --max-size raises it")
    if tool is gzip:
        path.write_bytes(gzip.compress(b"[" + b" " * 20 * MB) + gzip.compress(b" " * 20 * MB) * 9)
        refused(path, "--max-size raises it")
        refused(path, "cut short", max_size="1GB")
    assert len(block) == 512


def test_the_size_of_a_file(tmp_path, right):
    np.save(tmp_path / "a.npy", right)
    assert len(ht.load(tmp_path / "a.npy", max_size="10kB")) == 1
    refused(tmp_path / "a.npy", "more than the 1 kB read: --max-size raises it", max_size=1000)
    for wrong in ("much", "-1", "0", "1e3", "GB", ""):
        with pytest.raises(SettingsError, match="max_size is"):
            ht.load(tmp_path / "a.npy", max_size=wrong)
    assert budget.parse_size("1.5 GiB") == 1_500_000_000
    assert budget.allowed() == budget.JOINTS


@pytest.mark.parametrize("kind", [b"S", b"x", b"g", b"L", b"0"])
def test_members_of_an_archive(tmp_path, kind):
    path, name = tmp_path / "a.tar", "hdHand3d/handRecon3D_hd00000001.json"
    member = tarfile.TarInfo(name)
    member.type, member.size = kind, 8**11 - 1
    path.write_bytes(member.tobuf(tarfile.GNU_FORMAT) + bytes(2048))
    refused(path, r"a\.tar: ")
    with gzip.open(path, "wb") as stream:
        stream.write(member.tobuf(tarfile.GNU_FORMAT) + bytes(2048))
    refused(path, r"a\.tar: ")


def test_an_archive_of_names_alone(tmp_path):
    path = tmp_path / "a.tar.gz"
    one = tarfile.TarInfo("x").tobuf()
    path.write_bytes(gzip.compress(one * 25_000 + bytes(1024)))
    refused(path, "more than 20,[0-9]{3} members")


def zipped(path, method=zipfile.ZIP_DEFLATED, **members):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return path


def header(shape, descr="'<f8'", size=0):
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + bytes(size)


@pytest.mark.parametrize(
    "shape",
    ["(99999999999, 21, 3)", "(0, 2**62)", "(-1, 21, 3)", "(4294967296, 4294967296)", "(1,) * 9",
     "(" + "1, " * 40 + ")", "(" + "9" * 5000 + ",)", "(" * 200 + ")" * 200, "(6.0, 21, 3)"],
)  # fmt: skip
def test_shapes_that_a_header_claims(tmp_path, shape):
    (tmp_path / "a.npy").write_bytes(header(shape, size=504))
    refused(tmp_path / "a.npy", r"a\.npy: the \.npy file is damaged")
    refused(zipped(tmp_path / "a.npz", joints_m=header(shape, size=504)), r"a\.npz: ")


def test_members_of_an_npz(tmp_path, right):
    path = tmp_path / "a.npz"
    out = io.BytesIO()
    np.save(out, right)
    joints = out.getvalue()
    refused(zipped(path, joints_m=header("(25000000,)", size=200 * MB)), "--max-size raises it")
    refused(zipped(path, zipfile.ZIP_LZMA, joints_m=joints), "packed by method 14")
    refused(zipped(path, zipfile.ZIP_BZIP2, joints_m=joints), "packed by method 12")
    data = bytearray(zipped(path, joints_m=joints).read_bytes())
    data[data.rfind(b"PK\x01\x02") + 8] |= 1
    data[6] |= 1
    path.write_bytes(data)
    refused(path, "joints_m is encrypted")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("joints_m.npy", joints)
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("joints_m.npy", joints)
    refused(path, "holds joints_m twice")
    zipped(path, joints_m=joints, other=header("(3,)", "'|O'"))
    arrays, names = read_npz(path, path, ("joints_m",))
    assert np.array_equal(arrays["joints_m"], right)
    assert names == ["joints_m", "other"]
    refused(path, "other holds pickled Python objects")


def test_what_is_no_file(tmp_path, right):
    os.mkfifo(tmp_path / "a.csv")
    refused(tmp_path / "a.csv", "is a named pipe, expected a file")
    (tmp_path / "zero.json").symlink_to("/dev/zero")
    refused(tmp_path / "zero.json", "is a device, expected a file")
    (tmp_path / "loop.npz").symlink_to(tmp_path / "loop.npz")
    refused(tmp_path / "loop.npz", "no such file")
    refused("a" * 5000, "no such file")
    refused("a\0b", "no such file")


def test_folders_that_lead_back(tmp_path, right):
    here = tmp_path
    for _ in range(50):
        here = here / "x"
        here.mkdir()
    np.save(here / "a.npy", right)
    (here / "back").symlink_to(tmp_path)
    assert len(ht.load(tmp_path)) == 1


def test_a_frame_of_interhand_that_is_there_twice(tmp_path):
    frame = json.dumps({"world_coord": np.ones((42, 3)).tolist()})
    for other in ("7", "07"):
        (tmp_path / "a.json").write_text(f'{{"0": {{"7": {frame}, "{other}": {frame}}}}}')
        refused(tmp_path / "a.json", "there twice")


def test_errors_quote_little():
    assert shown("x" * 10**6) == "x" * 199 + "…"
    assert shown("a\nb\x1b[31m\udcff") == "a\\nb\\x1b[31m\\udcff"
    assert shown(10**5000) == "a number of 16610 bits"
    assert shown([[[1]]]) == "a list"
    text = str(InputError("found " + "y" * 5000, "a\nb.csv"))
    assert text.startswith("a\\nb.csv: found yyy")
    assert len(text) < 300
    assert "\n" not in str(HandtrackError("a\nb"))
