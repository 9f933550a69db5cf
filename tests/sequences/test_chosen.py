"""Joints from where the user says they are: --key and --columns."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import InputError, SettingsError


@pytest.fixture
def joints(sample) -> np.ndarray:
    return sample.truth[40:60].astype(np.float64)


def same(path, joints, **options):
    (found,) = ht.load(path, **options)
    np.testing.assert_allclose(found.joints, joints, atol=1e-6)
    return found


def test_an_array_of_several(tmp_path, joints):
    path = tmp_path / "a.npz"
    rate = {"fps": 50.0, "hand": "left"}
    np.savez(path, joints_m=np.zeros_like(joints), smoothed=joints, junk=np.zeros(4), **rate)
    found = same(path, joints, key="smoothed", hand="auto")
    assert found.hand == "left"
    assert np.median(np.diff(found.time_ns)) == 20_000_000
    with pytest.raises(InputError, match="no key smoothd, its keys are: joints_m, smoothed"):
        ht.load(path, key="smoothd")
    with pytest.raises(InputError, match="joints has shape"):
        ht.load(path, key="junk")


def test_a_dataset_in_a_group(tmp_path, joints):
    h5py = pytest.importorskip("h5py", reason="HDF5 needs h5py (extra `formats`)")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["hand_joints"] = np.zeros_like(joints)
        file["run/7/xyz"] = joints
        file["run/7/time_s"] = np.arange(len(joints)) / 25
    found = same(path, joints, key="run/7/xyz", hand="right")
    assert np.median(np.diff(found.time_ns)) == 40_000_000
    with pytest.raises(InputError, match="no key run/7/xy, its keys are: run/7/time_s, run/7/xyz"):
        ht.load(path, key="run/7/xy")
    with pytest.raises(InputError, match="no key run/8/, its keys are: run/7"):
        ht.load(path, key="run/8/xyz")


@pytest.mark.parametrize("lines", [False, True])
def test_a_key_of_records(tmp_path, joints, lines):
    records = [
        {"t_ms": 10 * i, "side": "left", "out": {"pts": p.tolist(), "old": [[0, 0, 0]] * 21}}
        for i, p in enumerate(joints)
    ]
    records[3]["out"] = None
    path = tmp_path / "a.json"
    if lines:
        path.write_text("\n".join(map(json.dumps, records)))
    else:
        path.write_text(json.dumps({"fps": 100, "frames": records}))
    (found,) = ht.load(path, key="out.pts" if lines else "frames.out.pts", hand="left")
    np.testing.assert_allclose(found.joints[4:], joints[4:], atol=1e-6)
    assert np.isnan(found.joints[3]).all()
    assert np.median(np.diff(found.time_ns)) == 10_000_000
    with pytest.raises(InputError, match="there is no key"):
        ht.load(path, key="outs")


def table(joints, first: str, numbers: str = "%.6f") -> str:
    rows = [first]
    for i, p in enumerate(joints):
        rows.append(f"{i * 0.02:.2f}," + ",".join(numbers % v for v in p.ravel()) + ",7")
    return "\n".join(rows) + "\n"


def test_columns_by_title_by_number_and_of_a_table_without_titles(tmp_path, joints):
    titles = [f"q{i}" for i in range(63)]
    path = tmp_path / "a.csv"
    path.write_text(table(joints, ",".join(["time_s", *titles, "extra"])))
    for columns in ("q0:q62", "1:63", ",".join(titles)):
        found = same(path, joints, columns=columns, hand="right")
        assert np.median(np.diff(found.time_ns)) == 20_000_000
    swapped = ",".join(titles[3:] + titles[:3])
    same(path, joints, columns=swapped, order="wrist-last", hand="right")
    bare = tmp_path / "bare.csv"
    bare.write_text(table(joints, "").lstrip())
    same(bare, joints, columns="1:63", hand="right")
    for columns, says in (
        ("q0:q61", "62 columns, expected x, y and z"),
        ("q5:q1", "stands before the first"),
        ("q0:knee", "knee is none of its 65 columns"),
    ):
        with pytest.raises(SettingsError, match=says):
            ht.load(path, columns=columns)
    with pytest.raises(SettingsError, match="give one"):
        ht.load(path, columns="1:63", key="q0")
    with pytest.raises(SettingsError, match="is a folder"):
        ht.load(tmp_path, columns="1:63")


def test_the_command_line_takes_them(tmp_path, joints, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    np.savez("a.npz", one=joints, two=2 * joints)
    options = ["--hand", "right", "--fps", "30", "-q"]
    assert run(["track", "a.npz", "--key", "one", "-o", "a.mcap", *options]) == 0
    np.testing.assert_allclose(ht.read_mcap("a.mcap")[0].observed, joints, atol=1e-9)
    assert run(["track", "a.npz", "--key", "three", *options]) == 2
    assert capsys.readouterr().err.startswith("error: a.npz: there is no key three")
