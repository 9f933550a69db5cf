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


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_exported_tables_say_whose_hand_it_is(tmp_path, right, ending):
    mirrored = right * [-1, 1, 1]
    time_ns = np.arange(len(right)) * 20_000_000
    tracks = [
        ht.track(ht.Sequence(time_ns, joints, hand=hand), calibrate="none")
        for hand, joints in (("left", mirrored), ("right", right))
    ]
    # each under a name that does not tell
    for track, joints in zip(tracks, (mirrored, right), strict=True):
        ht.export(track, tmp_path / f"a{len(track.hand)}.{ending}")
        (again,) = ht.load(tmp_path / f"a{len(track.hand)}.{ending}")
        assert again.hand == track.hand
        np.testing.assert_allclose(again.joints, joints, atol=1e-8)
        assert not any("no hand named" in note for note in again.notes)
