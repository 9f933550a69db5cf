"""The program itself: help, replay, what is said while compiling."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from cli_cases import files

import handtrack as ht
from handtrack.cli import progress
from handtrack.cli import progress as cli_progress

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "hand")]

pytestmark = pytest.mark.usefixtures("elsewhere")


def test_replay_saves(call, made, elsewhere):
    status, out, err = call("replay", made.recording, "--save", "deep/out.rrd")
    assert (status, out, err) == (0, f"{made.recording} -> deep/out.rrd\n", "")
    assert call("replay", made.recording, "--save", "small.rrd", "--no-mesh", "-q") == (0, "", "")
    assert files(elsewhere) == {"deep/out.rrd", "small.rrd"}
    assert Path("small.rrd").stat().st_size < Path("deep/out.rrd").stat().st_size / 3


def test_replay_of_several_files_and_folders(call, made):
    os.mkdir("runs")
    shutil.copy(made.recording, "runs/a.mcap")
    shutil.copy(made.recording, "runs/b.mcap")
    status, out, _ = call("replay", "runs", made.recording, "--save", "all.rrd")
    assert (status, out) == (0, f"runs/a.mcap, runs/b.mcap, {made.recording} -> all.rrd\n")


def test_replay_without_a_viewer_fails(call, made, monkeypatch):
    monkeypatch.setenv("RERUN_CLI_PATH", "/usr/bin/false")
    status, out, err = call("replay", made.recording)
    assert (status, out) == (1, "")
    assert re.fullmatch(r"error: the viewer ended with status 1; .* --web .* --save .*\n", err)


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_replay_serves_a_page_until_it_is_stopped(made):
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "from handtrack.cli import run; sys.exit(run(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", code, "replay", made.recording, "--web", "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        assert process.stdout.readline() == "Ctrl-C stops the server.\n"
        with urllib.request.urlopen(address, timeout=10) as page:
            assert b"<html" in page.read().lower()
        process.send_signal(signal.SIGINT)
        assert process.wait(15) == 0


def test_help(call):
    status, out, _ = call()
    assert status == 0
    for name in ("track", "replay", "stability"):
        assert re.search(rf"^  {name} +\S", out, re.MULTILINE)
        status, text, _ = call(name, "--help")
        assert status == 0
        assert text.startswith(f"Usage: handtrack {name} ")
    assert "..." not in out.partition("Commands:")[2]
    assert call("-h")[1] == call("--help")[1] == out
    assert call("--version")[1] == f"handtrack, version {ht.__version__}\n"


@pytest.mark.parametrize("program", [["handtrack"], [sys.executable, "-m", "handtrack"]])
def test_the_program_itself(program, made, elsewhere):
    if program == ["handtrack"]:
        script = shutil.which("handtrack", path=str(Path(sys.executable).parent))
        if script is None:
            pytest.skip("the console script is not installed beside this Python")
        program = [script]
    done = subprocess.run(
        [*program, "track", made.short, "--json"],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    assert (done.returncode, done.stderr) == (0, "")
    recording = f"recordings/{Path(made.short).parent.name}-short.mcap"
    assert json.loads(done.stdout)["outputs"] == [recording]
    assert files(elsewhere) == {recording}
    done = subprocess.run([*program, "track", "no.npz"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: no.npz: no such file or folder\n"


def test_compiling_is_said_once_and_only_when_it_happens(capsys):
    import numba

    with cli_progress.compiling_said(quiet=False):
        pass
    assert capsys.readouterr() == ("", "")
    with cli_progress.compiling_said(quiet=False):
        for _ in range(2):
            assert numba.njit(lambda x: x + 1)(1) == 2
    said = cli_progress.COMPILING.format(part="the fitter", seconds=15)
    assert capsys.readouterr() == ("", f"{said}\n")
    with cli_progress.compiling_said(quiet=True):
        assert numba.njit(lambda x: x + 2)(1) == 3
    assert numba.njit(lambda x: x + 3)(1) == 4
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("kernel", "part"),
    [
        ("newton.newton", "the fitter"),
        ("pose_information.unit_covariance", "the fitter"),
        # only filters ask for it: "the fitter" would be said a second time
        ("pose_information.information", "the filter"),
        ("filter_loop.filter_frames", "the filter"),
        ("motion_evidence.add_evidence", "the filter"),
        ("drift_loop.filter_drifting_frames", "the filter of noise that lasts"),
        ("smoother.smooth_frames", "the smoother"),
        ("drift_smoother.smooth_drifting_frames", "the smoother"),
        ("smoother.lag_frames", "the smoother with a fixed lag"),
        ("drift_smoother.lag_drifting_frames", "the smoother with a fixed lag"),
        ("li2021.bcd_li2021", "the paper's updates"),
        ("image_fit.fit_views", "the fit to pictures"),
        ("collisions.move_apart", "the collisions"),
    ],
)
def test_compiling_names_the_part(kernel, part, capsys):
    from numba.core import event

    module, function = kernel.split(".")
    assert hasattr(importlib.import_module(f"handtrack.kernels.{module}"), function)
    about = {"module": f"handtrack.kernels.{module}", "qualname": f"{function}_0123456789ab"}
    with cli_progress.compiling_said(quiet=False):
        event.start_event("numba:run_pass", about)
        event.end_event("numba:run_pass", about)
    assert capsys.readouterr().err.startswith(f"compiling {part}, once on this machine")


def test_compiling_says_nothing_of_what_a_part_is_made_of(capsys):
    from numba.core import event

    def about(name):
        return {"module": f"handtrack.kernels.{name}", "qualname": "f"}

    with cli_progress.compiling_said(quiet=False):
        for outer in ("smoother", "frame_loop", "smoother"):
            event.start_event("numba:run_pass", about(outer))
            event.start_event("numba:run_pass", about("kalman"))
            event.end_event("numba:run_pass", about("kalman"))
            event.end_event("numba:run_pass", about(outer))
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(",")[0] for line in lines] == ["compiling the smoother"]


def test_compiling_that_lasts_says_how_far_it_is(monkeypatch, capsys):
    from numba.core import event

    now = [100.0]
    monkeypatch.setattr(cli_progress.time, "monotonic", lambda: now[0])
    with cli_progress.compiling_said(quiet=False):
        now[0] += 60.0  # until the first there is nothing to be compiled
        for i in range(9):
            # two passes over each function
            about = {"module": "handtrack.kernels.newton", "qualname": f"f{i // 2}"}
            event.start_event("numba:run_pass", about)
            event.end_event("numba:run_pass", about)
            now[0] += 4.0
    first, *later = capsys.readouterr().err.splitlines()
    assert first.startswith("compiling the fitter")
    assert later == [
        "still compiling: 2 functions in 12 s",
        "still compiling: 4 functions in 24 s",
    ]


def test_what_took_the_time_adds_up_to_the_whole(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    progress.begin()
    now[0] += 0.125
    times = progress.Times()
    now[0] += 0.375
    with times.during("writing"):
        now[0] += 0.25
        with times.during("fitting"):
            now[0] += 2.0
        times.move(0.5, "fitting", "calibrating")
    assert times.to_dict() == {
        "starting": 0.125,
        "fitting": 1.5,
        "writing": 0.25,
        "calibrating": 0.5,
        "other": 0.375,
        "total": 2.75,
    }
    said = "fitting 1.50, calibrating 0.50, writing 0.25, starting 0.12, the rest 0.38"
    assert times.said() == f"2.75 s: {said}"


def test_a_log_gets_a_line_a_minute(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(cli_progress.time, "monotonic", lambda: now[0])
    with cli_progress.progress_shown(300, quiet=False) as progress:
        for done in range(0, 301, 100):
            progress.frames(done)
            now[0] += 40.0
    assert capsys.readouterr().err == "tracking: 200 of 300 frames in 1:20 min\n"
    with cli_progress.progress_shown(300, quiet=True) as progress:
        now[0] += 900.0
        progress.frames(10)
    assert capsys.readouterr().err == ""


def test_track_tells_what_took_the_time(call, made, elsewhere):
    status, out, _ = call("track", made.short, "-o", "a.mcap")
    assert status == 0
    assert re.search(r"^took [\d.]+ s: .*(fitting|calibrating|writing)", out, re.MULTILINE)
    seconds = json.loads(call("track", made.short, "-o", "b.mcap", "--json")[1])["seconds"]
    parts = sum(spent for what, spent in seconds.items() if what != "total")
    assert parts == pytest.approx(seconds["total"], abs=0.02)
    assert {"reading", "calibrating", "fitting", "writing", "measuring"} <= set(seconds)
