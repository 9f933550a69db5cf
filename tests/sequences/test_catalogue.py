"""Formats are found in the modules of their readers."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ORDERS
from handtrack.sequences import readers
from handtrack.sequences.readers import catalogue
from handtrack.sequences.readers.catalogue import formats


def test_formats_have_different_names_and_known_orders():
    assert len({f.name for f in formats()}) == len(formats())
    said = {w for f in formats() for w in f.order.split(", ")}
    assert {w for w in said if " " not in w} <= {*ORDERS}


_TOY = """
import numpy as np

from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.raw import Raw, stem


def read_toy(data, path):
    rows = [line.split()[1:] for line in data.decode().splitlines()]
    joints = np.array(rows, dtype=float).reshape(-1, 21, 3)
    return [Raw(joints, path, stem(path), unit="mm", hand="right")]


def read_toy_hdf5(file, path):
    if "toy" not in file:
        return None
    return [Raw(file["toy"][()], path, stem(path), unit="mm", hand="right")]


FORMATS = (
    Format(
        "Toy",
        "lines of TOY",
        "handtrack",
        "mm",
        "right",
        "its word",
        kinds={"toy": read_toy},
        suffixes=(".toy",),
        ways=(Way("text", lambda data, path: data.startswith(b"TOY"), read_toy),),
        hdf5=read_toy_hdf5,
    ),
)
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """One more module among the readers: all that a new format takes."""
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "toy_of_tests.py").write_text(_TOY)
    monkeypatch.setattr(readers, "__path__", [*readers.__path__, str(folder)])
    found = [f for f in vars(catalogue).values() if hasattr(f, "cache_clear")]
    for each in found:
        each.cache_clear()
    yield
    sys.modules.pop("handtrack.sequences.readers.toy_of_tests", None)
    vars(readers).pop("toy_of_tests", None)
    monkeypatch.undo()
    for each in found:
        each.cache_clear()


def test_a_reader_is_added_by_its_module_alone(toy, tmp_path):
    joints = 1e3 * HandModel.default("right").rest_joints + (10.0 + np.arange(5))[:, None, None]
    data = tmp_path / "data"
    data.mkdir()
    lines = ["TOY " + " ".join(f"{x:.6f}" for x in frame.ravel()) for frame in joints]
    (data / "a.toy").write_text("\n".join(lines))
    # known by its content, by its ending in a folder, and by its name
    for found in (
        ht.load(data / "a.toy"),
        ht.load(data),
        ht.load(data / "a.toy", format="toy"),
    ):
        np.testing.assert_allclose(found[0].joints, 1e-3 * joints, atol=1e-8)
    assert "Toy" in {f.name for f in catalogue.formats()}


def test_so_is_one_of_hdf5(toy, tmp_path):
    h5py = pytest.importorskip("h5py")
    joints = 1e3 * HandModel.default("right").rest_joints + (10.0 + np.arange(5))[:, None, None]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["toy"] = joints
    np.testing.assert_allclose(ht.load(tmp_path / "a.h5")[0].joints, 1e-3 * joints, atol=1e-8)
