"""What a tracker takes and gives, frame by frame."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from tracked_clip import FILTERS, WAITING, same, stream

import handtrack as ht
from handtrack.hand.rotations import about_axis, quaternion_to_matrix, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES
from handtrack.mcap.state import Stretch
from handtrack.tracking.frame import TrackedFrame


@pytest.mark.parametrize("name", FILTERS)
def test_arguments_stay_as_they_are(name, long):
    model = ht.HandModel.default("right")
    arrays = {f.name: getattr(model, f.name) for f in fields(model)}
    before = {k: v.copy() for k, v in arrays.items() if isinstance(v, np.ndarray)}
    tracker = ht.Tracker(model, filter=name)
    for t in range(90, 110):
        joints, confidence = long.joints[t].copy(), long.confidence[t].copy()
        tracker.step(joints, int(long.time_ns[t]), confidence)
        same(joints, long.joints[t])
        same(confidence, long.confidence[t])
    for key, value in before.items():
        same(getattr(model, key), value)
    copies = long.joints.copy(), long.confidence.copy()
    ht.track(long.frames(7, 40), model, filter=name)
    same(long.joints, copies[0])
    same(long.confidence, copies[1])


@pytest.mark.parametrize("name", FILTERS)
def test_results_stay_as_they_are(name, long):
    """What a step returned does not change with the next ones."""
    tracker = ht.Tracker(ht.HandModel.default(), filter=name)
    frames, copies = [], []
    for t in range(50, 130):
        frame = tracker.step(long.joints[t], int(long.time_ns[t]), long.confidence[t])
        frames.append(frame)
        copies.append({f.name: np.array(getattr(frame, f.name)) for f in fields(frame)})
    for frame, copy in zip(frames, copies, strict=True):
        for key, value in copy.items():
            same(getattr(frame, key), value)


def test_joints_may_be_any_array_like(sample):
    joints = sample.joints[0]
    expected = ht.Tracker(ht.HandModel.default()).step(joints, 0)
    fortran = np.asfortranarray(joints)
    strided = np.repeat(joints, 2, axis=0)[::2]
    for given in (joints.tolist(), fortran, strided):
        frame = ht.Tracker(ht.HandModel.default()).step(given, np.int64(0), [1.0] * 21)
        same(frame.angles, expected.angles)


def test_shapes_and_types(tracked, long):
    n = len(long)
    shapes = {
        "time_ns": (n,),
        "frame_index": (n,),
        "observed": (n, 21, 3),
        "confidence": (n, 21),
        "angles_raw": (n, N_ANGLES),
        "angles": (n, N_ANGLES),
        "quaternion_raw": (n, 4),
        "quaternion": (n, 4),
        "translation_raw": (n, 3),
        "translation": (n, 3),
        "fitted_joints": (n, 21, 3),
        "filtered_joints": (n, 21, 3),
        "angle_variance": (n, N_ANGLES),
        "objective": (n,),
        "iterations": (n,),
        "status": (n,),
        "reason": (n,),
    }
    for name, shape in shapes.items():
        assert getattr(tracked, name).shape == shape, name
    assert (
        tracked.time_ns.dtype == tracked.frame_index.dtype == tracked.iterations.dtype == np.int64
    )
    assert tracked.angles.dtype == tracked.fitted_joints.dtype == np.float64
    same(tracked.time_ns, long.time_ns)
    same(tracked.frame_index, long.frame_index)
    same(tracked.observed, long.joints)
    same(tracked.confidence, long.confidence)
    assert len(tracked) == n
    assert tracked.vertices(slice(20, 23)).shape == (3, len(tracked.model.rest_vertices), 3)


def test_poses_joints_and_errors_belong_together(tracked):
    model = tracked.model
    from handtrack.hand.rotations import quaternion_to_matrix

    for suffix, joints in (("_raw", tracked.fitted_joints), ("", tracked.filtered_joints)):
        known = np.isfinite(joints).all((1, 2))
        angles, q, x = (
            getattr(tracked, f"{name}{suffix}")[known]
            for name in ("angles", "quaternion", "translation")
        )
        assert model.limits.contains(angles, 1e-7).all()
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-12)
        again = model.joints(angles, quaternion_to_matrix(q), x)
        np.testing.assert_allclose(again, joints[known], atol=1e-12)
    fitted = tracked.status == "fitted"
    squares = tracked.confidence[..., None] * (tracked.observed - tracked.fitted_joints) ** 2
    objective = np.nansum(squares, axis=(1, 2))
    np.testing.assert_allclose(tracked.objective[fitted], objective[fitted], rtol=1e-9, atol=1e-12)
    assert (tracked.iterations[fitted] > 0).all()
    assert (tracked.angle_variance[fitted] >= 0).all()


def test_unfiltered_and_filtered_are_the_same_without_a_filter(sample):
    track = ht.track(sample)
    assert not track.filtered
    same(track.angles, track.angles_raw)
    same(track.quaternion, track.quaternion_raw)
    same(track.translation, track.translation_raw)
    same(track.filtered_joints, track.fitted_joints)


def test_raw_fits_do_not_depend_on_the_filter(sample):
    none, *others = (ht.track(sample, filter=name) for name in FILTERS + WAITING)
    for other in others:
        assert other.filtered
        for name in (
            "angles_raw",
            "quaternion_raw",
            "translation_raw",
            "fitted_joints",
            "iterations",
        ):
            same(getattr(other, name), getattr(none, name))


def test_events_tell_of_every_change(tracked, long):
    changes = [(long.time_ns[0], tracked.status[0])] + [
        (long.time_ns[t], tracked.status[t])
        for t in range(1, len(long))
        if tracked.status[t] != tracked.status[t - 1]
    ]
    assert [(e.time_ns, e.text.partition(":")[0]) for e in tracked.events] == changes
    for event in tracked.events:
        assert event.level == ("info" if event.text.startswith("fitted") else "warning")
        assert "\n" not in event.text
    assert tracked.events[0].text == "lost: 0 of 21 joints observed, 6 needed"


def test_what_the_reader_noted_is_the_first_event(sample):
    noted = replace(sample, notes=("the unit is a guess",))
    first = ht.track(noted.frames(0, 20)).events[0]
    assert (first.time_ns, first.level, first.text) == (0, "warning", "the unit is a guess")


def test_a_track_says_what_made_it(sample):
    limits = ht.HandModel.default("right", "li2021")
    track = ht.track(sample.frames(0, 60), limits, calibrate=False, filter="kalman", coast_s=0.2)
    assert track.settings["limits"] == "li2021"
    assert (track.settings["filter"], track.settings["calibrate"]) == ("kalman", False)
    assert (track.settings["coast_s"], track.settings["update"]) == (0.2, "exact")
    assert track.version == ht.__version__
    assert (track.name, track.hand, track.source) == ("sample", "right", sample.source)
    assert track.subject == sample.subject
    same(track.truth, sample.truth[:61])


def test_progress_counts_frames(long):
    seen: list[int] = []
    ht.track(long, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == len(long)


def test_a_left_hand_is_the_mirror_image_of_a_right_one(sample):
    mirror = np.array([-1.0, 1.0, 1.0])
    left = replace(sample, joints=sample.joints * mirror, hand="left", truth=None)
    a, b = ht.track(sample), ht.track(left)
    np.testing.assert_allclose(a.angles, b.angles, atol=2e-4)
    np.testing.assert_allclose(a.fitted_joints * mirror, b.fitted_joints, atol=2e-5)


def test_confidence_is_a_weight(sample):
    """A joint that is far off and hardly trusted bends the hand less."""
    joints = sample.joints[20].copy()
    assert np.isfinite(joints).all()
    joints[8] += [0.0, 0.05, 0.05]
    model = ht.calibrate(ht.HandModel.default(), sample).model
    doubt = np.ones(21)
    doubt[8] = 0.01
    trusted, doubted = (ht.Tracker(model, gate=False).step(joints, 0, c) for c in (None, doubt))
    others = np.arange(21) != 8
    error = [
        np.linalg.norm(f.fitted_joints - sample.truth[20], axis=1)[others].mean()
        for f in (trusted, doubted)
    ]
    assert error[1] < 0.8 * error[0]


def test_the_parts_of_a_track_are_the_track(tracked, long):
    parts: list[Stretch] = []
    ht.track(
        replace(long, notes=("a note",)), filter=tracked.settings["filter"], on_part=parts.append
    )
    assert len(parts) > 1
    for field in fields(ht.Track):
        whole = getattr(tracked, field.name)
        values = [getattr(part, field.name, None) for part in parts]
        if field.name == "events":
            assert values[0][0].text == "a note"
            assert sum(values, ())[1:] == whole
        elif isinstance(whole, np.ndarray):
            np.testing.assert_array_equal(np.concatenate(values), whole)


def test_quaternions_are_the_rotations(sample):
    """Whichever component is the largest."""
    model = ht.HandModel.default("right")
    for vector in ((0, 0, 0), (3.1, 0, 0), (0, 3.1, 0.1), (0.1, 0, 3.1), (2, 2, -1), (-2, 0.1, 2)):
        turn = vector_to_matrix(np.array(vector, dtype=float))
        joints = model.joints(model.mean_angles, turn, [0.1, 0.2, 0.3])
        frame = ht.Tracker(model).step(joints, 0)
        np.testing.assert_allclose(quaternion_to_matrix(frame.quaternion), turn, atol=1e-5)
        assert frame.quaternion[0] >= 0
        assert np.linalg.norm(frame.quaternion) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("filter", FILTERS + WAITING)
def test_after_an_hour_it_starts_anew(filter, sample):
    """No frame in between says that the hand was lost; the stamps do."""
    time_ns = sample.time_ns.copy()
    time_ns[150:] += 3600 * 10**9
    turn = about_axis(np.array([0.6, 0.8, 0.0]), np.array(2.5))
    joints = sample.truth.copy()
    joints[150:] = joints[150:] @ turn.T + [5.0, 0.0, 0.0]
    track = ht.track(ht.Sequence(time_ns, joints), filter=filter)
    assert (track.status == "fitted").all()
    assert np.flatnonzero(track.restart).tolist() == [150]
    assert [e.text for e in track.events] == ["fitted", "found again after 3600.03 s"]
    off = np.linalg.norm(track.filtered_joints - joints, axis=-1)
    assert off[150:].max() < off[:150].max() + 0.02


@pytest.mark.parametrize("name", FILTERS)
def test_what_a_frame_holds_cannot_change_the_next(name, sample):
    """The gate and the filters go on from arrays that were given out: they can only be read."""
    model = ht.HandModel.default()
    touched, apart = (ht.Tracker(model, filter=name) for _ in range(2))
    for t in range(40):
        frame = touched.step(sample.joints[t], int(sample.time_ns[t]))
        expected = apart.step(sample.joints[t], int(sample.time_ns[t]))
        for field in fields(TrackedFrame):
            value = getattr(frame, field.name)
            same(value, getattr(expected, field.name))
            if isinstance(value, np.ndarray):
                with pytest.raises(ValueError, match="read-only"):
                    value *= 1000


@pytest.mark.parametrize("name", WAITING)
def test_frames_that_come_later_can_only_be_read_either(name, sample):
    tracker = ht.Tracker(ht.HandModel.default(), filter=name)
    frames = [f for t in range(12) for f in tracker.push(sample.joints[t], int(sample.time_ns[t]))]
    for frame in frames + tracker.finish():
        arrays = [getattr(frame, field.name) for field in fields(TrackedFrame)]
        assert not any(a.flags.writeable for a in arrays if isinstance(a, np.ndarray))


def test_arrays_of_a_track_can_only_be_read(sample):
    parts: list[Stretch] = []
    track = ht.track(sample.frames(0, 40), on_part=parts.append)
    for of in (track, *parts, replace(track, name="b")):
        arrays = [getattr(of, field.name) for field in fields(of)]
        assert not any(a.flags.writeable for a in arrays if isinstance(a, np.ndarray))


@pytest.mark.parametrize("name", [*FILTERS, *WAITING])
def test_a_frame_that_is_refused_leaves_no_trace(name, sample):
    model = ht.HandModel.default()
    disturbed, apart = (ht.Tracker(model, filter=name) for _ in range(2))
    infinite = np.full((21, 3), np.inf)
    negative = np.full(21, -1.0)
    frames, expected = [], []
    for t in range(20):
        joints, time_ns = sample.joints[t], int(sample.time_ns[t])
        for wrong in ((infinite, time_ns), (joints, time_ns, negative), (joints[:5], time_ns)):
            with pytest.raises(ht.InputError):
                disturbed.push(*wrong)
        frames += disturbed.push(joints, time_ns)
        with pytest.raises(ht.InputError):
            disturbed.push(joints, time_ns)
        expected += apart.push(joints, time_ns)
    frames += disturbed.finish()
    expected += apart.finish()
    for a, b in zip(frames, expected, strict=True):
        for field in fields(TrackedFrame):
            same(getattr(a, field.name), getattr(b, field.name))


@pytest.mark.parametrize("name", ["_learnt", "_smoothed"])
def test_a_smoother_that_is_stopped_is_as_new(name, sample, monkeypatch):
    """Ctrl-C while it smooths: its settings and its frames are not those of the run before."""
    from handtrack.tracking.smoothers import Smoother

    def stopped(self: Smoother, frames: object) -> None:
        raise KeyboardInterrupt

    tracker = ht.Tracker(ht.HandModel.default(), filter="rts")
    expected = stream(ht.Tracker(ht.HandModel.default(), filter="rts"), sample.frames(0, 60))
    with monkeypatch.context() as patch:
        patch.setattr(Smoother, name, stopped)
        for t in range(80, 100):
            tracker.push(sample.joints[t], int(sample.time_ns[t]))
        with pytest.raises(KeyboardInterrupt):
            tracker.finish()
    # frames of another time, as it goes on without a reset
    later = replace(sample, time_ns=sample.time_ns + 10**11).frames(0, 60)
    again = [replace(frame, time_ns=frame.time_ns - 10**11) for frame in stream(tracker, later)]
    tracker.reset()
    for a, b in zip(stream(tracker, sample.frames(0, 60)), expected, strict=True):
        for field in fields(TrackedFrame):
            same(getattr(a, field.name), getattr(b, field.name))
    assert [frame.time_ns for frame in again] == [frame.time_ns for frame in expected]
    for a, b in zip(again[5:], expected[5:], strict=True):
        same(a.observed, b.observed)
        np.testing.assert_allclose(a.fitted_joints, b.fitted_joints, atol=2e-3)
