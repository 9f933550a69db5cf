"""Units that are said wrongly, and companion files that are missing, others' or no such file: one
line with file, place and cure."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES
from tools.fuzz.kinds import kinds

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
TITLES = [f"{name}_{axis}" for name in JOINT_NAMES for axis in "xyz"]


def rows(joints):
    return "\n".join(",".join(f"{v:.7f}" for v in frame.ravel()) for frame in joints)


def trc(joints, unit):
    head = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    head += f"30\t30\t{len(joints)}\t21\t{unit}\nFrame#\tTime\t" + "\t\t\t".join(JOINT_NAMES)
    axes = "\t".join(f"{a}{k}" for k in range(1, 22) for a in "XYZ")
    body = (
        f"{i + 1}\t{i / 30:.6f}\t" + "\t".join(f"{v:.6f}" for v in frame.ravel())
        for i, frame in enumerate(joints)
    )
    return "\n".join((head, f"\t\t{axes}", *body)) + "\n"


WRITERS = {
    "a.json": lambda j, unit: json.dumps({"unit": unit, "fps": 30, "joints": j.tolist()}),
    "b.json": lambda j, unit: json.dumps({"fps": 30, f"joints_{unit}": j.tolist()}),
    "c.csv": lambda j, unit: ",".join(f"{t}_{unit}" for t in TITLES) + "\n" + rows(j),
    "d.csv": lambda j, unit: f"# unit: {unit}\n" + ",".join(TITLES) + "\n" + rows(j),
    "e.csv": lambda j, unit: ",".join(f"{t} [{unit}]" for t in TITLES) + "\n" + rows(j),
    "f.trc": trc,
}


def told(path, **options):
    with pytest.raises(HandtrackError) as refused:
        ht.load(path, **options)
    text = str(refused.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("said", METRES)
@pytest.mark.parametrize("is_in", METRES)
@pytest.mark.parametrize("name", WRITERS)
def test_a_unit_that_is_said_wrongly(tmp_path, right, name, said, is_in):
    path = tmp_path / name
    path.write_text(WRITERS[name](right / METRES[is_in], said))
    if said == is_in:
        (found,) = ht.load(path)
        np.testing.assert_allclose(found.joints, right, atol=1e-6)
        return
    text = told(path)
    assert text.startswith(f"{path}: ")
    assert f"with unit {said}; --unit {is_in} would fit" in text
    (found,) = ht.load(path, unit=is_in)
    np.testing.assert_allclose(found.joints, right, atol=1e-6)


def sample(name, folder, joints):
    kind = kinds()[name]
    for file, data in kind.make(joints).items():
        (folder / file).write_bytes(data)
    return folder / kind.target


COMPANIONS = [
    ("hot3d", "profile"),
    ("aria", "trajectory"),
    ("trc markers", "markers"),
    ("npz mano", "mano"),
]


@pytest.mark.parametrize(("name", "option"), COMPANIONS)
def test_a_companion_that_is_not_there(tmp_path, right, name, option):
    path = sample(name, tmp_path, right)
    gone = tmp_path / "gone.json"
    assert str(gone) in told(path, **{option: gone})


@pytest.mark.parametrize(("name", "option"), COMPANIONS)
@pytest.mark.parametrize("content", [b"", b"{}", b"[1, 2", b"a,b\n1,2\n", b"\0\1\2\3" * 50])
def test_a_companion_of_another_kind(tmp_path, right, name, option, content):
    path = sample(name, tmp_path, right)
    other = tmp_path / "other.json"
    other.write_bytes(content)
    assert str(other) in told(path, **{option: other})


@pytest.mark.parametrize("option", ["profile", "trajectory", "markers"])
def test_a_companion_of_nothing_in_the_file(tmp_path, right, option):
    path = sample("json", tmp_path, right)
    beside = tmp_path / "beside.json"
    beside.write_text("{}")
    text = told(path, **{option: beside})
    assert option in text


def test_landmarks_in_a_picture_ask_for_a_lens(tmp_path, right):
    seen = right * [1, 1, 0] + np.linspace(0.2, 0.3, len(right))[:, None, None] * [1, 1, 0]
    seen[..., 2] = right[..., 2] - right[:, :1, 2]
    path = tmp_path / "a.json"
    path.write_text(json.dumps(seen.tolist()))
    text = told(path)
    assert text.startswith(f"{path}: ")
    assert "--camera LENS" in text
