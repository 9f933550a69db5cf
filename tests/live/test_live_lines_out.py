"""live in a pipeline: lines that are wrong, pipes that wait, poses that are sent on."""

from __future__ import annotations

import io
import json
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError, SettingsError
from handtrack.live.lines import BadLines, from_lines
from handtrack.live.publish import message_of, publisher
from handtrack.live.sources import Newest, lines
from handtrack.tracking.tracker import Tracker

MODEL = ht.HandModel.default("right")


def motion(n: int) -> np.ndarray:
    angles = np.tile(MODEL.mean_angles, (n, 1))
    angles[:, 4::4] += 0.3 * np.sin(np.arange(n) / 8)[:, None]
    return MODEL.joints(MODEL.limits.clamp(angles))


def row(t: int, joints: np.ndarray) -> str:
    return json.dumps({"time_ns": t * 33_000_000, "hand": "right", "joints_m": joints.tolist()})


def live(tmp_path: Path, text: str, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "handtrack", "live", "--stdin", *options]
    return subprocess.run(command, input=text, capture_output=True, text=True, cwd=tmp_path)


def test_lines_that_are_wrong_are_counted_and_the_first_is_said():
    joints = motion(4)
    good = [row(t, x).encode() for t, x in enumerate(joints)]
    wrong = [
        b"hello",
        b'{"joints_m": [[0, 0, 1]]}',
        b'{"time_ns": "never", ' + good[0][14:],
        b"\xff\xfe\x00",
        b'{"hand": "third"',
    ]
    queue: Newest[bytes] = Newest(99)
    for line in (wrong[0], good[0], *wrong[1:4], good[1], good[2], wrong[4], good[3]):
        queue.put(line)
    queue.end()
    said: list[str] = []
    bad = BadLines(said.append)
    found = list(from_lines(queue, "test", wrong=bad))
    assert [f.time_ns for f in found] == [t * 33_000_000 for t in range(4)]
    for frame, x in zip(found, joints, strict=True):
        np.testing.assert_array_equal(frame.joints["right"], x)
    assert bad.count == 5
    assert len(said) == 1
    assert said[0].startswith("left out: test, line 1: ")


def test_the_command_goes_on_after_a_bad_line_and_a_pipe_waits(tmp_path):
    """Hundreds of lines at once: none is dropped."""
    joints = motion(300)
    rows = [row(t, x) for t, x in enumerate(joints)]
    rows.insert(150, "{nonsense")
    done = live(tmp_path, "\n".join(rows), "--no-view", "--json", "-o", "a.mcap", "--no-calibrate")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert (said["frames"], said["dropped"], said["bad"]) == (300, 0, 1)
    (track,) = ht.read_mcap(tmp_path / "a.mcap")
    assert len(track) == 300
    # nothing but nonsense is an input that cannot be used
    done = live(tmp_path, "hello\nworld\n", "--no-view", "-o", "b.mcap")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("error: standard input, line 1: ")


def test_whoever_writes_a_pipe_waits_for_its_reader():
    stream = io.BytesIO(b"".join(b"%d\n" % i for i in range(50)))
    queue = lines(stream, size=3)
    time.sleep(0.1)
    assert len(queue._items) == 3
    assert [int(line) for line in queue] == list(range(50))
    assert queue.dropped == 0


def test_without_a_display_it_goes_on(tmp_path, monkeypatch, capsys):
    from handtrack.cli import run
    from handtrack.viewer.live_viewer import LiveViewer

    def nothing(self: LiveViewer) -> LiveViewer:
        raise HandtrackError("the viewer ended at once")

    text = "\n".join(row(t, x) for t, x in enumerate(motion(5))).encode()
    monkeypatch.setattr(LiveViewer, "__enter__", nothing)
    monkeypatch.chdir(tmp_path)
    for options, status in (((), 0), (("--connect", "127.0.0.1:1"), 1)):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text)))
        assert run(["live", "--stdin", "-o", f"{status}.mcap", *options]) == status
        err = capsys.readouterr().err
        assert "the viewer ended at once" in err
        assert ("--no-view" in err) == (status == 0)
    assert len(ht.read_mcap("0.mcap")[0]) == 5


@pytest.fixture(scope="module")
def tracked():
    tracker = Tracker(MODEL)
    seen = tracker.step(motion(1)[0], 5)
    lost = tracker.step(np.full((21, 3), np.nan), 2_000_000_000)
    return seen, lost


def check(message: bytes, frame) -> None:
    got = json.loads(message)
    assert (got["hand"], got["frame"], got["status"]) == ("right", 3, "fitted")
    np.testing.assert_allclose(got["joints_m"], frame.filtered_joints, atol=1e-6)
    np.testing.assert_allclose(got["angles_rad"], frame.angles, atol=1e-6)


def test_a_message_is_strict_json(tracked):
    check(message_of(tracked[0], "right", 3), tracked[0])
    lost = json.loads(message_of(tracked[1], "right", 3))
    assert (lost["status"], lost["angles_rad"][0], lost["error_mm"]) == ("lost", None, None)


def test_datagrams_are_sent_with_their_latency(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(20)
        port = listener.getsockname()[1]
        text = "\n".join(row(t, x) for t, x in enumerate(motion(5)))
        options = ("--no-view", "-o", "a.mcap", "--no-calibrate", "--publish", f"udp:{port}")
        done = live(tmp_path, text, *options)
        assert done.returncode == 0, done.stderr
        got = [json.loads(listener.recv(65_536)) for _ in range(5)]
    assert [g["frame"] for g in got] == list(range(5))
    (track,) = ht.read_mcap(tmp_path / "a.mcap")
    np.testing.assert_allclose([g["joints_m"] for g in got], track.filtered_joints, atol=1e-6)
    assert f"publishing to udp:127.0.0.1:{port}" in done.stderr
    assert "to the publisher" in done.stdout


def test_zmq_subscribers_get_it(tracked):
    zmq = pytest.importorskip("zmq", reason="pyzmq is not installed (extra live)")
    with publisher("zmq:0") as out, zmq.Context() as context:
        address = out.address.removeprefix("zmq:")
        assert address.startswith("tcp://127.0.0.1:")
        with context.socket(zmq.SUB) as listener:
            listener.subscribe(b"")
            listener.connect(address)
            for _ in range(200):
                out.send(message_of(tracked[0], "right", 3))
                if listener.poll(20):
                    break
            check(listener.recv(zmq.NOBLOCK), tracked[0])


def test_websockets_get_it_and_may_leave(tracked):
    pytest.importorskip("websockets", reason="websockets is not installed (extra live)")
    from websockets.sync.client import connect

    message = message_of(tracked[0], "right", 3)
    with publisher("ws://127.0.0.1:0") as out:
        out.send(message)  # nobody listens: it is gone
        stop = threading.Event()

        def send() -> None:
            while not stop.wait(0.01):
                out.send(message)

        sender = threading.Thread(target=send)
        sender.start()
        try:
            with connect(out.address) as client:
                check(client.recv(10).encode(), tracked[0])
            with connect(out.address) as client:
                check(client.recv(10).encode(), tracked[0])
        finally:
            stop.set()
            sender.join()


@pytest.mark.parametrize("address", ["tcp:1", "udp:", "udp:nowhere:x", "ws://a:123456", "udp:0"])
def test_addresses_that_are_none(address):
    with pytest.raises(SettingsError, match="--publish"):
        publisher(address)


def test_protobuf_states_are_sent_on_and_are_those_recorded(tmp_path):
    """A State without its decimals cut; the file of options is told in the recording."""
    from handtrack.mcap.schema import message_class

    (tmp_path / "run.toml").write_text('[live]\nfilter = "kalman"\n')
    text = "\n".join(row(t, x) for t, x in enumerate(motion(12))) + "\n"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        to = f"udp:{receiver.getsockname()[1]}"
        given = ["--publish", to, "--publish-format", "protobuf", "--config", "run.toml"]
        receiver.settimeout(20.0)
        done = live(
            tmp_path, text, "--no-view", "-o", "a.mcap", "--no-calibrate", "--hand", "right", *given
        )
        assert done.returncode == 0, done.stderr
        states = []
        for _ in range(12):
            states.append(message_class("handtrack.State").FromString(receiver.recv(65536)))
    (track,) = ht.read_mcap(tmp_path / "a.mcap")
    assert track.settings["config"]["options"] == {"filter": "kalman"}
    for t, state in enumerate(states):
        assert state.time_ns == track.time_ns[t]
        assert state.status == track.status[t]
        np.testing.assert_array_equal(state.angles, track.angles[t])
        np.testing.assert_array_equal(state.filtered_joints, track.filtered_joints[t].ravel())
    done = live(tmp_path, text, "--no-view", *given)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "say --hand left or --hand right" in done.stderr
