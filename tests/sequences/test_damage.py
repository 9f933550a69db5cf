"""Files cut short and files with wrong bytes: an InputError or a true reading, nothing else."""

import json
import tarfile
import warnings

import numpy as np
import pytest
from test_leap import frame as leap_frame
from test_mcap_input import bones, write_json, write_own
from test_panoptic import frame, hand, name

import handtrack as ht

CUTS = 120
FLIPS = 120


def make_npz(path, joints):
    with path.open("wb") as stream:
        scores = np.ones((len(joints), 21))
        np.savez(stream, joints_m=joints, fps=30.0, hand="right", confidence=scores)


def make_compressed_npz(path, joints):
    with path.open("wb") as stream:
        np.savez_compressed(stream, joints_m=joints, fps=30.0, hand="right")


def make_npy(path, joints):
    with path.open("wb") as stream:
        np.save(stream, joints)


def make_json(path, joints):
    path.write_text(json.dumps({"joints_m": joints.tolist(), "fps": 30, "hand": "right"}))


def make_lines(path, joints):
    lines = [{"time": i / 30, "joints": j.tolist(), "hand": "right"} for i, j in enumerate(joints)]
    path.write_text("\n".join(map(json.dumps, lines)))


def make_csv(path, joints):
    path.write_text("\n".join(",".join(map(repr, map(float, j.ravel()))) for j in joints))


def make_leap(path, joints):
    frames = [leap_frame(i, (7, "right", j)) for i, j in enumerate(joints)]
    path.write_text(json.dumps({"frames": frames}))


def make_panoptic(path, joints):
    path.write_text(json.dumps(frame([{"id": 0, "right_hand": hand(joints[0])}])))


def make_tar(mode):
    def make(path, joints):
        folder = path.parent / "hdHand3d"
        folder.mkdir(exist_ok=True)
        for i, j in enumerate(joints[:4]):
            make_panoptic(folder / name(i), j[None])
        with tarfile.open(path, mode) as archive:
            archive.add(folder, "hdHand3d")

    return make


def make_mcap(**options):
    def make(path, joints):
        frames = [{"bone_data": bones(j, "Right")} for j in joints]
        write_json(path, {"/hand/right": frames}, **options)

    return make


def make_own(path, joints):
    time = np.arange(len(joints)) * 10**7
    hands = {"right": ("right", "a", time, joints, np.ones((len(joints), 21)), joints)}
    write_own(path, hands)


FORMATS = {
    "npz": make_npz,
    "compressed npz": make_compressed_npz,
    "npy": make_npy,
    "json": make_json,
    "jsonl": make_lines,
    "csv": make_csv,
    "leap": make_leap,
    "panoptic": make_panoptic,
    "tar": make_tar("w"),
    "tar.gz": make_tar("w:gz"),
    "tar.xz": make_tar("w:xz"),
    "mcap": make_mcap(),
    "plain mcap": make_mcap(use_chunking=False),
    "own mcap": make_own,
}


@pytest.fixture(params=FORMATS, ids=lambda name: name.replace(" ", "-"))
def made(request, tmp_path, motion):
    path = tmp_path / "a.data"
    FORMATS[request.param](path, motion("right", 5))
    assert len(ht.load(path)[0]) >= 1
    return path


def read(path):
    """Whether it could be read; any error but a one-line InputError with the file is a bug."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            sequences = ht.load(path)
        except ht.InputError as error:
            text = str(error)
            assert text.startswith(str(path)), text
            assert "\n" not in text
            return False
    assert sequences
    return True


def test_cut_short(made):
    whole = made.read_bytes()
    readable = []
    for end in np.unique(np.linspace(0, len(whole) - 1, CUTS).astype(int)):
        made.write_bytes(whole[:end])
        if read(made):
            readable.append(end)
    # text can end after a whole line, a tar.gz in its checksum; but not in the middle of data
    for end in readable:
        assert whole[end:].isspace() or whole[end : end + 1] == b"\n" or end > 0.5 * len(whole), end


def test_wrong_bytes(made):
    whole = made.read_bytes()
    rng = np.random.default_rng(5)
    for _ in range(FLIPS):
        wrong = bytearray(whole)
        for at in rng.integers(0, len(whole), rng.integers(1, 4)):
            wrong[at] = rng.integers(0, 256)
        made.write_bytes(wrong)
        read(made)
    for at in range(0, min(400, len(whole)), 3):  # headers
        wrong = bytearray(whole)
        wrong[at] ^= 1 << int(rng.integers(8))
        made.write_bytes(wrong)
        read(made)


def test_doubled_and_mixed(made):
    whole = made.read_bytes()
    made.write_bytes(whole + whole)
    read(made)
    half = len(whole) // 2
    made.write_bytes(whole[half:] + whole[:half])
    read(made)
