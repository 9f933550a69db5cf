"""Tracking again what a track was made of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import handtrack as ht
from handtrack.evaluation.difference import difference
from handtrack.recording.retrack import as_stored, input_of, retrack
from handtrack.sequences.sequence import Remark
from handtrack.tracking.settings import FILTERS


@pytest.fixture(scope="module")
def gaps(sample) -> ht.Sequence:
    """The sample with gaps, notes and remarks."""
    joints = sample.joints.copy()
    joints[40:46] = np.nan
    joints[60, 8] += 0.2  # rejected, and said in words like those of a remark
    joints[100:140, 5:] = np.nan
    return dataclasses.replace(
        sample,
        joints=joints,
        notes=("what the reader had to say",),
        remarks=(Remark(int(sample.time_ns[7]), int(sample.time_ns[9]), "hands put back"),),
    )


def same(a: ht.Track, b: ht.Track) -> list[str]:
    """Names of the fields that differ."""
    out = []
    for field in dataclasses.fields(ht.Track):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if isinstance(x, np.ndarray):
            text = x.dtype.kind == "U"
            equal = x.tolist() == y.tolist() if text else x.tobytes() == y.tobytes()
        else:
            equal = x == y if field.name != "model" else x is y
        if not equal:
            out.append(field.name)
    return out


def test_remarks_keep_their_kind_and_old_ones_have_it(gaps):
    """Recordings of before had no kind: every remark was of an exchange."""
    remark = Remark(int(gaps.time_ns[2]), int(gaps.time_ns[3]), "from the other", "exchanged")
    track = ht.track(dataclasses.replace(gaps, remarks=(remark, *gaps.remarks)), filter="none")
    assert [r.kind for r in input_of(track).remarks] == ["exchanged", "other"]
    old = {"remarks": [[r[0], r[1], r[2]] for r in track.settings["remarks"]]}
    was = input_of(dataclasses.replace(track, settings={**track.settings, **old}))
    assert [r.kind for r in was.remarks] == ["exchanged", "exchanged"]


@pytest.mark.parametrize("name", FILTERS)
def test_with_its_own_settings_it_is_the_same(name, gaps):
    first = ht.track(gaps, filter=name, coast_s=0.1)
    assert first.rejected[60, 8]
    assert any("rejected" in event.text for event in first.events)
    again = retrack(first)
    assert same(first, again) == []
    assert difference(first, again).same


def test_other_settings_change_the_result(sample):
    first = ht.track(sample, ht.HandModel.default("right", "li2021"))
    other = retrack(first, settings={"filter": "kalman", "min_joints": 8})
    assert other.settings["filter"] == "kalman"
    assert other.settings["min_joints"] == 8
    assert other.settings["limits"] == "li2021"
    assert other.model is first.model
    np.testing.assert_array_equal(other.angles_raw, first.angles_raw)
    assert not np.array_equal(other.angles, first.angles)
    wider = retrack(first, first.model.with_limits("anatomical"))
    assert wider.settings["limits"] == "anatomical"
    anew = retrack(first, ht.HandModel.default("right", "li2021"), {"calibrate": True})
    assert difference(first, anew).worst_deg < 1e-6


def test_a_setting_that_is_not_known_any_more_is_left_aside(sample):
    first = ht.track(sample)
    old = dataclasses.replace(first, settings={**first.settings, "magic": 3})
    again = retrack(old)
    assert difference(first, again).same
    assert again.settings["magic"] == 3


def test_a_licensed_hand_is_asked_for(sample):
    model = dataclasses.replace(ht.HandModel.default("right"), name="mano", licensed=True)
    first = ht.track(sample, model)
    bare = dataclasses.replace(
        first.model,
        rest_vertices=np.empty((0, 3)),
        faces=np.empty((0, 3)),
        weights=np.empty((0, 16)),
    )
    stored = dataclasses.replace(first, model=bare)
    with pytest.raises(ht.ModelError, match="the hand is mano, whose licence"):
        retrack(stored)
    again = retrack(stored, as_stored(model, bare))
    assert [n for n in same(first, again) if n != "model"] == []
    np.testing.assert_array_equal(again.model.rest_joints, first.model.rest_joints)
    np.testing.assert_allclose(again.vertices(), first.vertices(), atol=1e-12)


WRONG = {
    "filter": [5, None, ["kalman"], "none?"],
    "lag": ["2", 1.5, {}],
    "coast_s": ["x", None],
    "min_joints": [[6], "6"],
    "process_noise": ["much", [], None],
    "noise_mm": ["2", True],
    "couple": ["yes", 1],
    "gate": [None, "no"],
    "update": ["best", 3],
    "robust": [0, "mean"],
    "remarks": ["x", [[1]], [["a", "b", "c"]], [[0, 1, 2]], {}],
    "collisions": ["no"],
    "spread_mm": ["wide"],
    "engine": ["fast", 7],
}


@pytest.mark.parametrize("name", WRONG)
def test_settings_of_a_file_that_are_of_another_kind(name, sample):
    """A recording may say anything, with all its checksums right."""
    track = ht.track(sample.frames(0, 12), calibrate=False)
    for value in WRONG[name]:
        changed = dataclasses.replace(track, settings={**track.settings, name: value})
        with pytest.raises(ht.HandtrackError) as told:
            retrack(changed)
        assert "\n" not in str(told.value)
        assert len(str(told.value)) < 400
