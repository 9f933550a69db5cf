"""What `handtrack export` wrote is read again: what was observed, and the truth."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht


@pytest.mark.parametrize(("name", "least"), [("a.csv", 1e-9), ("a.parquet", 0.0)])
def test_an_exported_table_is_tracked_again(tmp_path, right, name, least):
    observed = right.copy()
    observed[3, 4:9] = np.nan
    sequence = ht.Sequence(
        time_ns=np.arange(len(right)) * 20_000_000 + 5,
        joints=observed,
        frame_index=np.arange(len(right)) + 100,
        truth=right + 0.001,
    )
    track = ht.track(sequence, calibrate="none", filter="kalman")
    ht.export(track, tmp_path / name)
    (again,) = ht.load(tmp_path / name, hand="right")
    np.testing.assert_allclose(again.joints, observed, atol=least)
    np.testing.assert_allclose(again.truth, right + 0.001, atol=least)
    assert np.array_equal(again.time_ns, sequence.time_ns)
    assert np.array_equal(again.frame_index, sequence.frame_index)
    assert not any("not used" in note for note in again.notes)
