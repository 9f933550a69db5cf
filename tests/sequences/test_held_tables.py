"""Large Parquet tables of numbers say what the same table in CSV says."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES

pyarrow = pytest.importorskip("pyarrow")
ROWS = 240


def table(right, title="{name}_{axis}", factor=1.0, **more):
    joints = factor * np.resize(right, (ROWS, 21, 3))
    joints += np.arange(ROWS)[:, None, None] * 1e-5 * factor
    joints[7] = np.nan
    joints[9, 4] = np.nan
    columns = {
        title.format(name=name, axis=axis): joints[:, j, i]
        for j, name in enumerate(JOINT_NAMES)
        for i, axis in enumerate("xyz")
    }
    return pyarrow.table(
        {**more, **{k: pyarrow.array(v, mask=np.isnan(v)) for k, v in columns.items()}}
    )


@pytest.mark.parametrize(
    "made",
    [
        {"time": np.arange(ROWS) / 60},
        {"timestamp_ns": np.arange(ROWS) * 16_666_667 + 10**18},
        {"title": "{name}_{axis}_mm", "factor": 1e3, "time_ms": np.arange(ROWS) * 16.5},
        {"time": np.arange(ROWS) / 60, "frame": np.arange(ROWS) * 2, "gain_of_it": np.ones(ROWS)},
        {"sec": np.arange(ROWS) + 5, "nanosec": np.arange(ROWS), "title": "right_{name}_{axis}"},
    ],
)
def test_as_csv(tmp_path, right, made):
    from pyarrow import csv, parquet

    columns = table(right, **made)
    parquet.write_table(columns, tmp_path / "a.parquet")
    csv.write_csv(columns, tmp_path / "a.csv")
    (held,), (text,) = ht.load(tmp_path / "a.parquet"), ht.load(tmp_path / "a.csv")
    np.testing.assert_array_equal(held.joints, text.joints)
    np.testing.assert_array_equal(held.time_ns, text.time_ns)
    np.testing.assert_array_equal(held.frame_index, text.frame_index)
    assert (held.hand, held.notes) == (text.hand, text.notes)


def test_floats_of_32_bits_are_what_is_stored(tmp_path, right):
    from pyarrow import parquet

    columns = table(right, time=np.arange(ROWS) / 60)
    small = pyarrow.table({n: columns[n].cast(pyarrow.float32()) for n in columns.column_names})
    parquet.write_table(small, tmp_path / "a.parquet")
    (held,) = ht.load(tmp_path / "a.parquet")
    stored = np.column_stack([np.asarray(small[n]) for n in small.column_names[1:]])
    np.testing.assert_array_equal(held.joints.reshape(ROWS, 63), stored.astype(np.float64))


def test_an_infinite_number_is_told(tmp_path, right):
    from pyarrow import parquet

    columns = table(right, time=np.arange(ROWS) / 60)
    values = columns["wrist_x"].to_pylist()
    values[4] = float("inf")
    columns = columns.set_column(1, "wrist_x", pyarrow.array(values))
    parquet.write_table(columns, tmp_path / "a.parquet")
    with pytest.raises(ht.InputError, match="infinite"):
        ht.load(tmp_path / "a.parquet")


def test_many_rows_are_read_some_at_a_time(tmp_path, right, monkeypatch):
    from pyarrow import parquet

    from handtrack.sequences.readers import parquet_file

    columns = table(right, time=np.arange(ROWS) / 60, frame=np.arange(ROWS))
    parquet.write_table(columns, tmp_path / "a.parquet")
    (whole,) = ht.load(tmp_path / "a.parquet")
    monkeypatch.setattr(parquet_file, "_BATCH", 37)
    monkeypatch.setattr(parquet_file, "_read_flat", None)
    (parts,) = ht.load(tmp_path / "a.parquet")
    np.testing.assert_array_equal(parts.joints, whole.joints)
    np.testing.assert_array_equal(parts.time_ns, whole.time_ns)
    np.testing.assert_array_equal(parts.frame_index, whole.frame_index)
    assert (parts.hand, parts.notes) == (whole.hand, whole.notes)


def test_large_hdf5_is_read_some_at_a_time(tmp_path, right, monkeypatch):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    from handtrack.sequences.readers import hdf5_file

    joints = np.resize(right, (ROWS, 21, 3)) + np.arange(ROWS)[:, None, None] * 1e-5
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset("right/joints", data=joints, chunks=(13, 7, 3))
    monkeypatch.setattr(hdf5_file, "MOST", 1000)
    monkeypatch.setattr(hdf5_file, "_BLOCK", 20_000)
    (read,) = ht.load(tmp_path / "a.hdf5")
    np.testing.assert_array_equal(read.joints, joints)
