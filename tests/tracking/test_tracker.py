"""The tracker: streams equal sequences, frames that cannot be fitted, what it refuses."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from tracked_clip import FILTERS, GAPS, WAITING, same, stream

import handtrack as ht
from handtrack.hand.rotations import about_axis
from handtrack.tracking import sequence_track as module
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.settings import TrackerSettings

COAST_S = TrackerSettings().coast_s


FRAME_NS = 33_333_333


def equal_to_track(frames: list[TrackedFrame], track: ht.Track) -> None:
    assert len(frames) == len(track)
    for field in fields(TrackedFrame):
        same([getattr(frame, field.name) for frame in frames], getattr(track, field.name))


def test_a_stream_equals_the_sequence_bit_for_bit(tracked, long):
    tracker = ht.Tracker(tracked.model, filter=tracked.settings["filter"])
    equal_to_track(stream(tracker, long), tracked)


@pytest.fixture(scope="module")
def whole(tracked, long) -> ht.Track:
    """Tracked on a known hand: frames are tracked in chunks, a hand is not looked for so."""
    return ht.track(long, tracked.model, filter=tracked.settings["filter"], calibrate=False)


@pytest.mark.parametrize("chunk", [1, 7, 255, 10_000])
def test_chunks_do_not_show(chunk, whole, long, monkeypatch):
    monkeypatch.setattr(module, "_CHUNK", chunk)
    again = ht.track(long, whole.model, filter=whole.settings["filter"], calibrate=False)
    for field in fields(TrackedFrame):
        same(getattr(again, field.name), getattr(whole, field.name))


@pytest.mark.parametrize(("name", "lag"), [("fixed-lag", 3), ("fixed-lag", 0), ("rts", 600)])
def test_a_filter_that_waits_gives_the_same_frames_later(name, lag, long):
    track = ht.track(long, filter=name, lag=min(lag, 3))
    tracker = ht.Tracker(track.model, filter=name, lag=min(lag, 3))
    given: list[TrackedFrame] = []
    for t in range(600):
        given += tracker.push(long.joints[t], long.time_ns[t], long.confidence[t])
        assert len(given) == max(t + 1 - lag, 0)
    given += tracker.finish()
    equal_to_track(given, track)
    assert tracker.finish() == []


@pytest.mark.parametrize("name", WAITING)
def test_a_filter_that_waits_has_no_step(name, sample):
    tracker = ht.Tracker(ht.HandModel.default(), filter=name)
    with pytest.raises(ht.SettingsError, match=f"filter {name} waits .* push"):
        tracker.step(sample.joints[0], 0)
    assert tracker.push(sample.joints[0], 0) == []


def test_reset_makes_it_new(tracked, long):
    tracker = ht.Tracker(tracked.model, filter=tracked.settings["filter"])
    stretch = long.frames(150, 280)
    for x, t in zip(stretch.joints, stretch.time_ns, strict=True):
        tracker.push(x, t)
    tracker.reset()
    equal_to_track(stream(tracker, long), tracked)


def test_two_runs_are_one(long):
    a, b = ht.track(long), ht.track(long)
    for field in fields(TrackedFrame):
        same(getattr(a, field.name), getattr(b, field.name))


@pytest.mark.parametrize("tracked", ["none"], indirect=True)
def test_statuses_without_a_filter(tracked, long):
    enough = (long.present & (long.confidence > 0)).sum(1) >= TrackerSettings().min_joints
    same(tracked.status, np.where(enough, "fitted", "lost"))
    fitted = np.flatnonzero(enough)
    gone = np.diff(long.time_ns[fitted]) * 1e-9
    again = {int(t): dt for t, dt in zip(fitted[1:], gone, strict=True) if dt > COAST_S}
    assert {GAPS[2].stop, GAPS[3].stop} < set(again)
    assert np.flatnonzero(tracked.restart).tolist() == list(again)
    for t, dt in again.items():
        assert tracked.reason[t] == f"found again after {dt:.2f} s"
    assert (tracked.reason[enough & ~tracked.restart] == "").all()
    assert tracked.reason[100] == "0 of 21 joints observed, 6 needed"
    assert tracked.reason[400].endswith("of 21 joints observed, 6 needed")
    lost = tracked.status == "lost"
    for name in ("angles", "quaternion", "translation", "fitted_joints", "filtered_joints"):
        values = getattr(tracked, name)
        assert np.isnan(values[lost]).all()
        assert np.isfinite(values[~lost]).all()
    assert np.isnan(tracked.objective[lost]).all()
    assert np.isinf(tracked.angle_variance[lost]).all()


@pytest.mark.parametrize("tracked", FILTERS[1:] + WAITING, indirect=True)
def test_a_filter_predicts_short_gaps_and_gives_up_on_long_ones(tracked, long):
    # nothing is known before the first fit
    assert (tracked.status[GAPS[0]] == "lost").all()
    assert tracked.status[100] == "predicted"
    assert tracked.reason[100] == "0 of 21 joints observed, 6 needed"
    gap = GAPS[-1]
    since = (long.time_ns[gap] - long.time_ns[gap.start - 1]) * 1e-9
    same(tracked.status[gap], np.where(since <= COAST_S, "predicted", "lost"))
    assert set(tracked.status[gap]) == {"predicted", "lost"}
    predicted = tracked.status == "predicted"
    assert np.isnan(tracked.angles_raw[predicted]).all()
    assert np.isnan(tracked.fitted_joints[predicted]).all()
    assert np.isfinite(tracked.angles[predicted]).all()
    assert np.isfinite(tracked.filtered_joints[predicted]).all()
    variance = tracked.angle_variance[predicted]
    if tracked.settings["filter"] == "one-euro":
        assert np.isinf(variance).all()
    else:
        # known less and less
        assert np.isfinite(variance).all()
        assert variance.mean() > 2 * tracked.angle_variance[tracked.status == "fitted"].mean()
    assert np.isnan(tracked.filtered_joints[tracked.status == "lost"]).all()


@pytest.mark.parametrize("coast_s", [0.0, 0.1, 10.0])
def test_how_long_a_filter_predicts_is_a_setting(coast_s, sample):
    track = ht.track(sample, filter="kalman", coast_s=coast_s)
    gap = track.status[200:210]
    predicted = int((gap == "predicted").sum())
    assert predicted == min(10, int(coast_s * 30))
    assert (gap[:predicted] == "predicted").all()
    assert track.status[210] == "fitted"


def test_it_recovers_from_a_gap_in_which_everything_changed(sample):
    """The hand comes back elsewhere, turned round and in another pose."""
    model = ht.calibrate(ht.HandModel.default("right"), sample).model
    tracker = ht.Tracker(model)
    truth = sample.truth
    assert truth is not None
    for t in range(30):
        tracker.step(truth[t], t * FRAME_NS)
    assert tracker.step(np.full((21, 3), np.nan), 30 * FRAME_NS).status == "lost"
    turn = about_axis(np.array([0.6, 0.8, 0.0]), np.array(3.0))
    elsewhere = truth[50] @ turn.T + [2.0, -1.0, 0.5]
    back = tracker.step(elsewhere, 31 * FRAME_NS)
    assert back.status == "fitted"
    assert np.linalg.norm(back.fitted_joints - elsewhere, axis=1).mean() < 0.004
    alone = ht.Tracker(model).step(elsewhere, 0)
    np.testing.assert_allclose(back.fitted_joints, alone.fitted_joints, atol=1e-4)


def test_nothing_seen_is_an_ordinary_frame(sample):
    nothing = np.full((21, 3), np.nan)
    for name in FILTERS:
        tracker = ht.Tracker(ht.HandModel.default(), filter=name)
        for t in range(3):
            frame = tracker.step(nothing, t)
            assert (frame.status, frame.iterations) == ("lost", 0)
        assert tracker.step(sample.joints[0], 3).status == "fitted"
        no_weight = tracker.step(sample.joints[1], FRAME_NS, np.zeros(21))
        assert no_weight.status == ("lost" if name == "none" else "predicted")
        assert no_weight.reason == "0 of 21 joints observed, 6 needed"


def test_a_joint_with_a_missing_coordinate_is_missing(sample):
    half, none = sample.joints[0].copy(), sample.joints[0].copy()
    half[7, 1] = np.nan
    none[7] = np.nan
    a, b = (ht.Tracker(ht.HandModel.default()).step(x, 0) for x in (half, none))
    for field in fields(TrackedFrame):
        same(getattr(a, field.name), getattr(b, field.name))
    assert a.confidence[7] == 0


def test_joints_on_a_line_are_told(sample):
    line = np.zeros((21, 3))
    line[:, 0] = np.arange(21) * 0.01
    frame = ht.Tracker(ht.HandModel.default()).step(line, 0)
    assert frame.reason == "the observed joints lie on a line"


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("late", [FRAME_NS, FRAME_NS - 1, -5])
def test_time_that_goes_back_is_refused_and_changes_nothing(name, late, sample):
    tracker, other = (ht.Tracker(ht.HandModel.default(), filter=name) for _ in range(2))
    for t in range(2):
        tracker.step(sample.joints[t], t * FRAME_NS)
        other.step(sample.joints[t], t * FRAME_NS)
    with pytest.raises(ht.InputError, match=r"time does not increase: .* 0\.033333 s"):
        tracker.step(sample.joints[2], late)
    a, b = (x.step(sample.joints[2], 2 * FRAME_NS) for x in (tracker, other))
    for field in fields(TrackedFrame):
        same(getattr(a, field.name), getattr(b, field.name))


@pytest.mark.parametrize(
    ("joints", "confidence", "message"),
    [
        (np.zeros((20, 3)), None, r"joints have shape \(20, 3\), expected \(21, 3\)"),
        (np.full((21, 3), np.inf), None, "a joint is infinite"),
        (np.zeros((21, 3)), np.ones(20), r"confidence\) have shape \(20,\)"),
        (np.zeros((21, 3)), np.full(21, -1.0), "negative or not finite"),
        (np.zeros((21, 3)), np.full(21, np.nan), "negative or not finite"),
    ],
)
def test_what_is_no_frame_is_refused(joints, confidence, message, sample):
    tracker = ht.Tracker(ht.HandModel.default())
    tracker.step(sample.joints[0], 0)
    with pytest.raises(ht.InputError, match=message):
        tracker.step(joints, 1, confidence)
    assert tracker.step(sample.joints[1], 1).status == "fitted"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"filter": "x"}, "filter 'x' is unknown, expected one of none, kalman"),
        ({"filter": "fixed-lag", "lag": -1}, "lag is -1"),
        ({"filter": "kalman", "noise_mm": 0.0}, "noise_mm is 0.0"),
        ({"engine": "x"}, "engine 'x' is unknown"),
        ({"update": "x"}, "update 'x' is unknown"),
        ({"min_joints": 2}, "min_joints is 2"),
        ({"min_joints": 22}, "min_joints is 22"),
        ({"coast_s": -1.0}, "coast_s"),
        ({"coast_s": float("nan")}, "coast_s"),
        ({"filter": "kalman", "process_noise": 0.0}, "process noise"),
    ],
)
def test_settings_that_make_no_sense(settings, message, sample):
    with pytest.raises(ht.SettingsError, match=message):
        ht.Tracker(ht.HandModel.default(), **settings)
    with pytest.raises(ht.SettingsError, match=message):
        ht.track(sample, **settings)


def test_a_model_of_the_other_hand_is_refused(sample):
    with pytest.raises(ht.InputError, match="the model is a left hand, the sequence a right one"):
        ht.track(sample, ht.HandModel.default("left"))
