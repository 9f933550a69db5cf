"""Clips that do not fit into memory: the same results, and memory that does not grow with them."""

from __future__ import annotations

import tracemalloc
from dataclasses import fields, replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.files import long_arrays
from handtrack.files.long_arrays import Growing, GrowingTexts, blocks, by_blocks
from handtrack.mcap.state import States
from handtrack.tracking.settings import FILTERS


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every array is a long one."""
    monkeypatch.setattr(long_arrays, "MOST", 0)


def repeated(sample: ht.Sequence, times: int) -> ht.Sequence:
    """There and back, with noise of its own each time."""
    there = np.concatenate([sample.joints, sample.joints[::-1]])
    rng = np.random.default_rng(2)
    joints = np.concatenate([there + rng.normal(0, 5e-4, there.shape) for _ in range(times)])
    time_ns = np.arange(len(joints)) * 16_666_667
    return replace(sample, joints=joints, time_ns=time_ns, confidence=None, frame_index=None,
                   truth=None)  # fmt: skip


@pytest.mark.parametrize("name", FILTERS)
def test_on_disk_as_in_memory(name: str, sample: ht.Sequence, monkeypatch: pytest.MonkeyPatch):
    """To the bit, of a clip that spans several blocks and windows."""
    clip = repeated(sample, 3)  # 1800 frames: rts looks at windows of 1024
    options = {"filter": name, "calibrate": "scale"}
    expected = ht.track(clip, **options)
    monkeypatch.setattr(long_arrays, "MOST", 0)
    found = ht.track(clip, **options)
    assert found.observed.base is not None
    assert expected.status.tolist().count("fitted") > 1000
    for of in fields(States):
        a, b = getattr(found, of.name), getattr(expected, of.name)
        assert (a is None) == (b is None)
        if a is not None:
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
    assert found.events == expected.events


@pytest.mark.parametrize("name", ["none", "kalman", "rts"])
def test_memory_does_not_grow_with_the_clip(name: str, sample: ht.Sequence, tiny: None):
    """What Python and NumPy hold at most, of a clip and of one four times as long."""

    def peak(times: int) -> tuple[int, int]:
        clip = repeated(sample, times)
        model, parts = ht.HandModel.default("right"), []
        tracemalloc.start()
        try:
            ht.track(
                clip, model, filter=name, calibrate="none", on_part=lambda p: parts.append(len(p))
            )
            return sum(parts), tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    (few, small), (many, large) = peak(3), peak(12)
    assert many == 4 * few
    # as it was: 4 to 18 kB a frame; what stays are counts, times and texts
    assert (large - small) / (many - few) < 600


def test_growing_arrays_hold_what_came(tiny: None):
    rng = np.random.default_rng(1)
    parts = [rng.normal(size=(n, 2, 3)) for n in (5, 1, 7)]
    made, texts = Growing((2, 3)), GrowingTexts()
    for part in parts:
        made.append(part)
        texts.append([f"{len(part)}", ""])
    expected = np.concatenate(parts)
    np.testing.assert_array_equal(made.read(slice(4, 9)), expected[4:9])
    whole = made.whole()
    np.testing.assert_array_equal(whole, expected)
    assert not whole.flags.writeable
    assert texts.whole().tolist() == ["5", "", "1", "", "7", ""]
    assert texts.read(slice(2, 4)) == ["1", ""]
    made.append(parts[0])
    np.testing.assert_array_equal(made.whole()[13:], parts[0])
    np.testing.assert_array_equal(
        by_blocks(lambda x: x.sum((1, 2)), whole, rows=4), expected.sum((1, 2))
    )
    assert [part.stop for part in blocks(10, 4)] == [4, 8, 10]


def test_no_room_is_said(tiny: None, monkeypatch: pytest.MonkeyPatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "gone"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    with pytest.raises(ht.HandtrackError, match="TMPDIR names another folder"):
        Growing((3,)).append(np.zeros((2, 3)))
