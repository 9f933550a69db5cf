"""What a file may be written like without its values being others, and sums that must tell."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from tools.fuzz import corpus


def test_the_sum_of_a_packed_archive_is_checked(tmp_path):
    path, joints = tmp_path / "a.tar.gz", corpus.motion()
    data = bytearray(gzip.compress(corpus.tar("w")(joints)["a.tar"], 0))
    np.testing.assert_allclose(_read(path, bytes(data)), joints)
    place = data.index(b"landmarks") + 16
    data[place] = ord("7") if data[place] != ord("7") else ord("8")
    with pytest.raises(InputError, match="damaged"):
        _read(path, bytes(data))


@pytest.mark.parametrize("repeat_channels", [True, False])
@pytest.mark.parametrize("use_chunking", [True, False])
def test_mcap_files_without_channels_or_index_at_the_end(tmp_path, repeat_channels, use_chunking):
    joints = corpus.motion()
    options = {"repeat_channels": repeat_channels, "use_chunking": use_chunking}
    data = corpus.mcap(joints, **options)["a.mcap"]
    np.testing.assert_allclose(_read(tmp_path / "a.mcap", data), joints)


def test_texts_in_arrays_of_one(tmp_path):
    data = corpus.as_npz(joints_m=corpus.motion(), fps=np.array([30.0]), hand=np.array(["left"]))
    (tmp_path / "a.npz").write_bytes(data)
    assert ht.load(tmp_path / "a.npz")[0].hand == "left"


def test_numbers_that_nothing_is(tmp_path):
    frames = [{"time": 0.5, "joints": j.tolist()} for j in corpus.motion()]
    frames[2]["time"] = {"sec": 10**400, "nanosec": 0}
    with pytest.raises(InputError, match="expected sec and nanosec"):
        _read(tmp_path / "a.json", json.dumps(frames).encode())
    frame = {"world_coord": [[0.0] * 3] * 42, "joint_valid": [10**400] + [1] * 41}
    with pytest.raises(InputError, match="joint_valid"):
        _read(tmp_path / "joint_3d.json", json.dumps({"0": {"3": frame}}).encode())
    far = corpus.motion().reshape(6, -1)
    far[:, 5] = 1e308
    rows = [" ".join(map(str, [i, *row])) for i, row in enumerate(far)]
    with pytest.raises(InputError, match="expected a place near a hand"):
        _read(tmp_path / "skeleton.txt", "\n".join(rows).encode())


def _read(path, data):
    path.write_bytes(data)
    return ht.load(path)[0].joints
