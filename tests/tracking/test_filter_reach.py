"""Which frames a smoother may speak of, which a remark is about, what settings refuse: edges."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from filter_cases import MODEL, steady

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from handtrack.sequences.sequence import Remark
from handtrack.tracking import sequence_track
from handtrack.tracking.filterpy_filter import FilterPyFilter
from handtrack.tracking.filters import make_filter
from handtrack.tracking.kalman import DriftingFilter, KalmanFilter
from handtrack.tracking.settings import TrackerSettings
from handtrack.tracking.smoothers import _within_reach


def reach(times: np.ndarray, fits: np.ndarray, coast: int) -> list[bool]:
    """Frame by frame."""
    found = []
    for t in range(len(times)):
        before = [u for u in range(t + 1) if fits[u]]
        after = [u for u in range(t + 1, len(times)) if fits[u]]
        if not before:
            found.append(False)
            continue
        last = times[before[-1]]
        bridged = bool(after) and times[after[0]] - last <= 2 * coast
        found.append(bridged or times[t] - last <= coast)
    return found


def test_a_gap_is_bridged_up_to_twice_the_coast_and_the_end_held_for_one():
    rng, edges = np.random.default_rng(0), 0
    for _ in range(300):
        times = np.cumsum(rng.integers(1, 4, 12))
        fits = rng.uniform(size=12) < 0.3
        coast = int(rng.integers(1, 5))
        expected = reach(times, fits, coast)
        np.testing.assert_array_equal(_within_reach(times, fits, coast), expected)
        edges += reach(times, fits, coast - 1) != expected
    assert edges > 100
    assert not _within_reach(np.arange(3), np.zeros(3, bool), 5).any()


def test_remarks_are_about_frames_from_their_first_to_their_last():
    @dataclasses.dataclass
    class Part:
        time_ns: np.ndarray
        reason: np.ndarray

    part = Part(np.array([10, 20, 30, 40]), np.array(["", "rejected", "", ""]))
    remarks = [Remark(20, 30, "mirrored"), Remark(40, 40, "swapped"), Remark(41, 50, "later")]
    found = sequence_track._with_remarks(part, remarks)
    assert found.tolist() == ["", "mirrored; rejected", "mirrored", "swapped"]
    assert part.reason.tolist() == ["", "rejected", "", ""]
    remarks += [Remark(10, 12, "first"), Remark(9, 30, "begun before")]
    told = [e.text for e in sequence_track._begun(remarks, part)]
    assert told == ["mirrored", "swapped", "first"]


@pytest.mark.parametrize(
    ("name", "wrong", "right"),
    [
        ("min_joints", (2, 22), (3, 21)),
        ("coast_s", (-1e-9, 1.1e6, np.nan), (0.0, 1e6)),
    ],
)
def test_a_trackers_settings_have_bounds(name, wrong, right):
    for value in wrong:
        with pytest.raises(SettingsError, match=name):
            TrackerSettings.of(None, {name: value})
    for value in right:
        assert getattr(TrackerSettings.of(None, {name: value}), name) == value


@pytest.mark.parametrize(("model", "shown"), [("left", "right"), ("right", "left")])
def test_a_model_of_the_other_hand_is_refused(model, shown, sample):
    sequence = dataclasses.replace(sample, hand=shown)
    with pytest.raises(
        InputError, match=f"the model is a {model} hand, the sequence a {shown} one"
    ):
        ht.track(sequence, ht.HandModel.default(model), calibrate=False, filter="none")


@pytest.mark.parametrize(
    ("colour", "engine", "kind"),
    [
        ("auto", "compiled", DriftingFilter),
        (0.2, "compiled", DriftingFilter),
        ("white", "compiled", KalmanFilter),
        ("auto", "filterpy", FilterPyFilter),
        ("white", "filterpy", FilterPyFilter),
    ],
)
@pytest.mark.parametrize("name", ["kalman", "fixed-lag"])
def test_noise_that_lasts_has_its_filter(name, colour, engine, kind):
    made = make_filter(steady(name, noise_colour=colour, engine=engine), MODEL)
    made = made._kalman if name == "fixed-lag" else made
    assert type(made) is kind
