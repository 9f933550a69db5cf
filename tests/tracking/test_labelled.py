"""Tracks as tables of other libraries, in part, and as they print themselves."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.hand.sketch import sketch


@pytest.fixture(scope="module")
def track(sample) -> ht.Track:
    return ht.track(sample.frames(0, 59), filter="kalman")


def test_a_part_by_time(track):
    part = track.between(0.5, 1.0)
    inside = (track.time_ns - track.time_ns[0] >= 0.5e9) & (track.time_ns - track.time_ns[0] <= 1e9)
    np.testing.assert_array_equal(part.frame_index, track.frame_index[inside])
    np.testing.assert_array_equal(part.angles, track.angles[inside])
    assert all(part.time_ns[0] <= event.time_ns <= part.time_ns[-1] for event in part.events)
    assert len(track.between()) == len(track)
    with pytest.raises(InputError, match=r"no frame from 50 to None s, there are 0 to 1\.967 s"):
        track.between(50)


def test_a_part_of_a_sequence_by_time(sample, track):
    part = sample.between(0.5, 1.0)
    start = (part.time_ns[0] - sample.time_ns[0]) * 1e-9
    end = (part.time_ns[-1] - sample.time_ns[0]) * 1e-9
    assert 0.5 <= start < 0.54
    assert 0.96 < end <= 1.0
    first, last = part.frame_index[[0, -1]]
    np.testing.assert_array_equal(part.joints, sample.joints[first : last + 1])
    np.testing.assert_array_equal(part.truth, sample.truth[first : last + 1])
    assert repr(part).startswith(f"<Sequence 'sample', right hand, {len(part)} frames in ")
    assert repr(part).endswith(" % of the joints missing, with truth>")
    with pytest.raises(InputError, match="no frame from 50 to None s"):
        sample.between(50)
    for of in (sample, track):
        with pytest.raises(InputError, match="'a' is no time: expected seconds from the first"):
            of.between("a", 2)


def test_a_sequence_shows_itself_in_a_notebook(sample):
    html = sample._repr_html_()
    assert html.count("<line") >= 15
    assert "300, 30 a second" in html
    assert f"{100 * (1 - sample.present.mean()):.1f} % of the joints" in html
    assert "nan" not in html
    gone = sample.joints.copy()
    gone[:, 9] = np.nan
    without = dataclasses.replace(sample, joints=gone)._repr_html_()
    assert "<svg" not in without
    assert "<table" in without
    flat = dataclasses.replace(sample, joints=np.full_like(sample.joints, 0.5))
    assert "<table" in flat._repr_html_()


def test_the_sketch_shows_the_back_of_either_hand(sample):
    def thumb_at(hand, joints):
        circles = re.findall(r"cx='([\d.]+)' cy='([\d.]+)'", sketch(joints, hand))
        points = np.array(circles, float)
        assert points.min() >= 10
        assert points.max() <= 150
        assert points[0, 1] > points[9, 1]  # the wrist is below
        return points[4, 0] - points[20, 0]

    rest = ht.HandModel.default().rest_joints
    assert thumb_at("right", rest) < 0  # the back of a right hand: its thumb is left
    assert thumb_at("left", rest * [1, -1, 1]) > 0


def test_it_says_what_it_is_in_one_line(track):
    model = track.model
    assert repr(model) == (
        f"<HandModel {model.name!r}, {model.hand} hand, palm {1e3 * model.size:.1f} mm,"
        f" {model.limits.name} limits, skin of {len(model.rest_vertices):,} vertices>"
    )
    text = repr(track)
    assert text.startswith("<Track 'sample', right hand, 60 frames in 1.97 s: 60 fitted, ")
    assert len(text) < 120
    html = track._repr_html_()
    assert html.count("<line") == 20
    assert "60, 30 a second" in html
    assert "nan" not in html.partition("</svg>")[0]


def test_a_table_of_pandas(track):
    pytest.importorskip("pandas", reason="pandas is not installed (extra data)")
    table = track.to_dataframe()
    assert len(table) == 60
    assert table.index.name == "time_s"
    np.testing.assert_allclose(np.diff(table.index), 1 / 30, atol=1e-6)
    np.testing.assert_allclose(
        table[[f"{n}_deg" for n in ANGLE_NAMES]].to_numpy(), np.rad2deg(track.angles)
    )
    np.testing.assert_allclose(table["wrist_x_mm"], 1e3 * track.filtered_joints[:, 0, 0])
    np.testing.assert_allclose(table["truth_wrist_z_mm"], 1e3 * track.truth[:, 0, 2])


def test_a_data_set_of_xarray(track):
    pytest.importorskip("xarray", reason="xarray is not installed (extra data)")
    found = track.to_xarray()
    joints = found["filtered_joints"]
    assert joints.dims == ("time", "joint", "space")
    assert (joints.attrs["units"], found["angles"].attrs["units"]) == ("m", "rad")
    tip = found["observed"].sel(joint="index_tip", space="y").to_numpy()
    np.testing.assert_array_equal(tip, track.observed[:, JOINT_NAMES.index("index_tip"), 1])
    assert found.sel(time=slice(0.5, 1.0)).sizes["time"] == len(track.between(0.5, 1.0))
    assert found.attrs["hand"] == "right"
