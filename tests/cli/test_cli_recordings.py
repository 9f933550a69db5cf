"""Recordings on the command line: what goes in, info, retrack, diff, recover, killed runs."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import main, run
from tools.make import mano_like as make_mano_like

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def short(tmp_path_factory, sample_file) -> Path:
    """60 frames of the sample."""
    with np.load(sample_file) as file:
        content = {k: v[:60] if np.ndim(v) and len(v) == 300 else v for k, v in file.items()}
    path = tmp_path_factory.mktemp("made") / "short.npz"
    np.savez(path, **content)
    return path


@pytest.fixture(scope="module")
def recording(short) -> Path:
    path = short.with_name("short.mcap")
    assert run(["track", str(short), "-o", str(path), "-q", "--filter", "kalman"]) == 0
    return path


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_goes_into_a_recording(call, short):
    sizes = {}
    for name, options in {
        "full": (),
        "zstd": ("--compression", "zstd"),
        "quantised": ("--mesh", "quantised", "--compression", "zstd"),
        "every": ("--mesh", "every:10"),
        "none": ("--no-mesh",),
        "scene": ("--mesh", "quantised,every:10", "--foxglove-mesh"),
    }.items():
        assert call("track", short, "-o", f"{name}.mcap", "-q", *options) == (0, "", "")
        sizes[name] = os.path.getsize(f"{name}.mcap")
        _, out, _ = call("info", "--json", f"{name}.mcap")
        (about,) = json.loads(out)
        assert about["mesh"] == {"zstd": "full", "every": "every:10"}.get(name, about["mesh"])
        messages = {topic: of["messages"] for topic, of in about["topics"].items()}
        lost = about["hands"]["right"]["lost"]
        expected = {"every": 6, "scene": 6, "none": None}.get(name, 60)
        assert messages.get("/right/mesh") == expected
        assert messages.get("/right/skin") == {"scene": 6, "none": None}.get(name, 1)
        assert lost == 0
    assert sizes["none"] < sizes["every"] < sizes["quantised"] < sizes["zstd"] < sizes["full"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mesh", "half"), "mesh 'half' is unknown, expected full, quantised, every N"),
        (("--mesh", "every:2", "--no-mesh"), "--no-mesh and --mesh every:2: choose one"),
        (("--no-mesh", "--foxglove-mesh"), "a mesh for Foxglove needs a mesh"),
        (("--compression", "gzip"), "'gzip' is not one of"),
    ],
)
def test_what_cannot_go_into_a_recording(options, message, call, short, elsewhere):
    status, out, err = call("track", short, "-o", "a.mcap", *options)
    assert (status, out) == (2, "")
    assert message in err
    assert list(elsewhere.iterdir()) == []


def test_retrack_with_the_stored_settings_is_the_same(call, recording):
    status, out, err = call("retrack", recording, "-o", "again.mcap")
    assert (status, err) == (0, "")
    assert f"tracked 60 frames of {recording} again -> again.mcap" in out
    status, out, _ = call(
        "diff", recording, "again.mcap", "--tolerance-deg", 0, "--tolerance-mm", 0
    )
    assert status == 0
    assert "every array is the same, to the bit" in out


def test_diff_tells_what_changed(call, recording):
    assert call("retrack", recording, "-o", "other.mcap", "-q", "--limits", "li2021")[0] == 0
    status, out, _ = call("diff", recording, "other.mcap")
    assert status == 1
    assert "limits: anatomical -> li2021" in out
    assert "beyond 0.01 deg and 0.01 mm" in out
    assert call("diff", recording, "other.mcap", "-q") == (1, "", "")
    wide = ("--tolerance-deg", 180, "--tolerance-mm", 100)
    assert call("diff", recording, "other.mcap", *wide)[0] == 0
    _, out, _ = call("diff", recording, "other.mcap", "--json")
    found = json.loads(out)
    assert not found["within"]
    (hand,) = found["hands"]
    assert hand["settings"] == {"limits": ["anatomical", "li2021"]}
    assert hand["frames"] == [60, 60, 60]
    assert hand["worst_deg"] == max(c["max"] for c in hand["angles_deg"].values())


def test_retrack_and_what_it_refuses(call, recording):
    assert call("retrack", recording, "-o", recording)[::2] == (
        2,
        f"error: {recording} is the input: give the new file another name with -o\n",
    )
    assert call("retrack", recording)[0] == 2
    assert call("retrack", "nowhere.mcap", "-o", "a.mcap")[::2] == (
        2,
        "error: nowhere.mcap: there is no such file\n",
    )
    assert call("retrack", recording, "-o", "a.mcap", "-q", "--no-calibrate")[0] == 0
    (track,) = ht.read_mcap("a.mcap")
    assert track.settings["calibrate"] is False
    assert track.settings["filter"] == "kalman"


def test_a_recording_of_mano_asks_for_mano(call, short, tmp_path):
    with (tmp_path / "MANO_RIGHT.pkl").open("wb") as file:
        make_mano_like.write_pickle(make_mano_like.make_mano_like("right"), file)
    given = ("--mano", tmp_path)
    assert call("track", short, "-o", "a.mcap", "-q", "--no-calibrate", *given)[0] == 0
    status, _, err = call("retrack", "a.mcap", "-o", "b.mcap")
    assert status == 2
    assert "the hand is mano, whose licence keeps its skin out of recordings" in err
    assert call("retrack", "a.mcap", "-o", "b.mcap", "-q", *given)[0] == 0
    status, out, _ = call("diff", "a.mcap", "b.mcap")
    assert status == 0
    assert "to the bit" in out
    assert call("replay", "a.mcap", "--save", "a.rrd", "-q")[0] == 0
    assert os.path.getsize("a.rrd") > 500_000


def test_info(call, recording, tmp_path):
    status, out, err = call("info", recording)
    assert (status, err) == (0, "")
    assert "right: sample, right hand, model default" in out
    assert "60 frames, 1.97 s, 30.0" in out
    assert "filter kalman" in out
    assert "/right/mesh" in out
    status, out, err = call("info", tmp_path)
    assert (status, out) == (2, "")
    assert "no .mcap recording" in err


def test_following_a_complete_recording(call, recording):
    status, out, _ = call("info", "--follow", recording)
    assert (status, out.splitlines()[0][:29]) == (0, "sample right: 60 frames to 59")
    _, out, _ = call("info", "--follow", "--json", recording)
    assert json.loads(out.splitlines()[0])["frame_index"] == 59


def test_a_part_is_read_like_a_recording(call, recording):
    data = recording.read_bytes()
    Path("run.mcap.part").write_bytes(data[: len(data) // 2])
    for command in (
        ("stability", "run.mcap.part", "--json"),
        ("replay", "run.mcap.part", "--save", "run.rrd"),
        ("export", "run.mcap.part", "run.csv"),
        ("retrack", "run.mcap.part", "-o", "again.mcap"),
        ("info", "run.mcap.part"),
    ):
        status, out, err = call(*command)
        assert status == 0, err
        assert "ends in the middle of its data" in out + err
    status, _, err = call("track", "run.mcap.part", "-o", "tracked.mcap")
    assert status == 2
    assert "'handtrack recover' makes a whole one" in err


def test_recover(call, recording):
    data = recording.read_bytes()
    Path("run.mcap.part").write_bytes(data[: len(data) // 2])
    status, out, err = call("recover", "run.mcap.part")
    assert (status, err) == (0, "")
    assert "-> run.mcap\n" in out
    assert "bytes are lost" in out
    assert 0 < len(ht.read_mcap("run.mcap")[0]) < 60
    # what is there is not written over
    status, _, err = call("recover", "run.mcap.part")
    assert status == 2
    assert "-o gives another name" in err
    assert "nothing was wrong" in call("recover", recording, "-o", "copy.mcap")[1]


def test_a_killed_run_leaves_a_readable_part(sample, tmp_path):
    """Hours of input, killed as soon as the first part of it is recorded."""
    clip = sample.joints[:150]  # before its gap
    joints = np.concatenate([clip, clip[::-1]] * 60)
    np.savez(tmp_path / "long.npz", joints_m=joints, fps=30.0)
    command = [sys.executable, "-m", "handtrack", "track", "long.npz", "-o", "run.mcap"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as child:
        part, deadline = tmp_path / "run.mcap.part", time.monotonic() + 120
        while not (part.exists() and part.stat().st_size > 3_000_000):
            assert child.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        child.send_signal(signal.SIGKILL)
    assert not (tmp_path / "run.mcap").exists()
    assert run(["recover", "run.mcap.part", "-q"]) == 0
    (track,) = ht.read_mcap("run.mcap")
    assert len(track) > 50
    np.testing.assert_array_equal(track.observed, joints[: len(track)])
    assert (track.status == "fitted").all()


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("4", "4")])
def test_the_command_line_computes_on_one_thread(given, expected, monkeypatch):
    """Unless the user says otherwise; so that a small matrix product does not wait for threads."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", given or "")
    if given is None:
        monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    monkeypatch.setattr(sys, "argv", ["handtrack", "--version"])
    with pytest.raises(SystemExit):
        main()
    assert os.environ["OPENBLAS_NUM_THREADS"] == expected
