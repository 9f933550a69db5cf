"""Recordings written as they happen: equal to those written at once, whatever stops the writer."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_tracks import make_track, with_skin
from recording_checks import differences, messages

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.hand.model import HandModel
from handtrack.recording.read import follow_mcap, read_mcap
from handtrack.recording.recorder import McapRecorder
from handtrack.recording.write import write_mcap
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.track import Event, Track

FRAME = [field.name for field in dataclasses.fields(TrackedFrame)]


def frames_of(track: Track) -> list[TrackedFrame]:
    columns = [getattr(track, name) for name in FRAME]
    return [
        TrackedFrame(**dict(zip(FRAME, row, strict=True))) for row in zip(*columns, strict=True)
    ]


def part_of(track: Track, frames: slice) -> Track:
    arrays = {
        field.name: getattr(track, field.name)[frames]
        for field in dataclasses.fields(Track)
        if isinstance(getattr(track, field.name), np.ndarray)
    }
    return dataclasses.replace(track, events=(), **arrays)


def record(recorder: McapRecorder, track: Track, hand: int = 0) -> None:
    truth = [None] * len(track) if track.truth is None else list(track.truth)
    for i, frame in enumerate(frames_of(track)):
        for event in track.events:
            if event.time_ns == frame.time_ns:
                recorder.event(event, hand)
        recorder.write(frame, hand, frame_index=int(track.frame_index[i]), truth=truth[i])


def test_frame_by_frame_equals_at_once(track: Track, tmp_path: Path) -> None:
    about: dict[str, Any] = {"settings": track.settings, "source": track.source}
    about |= {"subject": track.subject, "names": [track.name]}
    with McapRecorder(tmp_path / "a.mcap", track.model, **about) as recorder:
        record(recorder, track)
    assert recorder.path.name == "a.mcap"
    assert os.listdir(tmp_path) == ["a.mcap"]
    (read,) = read_mcap(tmp_path / "a.mcap")
    assert differences(track, read) == []
    whole = messages(write_mcap(track, tmp_path / "b.mcap"))
    stream = messages(tmp_path / "a.mcap")
    assert {topic: [m[::2] for m in rows] for topic, rows in stream.items()} == {
        topic: [m[::2] for m in rows] for topic, rows in whole.items()
    }


def test_stretches_of_several_hands_one_after_another(
    two_hands: list[Track], tmp_path: Path
) -> None:
    names = [(t.name, t.hand) for t in two_hands]
    with McapRecorder(tmp_path / "a.mcap", hands=names) as recorder:
        for hand, track in enumerate(two_hands):
            for start in range(0, len(track), 16):
                part = part_of(track, slice(start, start + 16))
                recorder.add(
                    dataclasses.replace(part, events=track.events if not start else ()), hand
                )
    read = read_mcap(tmp_path / "a.mcap")
    assert [differences(a, b) for a, b in zip(two_hands, read, strict=True)] == [[], []]


def test_hands_that_take_turns(two_hands: list[Track], tmp_path: Path) -> None:
    models = [t.model for t in two_hands]
    path = tmp_path / "a.mcap"
    with McapRecorder(path, models, mesh="none", settings=two_hands[0].settings) as recorder:
        for a, b in zip(*map(frames_of, two_hands), strict=False):
            recorder.write(a, 0)
            recorder.write(b, 1)
    right, left = read_mcap(path)
    assert (right.hand, left.hand, len(right), len(left)) == ("right", "left", 40, 40)
    np.testing.assert_array_equal(left.angles, two_hands[1].angles[:40])
    assert left.truth is None
    assert left.frame_index.tolist() == list(range(40))


def test_no_second_waits_and_no_chunk_is_longer(track: Track, tmp_path: Path) -> None:
    """At any moment all but the last second is in the file."""
    recorder = McapRecorder(tmp_path / "a.mcap", track.model, mesh="none")
    for i, frame in enumerate(frames_of(track)):
        recorder.write(frame)
        if i >= 30:
            with pytest.warns(UserWarning, match="ends in the middle"):
                (read,) = read_mcap(recorder.part)
            assert frame.time_ns - int(read.time_ns[-1]) <= 1_000_000_000
    recorder.close()


def test_real_time_counts_too(
    track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr("handtrack.recording.recorder.time.monotonic", lambda: now)
    recorder = McapRecorder(tmp_path / "a.mcap", track.model, mesh="none")
    frames = frames_of(track)
    recorder.write(frames[0])
    assert recorder.part.stat().st_size == 0
    now = 1.0
    recorder.write(frames[1])
    with pytest.warns(UserWarning, match="read 2 whole frames"):
        read_mcap(recorder.part)


def fail_after(recorder: McapRecorder, track: Track) -> None:
    """Record, and leave the block by an error."""
    with suppress(ZeroDivisionError), recorder:
        record(recorder, track)
        raise ZeroDivisionError


def test_an_error_keeps_what_was_recorded(track: Track, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"yesterday")
    with pytest.warns(UserWarning, match=r"a\.mcap\.part holds the 60 frames"):
        fail_after(McapRecorder(path, track.model), dataclasses.replace(track, events=()))
    assert path.read_bytes() == b"yesterday"
    with pytest.warns(UserWarning, match="read 60 whole frames"):
        (read,) = read_mcap(tmp_path / "a.mcap.part")
    np.testing.assert_array_equal(read.angles, track.angles)


def test_an_error_before_the_first_frame_leaves_nothing(track: Track, tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), McapRecorder(tmp_path / "a.mcap", track.model):
        raise ZeroDivisionError
    assert os.listdir(tmp_path) == []


def test_a_part_of_an_earlier_run_is_kept(track: Track, tmp_path: Path) -> None:
    (tmp_path / "a.mcap.part").write_bytes(b"what a killed run left")
    with McapRecorder(tmp_path / "a.mcap", track.model) as recorder:
        assert recorder.part.name == "a.mcap.2.part"
        record(recorder, track)
    assert sorted(os.listdir(tmp_path)) == ["a.mcap", "a.mcap.part"]
    assert (tmp_path / "a.mcap.part").read_bytes() == b"what a killed run left"


KILLED = """
import sys, time
sys.path[:0] = {tests!r}
from test_recorder import frames_of, make_track
from handtrack.recording.recorder import McapRecorder
recorder = McapRecorder({path!r}, (track := make_track(200)).model)
for i, frame in enumerate(frames_of(track)):
    recorder.write(frame)
    print(i, flush=True)
time.sleep(60)
"""


def test_kill_9(tmp_path: Path) -> None:
    code = KILLED.format(
        tests=[str(p) for p in Path(__file__).parents[:2]], path=str(tmp_path / "a.mcap")
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for line in child.stdout:
            if int(line) == 150:
                child.send_signal(signal.SIGKILL)
                break
        child.wait()
    with pytest.warns(UserWarning, match="ends in the middle"):
        (read,) = read_mcap(tmp_path / "a.mcap.part")
    track = make_track(200)
    assert len(read) >= 150 - 30
    np.testing.assert_array_equal(read.angles, track.angles[: len(read)])


class FullDisk:
    """A stream that takes so many bytes and no more."""

    def __init__(self, stream: Any, room: int) -> None:
        self._stream, self._room = stream, room

    def write(self, data: bytes) -> int:
        self._stream.write(data[: self._room])
        self._room -= len(data)
        if self._room < 0:
            self._room = 0
            raise OSError(28, "No space left on device")
        return len(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def test_a_full_disk_keeps_what_fitted(tmp_path: Path) -> None:
    track = make_track(skin=False)
    recorder = McapRecorder(tmp_path / "a.mcap", track.model, mesh="none")
    recorder._file.stream = FullDisk(recorder._file.stream, 150_000)
    with pytest.raises(HandtrackError, match=r"No space left on device; .*a.mcap.part holds"):
        record(recorder, track)
    with pytest.raises(SettingsError, match="is closed"):
        recorder.write(frames_of(track)[0])
    recorder.stop()
    with pytest.warns(UserWarning, match="ends in the middle"):
        (read,) = read_mcap(recorder.part)
    assert 0 < len(read) < len(track)
    np.testing.assert_array_equal(read.angles, track.angles[: len(read)])


def test_a_disk_that_is_full_amid_a_long_stretch(tmp_path: Path) -> None:
    track = make_track(200, skin=False)
    recorder = McapRecorder(tmp_path / "a.mcap", hands=[("sample", "right")])
    recorder._file.stream = FullDisk(recorder._file.stream, 300_000)
    with pytest.raises(HandtrackError, match="No space left on device") as caught:
        recorder.add(track)
    with pytest.warns(UserWarning, match="ends in the middle"):
        (read,) = read_mcap(recorder.part)
    assert f"holds the {len(read)} frames until then" in str(caught.value)
    assert 0 < len(read) < len(track)


def test_a_disk_that_is_full_from_the_start_leaves_nothing(track: Track, tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap", track.model)
    recorder._file.stream = FullDisk(recorder._file.stream, 100)
    with pytest.raises(HandtrackError, match=r"No space left on device$"):
        record(recorder, track)
    assert os.listdir(tmp_path) == []


def test_what_makes_no_sense_is_refused(track: Track, tmp_path: Path) -> None:
    path, frames = tmp_path / "a.mcap", frames_of(track)
    with pytest.raises(SettingsError, match="needs hand models"):
        McapRecorder(path)
    with pytest.raises(SettingsError, match="2 names for 1 hands"):
        McapRecorder(path, track.model, names=["a", "b"])
    with pytest.raises(SettingsError, match="every N"):
        McapRecorder(path, track.model, mesh="half")
    with pytest.raises(InputError, match="no folder"):
        McapRecorder(tmp_path / "nowhere" / "a.mcap", track.model)
    assert os.listdir(tmp_path) == []
    recorder = McapRecorder(path, track.model)
    with pytest.raises(SettingsError, match="does not increase"):
        recorder.add(part_of(track, slice(9, 3, -1)))
    recorder.write(frames[3])
    with pytest.raises(SettingsError, match="does not increase"):
        recorder.write(frames[2])
    with pytest.raises(InputError, match="with all frames"):
        recorder.write(frames[4], truth=np.zeros((21, 3)))
    with pytest.warns(UserWarning, match="holds the 1 frame that"):
        recorder.stop()
    with pytest.raises(SettingsError, match="is closed"):
        recorder.write(frames[5])


def test_negative_times(tmp_path: Path) -> None:
    track = make_track(10, start_ns=-5_000_000_000, lost=slice(3, 5))
    with McapRecorder(tmp_path / "a.mcap", hands=[(track.name, "right")]) as recorder:
        recorder.add(track)
    assert differences(track, read_mcap(tmp_path / "a.mcap")[0]) == []
    early = dataclasses.replace(track, hand="left", model=HandModel.default("left"))
    late = dataclasses.replace(track, time_ns=track.time_ns + 1_000_000_000)
    hands = [("a", "right"), ("a", "left")]
    recorder = McapRecorder(tmp_path / "b.mcap", hands=hands)
    recorder.add(late)
    with pytest.raises(SettingsError, match="give start_ns"):
        recorder.add(early, 1)
    recorder.close()
    with McapRecorder(tmp_path / "c.mcap", hands=hands, start_ns=-5_000_000_000) as recorder:
        recorder.add(late)
        recorder.add(early, 1)
    assert len(read_mcap(tmp_path / "c.mcap")) == 2


def test_following_a_recording_while_it_is_written(track: Track, tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "a.mcap", track.model, mesh="none", names=["sample"])
    got: list[Track] = []

    def follow() -> None:
        got.extend(follow_mcap(recorder.part, poll_s=0.005, timeout_s=30))

    reader = threading.Thread(target=follow)
    reader.start()
    halves = np.array_split(np.arange(len(track)), 2)
    for half in halves:
        for frame in frames_of(part_of(track, slice(half[0], half[-1] + 1))):
            recorder.write(frame)
        recorder.flush()
        deadline = time.monotonic() + 30
        while sum(map(len, got)) <= half[-1] and time.monotonic() < deadline:
            time.sleep(0.005)
        assert sum(map(len, got)) == half[-1] + 1
    recorder.event(Event(int(track.time_ns[-1]), "info", "the end"))
    recorder.close()
    reader.join(30)
    assert not reader.is_alive()
    assert len(got) >= 2
    np.testing.assert_array_equal(np.concatenate([t.angles for t in got]), track.angles)


def test_following_gives_up_on_a_dead_writer(track: Track, tmp_path: Path) -> None:
    data = write_mcap(track, tmp_path / "a.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    read = list(follow_mcap(tmp_path / "cut.mcap", poll_s=0.001, timeout_s=0.01))
    assert 0 < sum(map(len, read)) < len(track)
    (tmp_path / "x.mcap").write_bytes(b"x" * 100)
    with pytest.raises(InputError, match="not an MCAP file"):
        list(follow_mcap(tmp_path / "x.mcap"))


def test_a_licensed_hand_keeps_its_skin_but_not_its_template(tmp_path: Path) -> None:
    model = dataclasses.replace(with_skin(HandModel.default("right")), licensed=True, name="mano")
    track = make_track(30, model=model)
    path = write_mcap(track, tmp_path / "a.mcap", compression="none", mesh="every 2")
    (read,) = read_mcap(path)
    np.testing.assert_array_equal(read.faces, model.faces)
    assert read.n_vertices == len(model.rest_vertices)
    expected = track.vertices().astype(np.float32)
    np.testing.assert_array_equal(read.vertices()[::2], expected[::2])
    assert np.isnan(read.vertices()[1::2]).all()
    data = path.read_bytes()
    for array in (model.rest_vertices, model.weights):
        assert array.tobytes()[:240] not in data
        assert array.astype(np.float32).tobytes()[:120] not in data
    # written again it is still all there
    again = read_mcap(write_mcap(read, tmp_path / "b.mcap"))[0]
    np.testing.assert_array_equal(again.vertices(), read.vertices())
