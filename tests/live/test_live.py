"""Tracking as it happens: what comes is tracked, recorded, counted; Ctrl-C leaves all whole."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import handtrack as ht
from handtrack.calibration.online import OnlineCalibration
from handtrack.cli import run
from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.live.lines import BadLines, LiveFrame, from_lines
from handtrack.live.live import run_live, size_of
from handtrack.live.sinks import RecorderSink
from handtrack.live.sources import Newest
from handtrack.recording.settings import RecordingSettings
from handtrack.sequences import joint_order
from handtrack.tracking.tracker import Tracker

RIGHT = ht.HandModel.default("right").scaled(0.9)
NO_MESH = RecordingSettings.of("none", "lz4", False)


def motion(n: int = 30) -> np.ndarray:
    angles = np.tile(RIGHT.mean_angles, (n, 1))
    angles[:, 4::4] += 0.3 * np.sin(np.arange(n) / 8)[:, None]
    return RIGHT.joints(RIGHT.limits.clamp(angles))


def frames(joints, missing=()):
    for t, x in enumerate(joints):
        seen = {} if t in missing else {"right": x}
        yield LiveFrame(t * 33_000_000, t, seen, {h: np.ones(21) for h in seen}, 0.0)


def tracker(hand, size):
    return Tracker(ht.HandModel.default(hand).scaled(size))


def test_what_comes_is_tracked_and_recorded(tmp_path):
    joints = motion()
    with RecorderSink(tmp_path / "live.mcap", "test", NO_MESH) as record:
        count = run_live(frames(joints, missing=(0, 7)), tracker, [record], dropped=lambda: 4)
    (track,) = ht.read_mcap(tmp_path / "live.mcap")
    assert (track.hand, track.source) == ("right", "test")
    # the hand begins with the first frame that shows it
    assert track.frame_index.tolist() == list(range(1, 30))
    assert track.status.tolist() == ["fitted"] * 6 + ["lost"] + ["fitted"] * 22
    plain = tracker("right", size_of(joints[1], "right"))
    for t in (1, 2, 29):
        # the same as frame by frame without all this
        row = t - 1
        if t < 7:
            expected = plain.step(joints[t], t * 33_000_000)
            assert np.array_equal(track.angles_raw[row], expected.angles_raw)
        assert np.linalg.norm(track.fitted_joints[row] - joints[t], axis=1).max() < 1e-5
    assert (count.frames, count.dropped, count.seen) == (30, 4, {"right": 28})
    assert "30 frames, 4 dropped (11.8 %): right hand in 28" in count.sentence
    assert track.events[0].text == "fitted"
    assert any(e.text.startswith("lost") for e in track.events)


def test_a_hand_is_calibrated_while_it_is_tracked(tmp_path, monkeypatch):
    """Another hand than the default one: after its first seconds it is fitted as it is."""
    subject = ht.HandModel.default("right", shape=[0.5, 2.0, -1.5, 0.0])
    t = np.arange(240)
    angles = np.tile(subject.mean_angles, (240, 1))
    for a in range(20):
        angles[:, a] += 0.25 * np.sin(t * (0.05 + 0.01 * a))
    joints = subject.joints(subject.limits.clamp(angles))

    found = threading.Event()
    take = OnlineCalibration.take

    def telling(self, *frame):
        result = take(self, *frame)
        if result is not None:
            found.set()
        return result

    monkeypatch.setattr(OnlineCalibration, "take", telling)

    def slowly():
        for frame in frames(joints):
            if frame.index == 150:
                # frames wait for the calibration here, as they do not in life
                assert found.wait(120)
                time.sleep(0.2)
            yield frame

    with RecorderSink(tmp_path / "live.mcap", "test", NO_MESH) as record:
        run_live(slowly(), tracker, [record], recalibrated=Tracker)
    before, after = sorted(ht.read_mcap(tmp_path / "live.mcap"), key=lambda x: x.time_ns[0])
    assert (before.name, after.name) == ("live", "live calibrated")
    assert len(before) + len(after) == 240
    assert 60 <= len(after) <= 90
    assert before.time_ns[-1] < after.time_ns[0]
    assert after.events[0].text == "hand calibrated for good, from 4 s of it"
    assert after.events[0].time_ns == after.time_ns[0]
    assert np.nanmean(after.error) < 0.2 * np.nanmean(before.error)
    assert np.allclose(after.model.bone_lengths, subject.bone_lengths, atol=1e-3)


@pytest.mark.parametrize("pace", ["a file's", "life's"])
def test_a_file_waits_for_the_calibrated_hand_and_life_does_not(pace, tmp_path, monkeypatch):
    """Calibrating takes until all frames of life have come; of a file none comes meanwhile."""
    life, over = pace == "life's", threading.Event()
    hand = ht.HandModel.default("right").scaled(1.1)

    def take(self, joints, time_ns, confidence):
        if time_ns < 4e9:
            return None
        if life:
            assert over.wait(60)
        return SimpleNamespace(model=hand)

    def coming():
        for frame in frames(motion(150)):
            yield replace(frame, came=frame.time_ns * 1e-9) if life else frame
        over.set()

    monkeypatch.setattr(OnlineCalibration, "take", take)
    with RecorderSink(tmp_path / "live.mcap", "test", NO_MESH) as record:
        run_live(coming(), tracker, [record], recalibrated=Tracker, waits=True)
    found = sorted(ht.read_mcap(tmp_path / "live.mcap"), key=lambda x: x.time_ns[0])
    assert [len(track) for track in found] == ([150] if life else [122, 28])


def test_ctrl_c_leaves_a_complete_recording(tmp_path):
    def interrupted():
        yield from frames(motion(12))
        raise KeyboardInterrupt

    with RecorderSink(tmp_path / "live.mcap", "test", NO_MESH) as record:
        count = run_live(interrupted(), tracker, [record])
    assert count.frames == 12
    assert [len(t) for t in ht.read_mcap(tmp_path / "live.mcap")] == [12]
    assert [p.name for p in tmp_path.iterdir()] == ["live.mcap"]


def test_a_filter_that_waits_loses_no_frame(tmp_path):
    """Frames come two later, each with its own number, and the last ones at the end."""

    def lagging(hand, size):
        model = ht.HandModel.default(hand).scaled(size)
        return Tracker(model, filter="fixed-lag", lag=2)

    joints = motion(12)
    with RecorderSink(tmp_path / "live.mcap", "test", NO_MESH) as record:
        count = run_live(frames(joints, missing=(0,)), lagging, [record])
    (track,) = ht.read_mcap(tmp_path / "live.mcap")
    assert track.frame_index.tolist() == list(range(1, 12))
    assert np.abs(track.observed - joints[1:]).max() < 1e-9
    assert count.seen == {"right": 11}


def test_a_hand_that_never_comes_gives_an_empty_recording(tmp_path):
    with RecorderSink(tmp_path / "live.mcap", "test", NO_MESH) as record:
        count = run_live(frames(motion(3), missing=range(3)), tracker, [record])
    assert count.seen == {}
    assert "no hand" in count.sentence
    assert ht.read_mcap(tmp_path / "live.mcap") == []


def test_the_size_is_that_of_the_bones():
    joints = RIGHT.joints(RIGHT.mean_angles)
    assert size_of(joints, "right") == pytest.approx(0.9)
    joints[4:] = np.nan
    assert size_of(joints, "right") is None


def lines(*rows) -> Newest[bytes]:
    queue: Newest[bytes] = Newest(max(99, len(rows) + 1))
    for row in rows:
        queue.put(row if isinstance(row, bytes) else json.dumps(row).encode())
    queue.end()
    return queue


def test_json_lines_of_joints():
    joints = motion(2)
    found = list(
        from_lines(
            lines(
                {"time_s": 1.5, "hand": "left", "joints_m": joints[0].tolist()},
                {"time_s": 1.6, "joints_m": [[None] * 3, *joints[1, 1:].tolist()]},
                {"time_s": 1.7, "hand": "left", "joints_mm": (1e3 * joints[1]).tolist()},
            ),
            "test",
        )
    )
    assert [f.time_ns for f in found] == [1_500_000_000, 1_600_000_000, 1_700_000_000]
    assert np.allclose(found[0].joints["left"], joints[0])
    assert np.isnan(found[1].joints["right"][0]).all()
    assert np.allclose(found[1].joints["right"][1:], joints[1, 1:])
    assert np.allclose(found[2].joints["left"], joints[1])
    stamped = list(from_lines(lines({"joints_m": joints[0].tolist()}), "test", hand="left"))
    assert stamped[0].time_ns >= 0
    assert list(stamped[0].joints) == ["left"]


@pytest.mark.parametrize(
    ("stamp", "first_ns"),
    [
        (lambda i: {"t": 3 + i / 50}, 3_000_000_000),
        (lambda i: {"timestamp": 3000 + 20 * i}, 3_000_000_000),
        (lambda i: {"timestamp": 3_000_000_000 + 20_000_000 * i}, 3_000_000_000),
        (lambda i: {"time_ms": 3000 + 20 * i}, 3_000_000_000),
        (lambda i: {"header": {"stamp": {"sec": 3, "nanosec": 20_000_000 * i}}}, 3_000_000_000),
    ],
)
def test_lines_begin_untracked_and_have_any_names(stamp, first_ns):
    joints = motion(6)
    names = [n.replace("little", "pinky").upper() for n in JOINT_NAMES]
    rows = [stamp(i) | {"hands": []} for i in range(2)]
    for i, frame in enumerate(joints, 2):
        named = dict(zip(names, frame.tolist(), strict=True))
        rows.append(stamp(i) | {"hands": [{"handedness": "Left", "joints": named}]})
    rows.append(stamp(8) | {"left": None, "right": None})
    found = list(from_lines(lines(*rows), "test"))
    assert [f.time_ns for f in found] == [first_ns + 20_000_000 * i for i in range(9)]
    assert [list(f.joints) for f in found] == [[], [], *[["left"]] * 6, []]
    assert np.allclose(found[4].joints["left"], joints[2])


def test_a_long_stream_is_judged_now_and_then(monkeypatch):
    judged = []
    monkeypatch.setattr(joint_order, "_doubts", lambda raw, *_: judged.append(raw) or [])
    joints = np.resize(motion(30), (200, 21, 3))
    rows = [{"time_s": t / 30, "joints": j.tolist()} for t, j in enumerate(joints)]
    found = list(from_lines(lines(*rows), "test"))
    np.testing.assert_array_equal([f.joints["right"] for f in found], joints)
    assert len(judged) == 100 + len(range(120, 200, 30))


def test_a_wrong_order_is_still_refused():
    joints = motion(5)
    rows = [{"time_s": t / 30, "joints": j.T.reshape(21, 3).tolist()} for t, j in enumerate(joints)]
    bad = BadLines(lambda _: None)
    assert list(from_lines(lines(*rows[:5]), "test", wrong=bad)) == []
    assert bad.count == 5
    assert "all x, then all y" in str(bad.first)


def test_lines_of_nothing_wait_for_the_first_time():
    joints = motion(2).tolist()
    rows = [b"null", b"[]", b"{}", {"time_s": 7, "joints": joints[0]}, b"null"]
    found = list(from_lines(lines(*rows, {"time_s": 8, "joints": joints[1]}), "test"))
    assert [bool(f.joints) for f in found] == [False] * 3 + [True, False, True]
    times = [f.time_ns for f in found]
    assert times == sorted(set(times))
    assert times[3] == 7_000_000_000


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ([b"hello"], "test, line 1: "),
        ([{"joints_m": [[0, 0, 1]] * 19}], "test, line 1: .*shape"),
    ],
)
def test_a_line_that_is_wrong_is_named(rows, says):
    with pytest.raises(InputError, match=says):
        list(from_lines(lines(*rows), "test"))


def test_the_command_tracks_standard_input(tmp_path):
    rows = [
        json.dumps({"time_ns": t * 33_000_000, "hand": "right", "joints_m": x.tolist()})
        for t, x in enumerate(motion(5))
    ]
    arguments = ["live", "--stdin", "--no-view", "--json", "-o", str(tmp_path / "l.mcap")]
    done = subprocess.run(
        [sys.executable, "-m", "handtrack", *arguments],
        input="\n".join(rows),
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["frames"] + said["dropped"] == 5
    (track,) = ht.read_mcap(tmp_path / "l.mcap")
    assert len(track) == said["frames"] == said["fitted"]["right"]


def test_the_command_refuses_what_makes_no_sense(tmp_path, capsys):
    for arguments, says in (
        ([], "choose one source"),
        (["--stdin", "--udp", "9"], "choose one source"),
        (["--stdin", "--filter", "rts"], "needs the whole sequence"),
        (["--stdin", "-o", str(tmp_path / "x.txt")], r"ends in .mcap"),
        (["--udp", "nowhere:x", "--no-view", "-o", str(tmp_path / "x.mcap")], "HOST:PORT"),
    ):
        assert run(["live", *arguments]) == 2
        assert says in capsys.readouterr().err


@pytest.mark.parametrize(
    ("stamps", "steps", "notes"),
    [
        ([0, 33, 33, 66, 99], [33, 8.25, 24.75, 33], ["a stamp does not increase"]),
        (
            [0, 33, 30, 66, 66, 99],
            [33, 8.25, 24.75, 6.1875, 26.8125],
            ["a stamp does not increase"],
        ),
        ([9000, 9033, 9066, 0, 33, 66], [33, 33, 33, 33, 33], ["the clock was set back by 9.1 s"]),
        ([0, 33, 66, 99], [33, 33, 33], []),
    ],
)
def test_stamps_that_do_not_increase_end_nothing(stamps, steps, notes):
    joints = motion(2).tolist()
    rows = [{"time_ms": t, "joints": joints[i % 2]} for i, t in enumerate(stamps)]
    found = list(from_lines(lines(*rows), "test"))
    assert np.diff([f.time_ns for f in found]).tolist() == [s * 1e6 for s in steps]
    said = [f.note for f in found if f.note]
    assert len(said) == len(notes)
    assert all(a.startswith(b) for a, b in zip(said, notes, strict=True))
