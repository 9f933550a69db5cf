"""What belongs to one hand is not written as another's."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_tracks import make_track
from recording_checks import differences

import handtrack as ht
from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.recording.read import read_mcap
from handtrack.recording.recorder import McapRecorder
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Event, Track


def other(change: str, track: Track) -> Track:
    """The next frames of a track, with something that is not of it."""
    part = dataclasses.replace(track, time_ns=track.time_ns + 10**11, events=())
    if change == "side":
        return dataclasses.replace(part, hand="left", model=ht.HandModel.default("left"))
    if change == "model":
        return dataclasses.replace(part, model=ht.HandModel.default("right", shape=[1.0]))
    if change == "limits":
        return dataclasses.replace(part, model=ht.HandModel.default("right", "li2021"))
    if change == "settings":
        return dataclasses.replace(part, settings={"filter": "none"})
    return dataclasses.replace(part, truth=None)


@pytest.mark.parametrize("change", ["side", "model", "limits", "settings", "truth"])
def test_a_stretch_of_another_hand_is_refused(change: str, tmp_path: Path) -> None:
    track = make_track(40, skin=False)
    path = tmp_path / "a.mcap"
    with McapRecorder(path, hands=[(track.name, "right"), (track.name, "left")]) as recorder:
        recorder.add(track)
        with pytest.raises(InputError):
            recorder.add(other(change, track))
    (read,) = read_mcap(path)
    assert differences(track, read) == []


def test_a_right_hand_in_a_left_hands_place(tmp_path: Path) -> None:
    track = make_track(5)
    with McapRecorder(tmp_path / "a.mcap", hands=[("a", "left"), ("b", "right")]) as recorder:
        with pytest.raises(InputError, match=r"sample is a right hand, its place is .* a left one"):
            recorder.add(track, 0)
        recorder.add(track, 1)
    (read,) = read_mcap(tmp_path / "a.mcap")
    assert (read.hand, len(read)) == ("right", 5)


def test_two_people_exchanged(tmp_path: Path) -> None:
    a, b = (make_track(5, name=name) for name in "ab")
    with McapRecorder(tmp_path / "a.mcap", hands=[("a", "right"), ("b", "right")]) as recorder:
        with pytest.raises(InputError, match="b was given the place of a"):
            recorder.add(b, 0)
        recorder.add(a, 0)
        recorder.add(b, 1)
    assert [t.name for t in read_mcap(tmp_path / "a.mcap")] == ["a", "b"]


def test_frames_of_left_and_right_exchanged(sample: ht.Sequence, tmp_path: Path) -> None:
    """Frame by frame, as a live recording does."""
    models = [ht.HandModel.default(side) for side in ("left", "right")]
    models.append(ht.HandModel.default("right", shape=[0.5]))
    trackers = [ht.Tracker(model) for model in models]
    joints = [sample.joints * [1, -1, 1], sample.joints, sample.joints]
    names = ["left", "right", "other"]
    with McapRecorder(tmp_path / "a.mcap", models, names=names) as recorder:
        for t in range(5):
            time_ns = int(sample.time_ns[t])
            made = [
                tracker.step(x[t], time_ns) for tracker, x in zip(trackers, joints, strict=True)
            ]
            for hand in range(3):
                wrong = made[(hand + 1) % 3]
                with pytest.raises(InputError, match=r"was not fitted with the (left|right) hand"):
                    recorder.write(wrong, hand)
            for hand, frame in enumerate(made):
                recorder.write(frame, hand)
        nothing = trackers[0].step(np.full((21, 3), np.nan), 10**12)
        recorder.write(nothing, 1)  # what is lost has no shape
    tracks = read_mcap(tmp_path / "a.mcap")
    assert sorted((t.name, t.hand, len(t)) for t in tracks) == [
        ("left", "left", 5),
        ("other", "right", 5),
        ("right", "right", 6),
    ]


@pytest.mark.parametrize("hand", [-1, 2, 10])
def test_a_place_that_there_is_not(hand: int, tmp_path: Path) -> None:
    track = make_track(5)
    hands = [("a", "right"), ("b", "left")]
    with McapRecorder(tmp_path / "a.mcap", hands=hands) as recorder:
        recorder.add(track)
        calls: list[Callable[[], None]] = [
            lambda: recorder.add(track, hand),
            lambda: recorder.event(Event(0, "info", "x"), hand),
        ]
        for call in calls:
            with pytest.raises(SettingsError, match=f"hand {hand} of 2"):
                call()


def test_a_model_of_the_other_side_is_not_written(tmp_path: Path) -> None:
    track = dataclasses.replace(make_track(5), hand="left")
    with pytest.raises(SettingsError, match="a left hand with a right hand's model"):
        write_mcap(track, tmp_path / "a.mcap")
    assert list(tmp_path.iterdir()) == []


def test_what_is_said_after_the_last_frame_is_kept(tmp_path: Path) -> None:
    track = make_track(20, skin=False)
    with McapRecorder(tmp_path / "a.mcap", hands=[(track.name, "right")]) as recorder:
        recorder.add(track)
        recorder.event(Event(int(track.time_ns[-1]), "warning", "the camera is gone"))
    (read,) = read_mcap(tmp_path / "a.mcap")
    assert read.events[-1].text == "the camera is gone"
    assert len(read) == 20


@pytest.mark.parametrize("first", ["recorder", "at once"])
def test_two_writers_of_one_file_lose_nothing(first: str, tmp_path: Path) -> None:
    a, b = make_track(20, seed=1, skin=False), make_track(30, seed=2, skin=False)
    path = tmp_path / "a.mcap"
    recorder = McapRecorder(path, hands=[(a.name, "right")])
    recorder.add(a)
    if first == "at once":
        write_mcap(b, path)
    else:
        with McapRecorder(path, hands=[(b.name, "right")]) as second:
            second.add(b)
    with pytest.raises(HandtrackError, match="something else has written this file") as told:
        recorder.close()
    assert len(read_mcap(path)[0]) == 30
    assert str(told.value).endswith(str(recorder.part))
    assert differences(a, read_mcap(recorder.part)[0]) == []


def test_closing_twice_and_after_the_end(tmp_path: Path) -> None:
    track = make_track(5, skin=False)
    recorder = McapRecorder(tmp_path / "a.mcap", hands=[(track.name, "right")])
    recorder.add(track)
    content = recorder.close().read_bytes()
    assert recorder.close() == recorder.close() == tmp_path / "a.mcap"
    recorder.stop()
    for call in (recorder.flush, lambda: recorder.add(track)):
        with pytest.raises(SettingsError, match="the recording is closed"):
            call()
    assert (tmp_path / "a.mcap").read_bytes() == content
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]


def test_a_failure_is_not_forgotten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who ignores that writing failed hears of it again when the recording is closed."""
    track = make_track(5, skin=False)
    recorder = McapRecorder(tmp_path / "a.mcap", hands=[(track.name, "right")])

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("handtrack.recording.write.RecordingWriter.add", full)
    for call in (lambda: recorder.add(track), recorder.close, recorder.close):
        with pytest.raises(HandtrackError, match="No space left on device"):
            call()
    assert recorder.closed


def test_a_callback_that_fails_leaves_nothing_behind(sample: ht.Sequence) -> None:
    """`on_part` and `progress` raise: the next run is as if there had been none."""
    short = sample.frames(0, 60)
    model = ht.HandModel.default()
    expected = ht.track(short, model, calibrate=False, filter="rts")

    def fails(_: object) -> None:
        raise RuntimeError("enough")

    for hooks in ({"on_part": fails}, {"progress": fails}):
        with pytest.raises(RuntimeError, match="enough"):
            ht.track(short, model, calibrate=False, filter="rts", **hooks)  # type: ignore[arg-type]
        again = ht.track(short, model, calibrate=False, filter="rts")
        assert differences(expected, again) == []
