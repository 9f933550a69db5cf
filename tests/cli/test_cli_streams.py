"""The program where something is missing: standard output, an alphabet, a home, time to finish."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import HandtrackError, InputError
from handtrack.files.whole import whole_file

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = [sys.executable, "-m", "handtrack"]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="streams, signals differ")


@pytest.fixture(scope="module")
def recording(sample: ht.Sequence, tmp_path_factory: pytest.TempPathFactory) -> Path:
    track = ht.track(sample.frames(0, 20), calibrate=False)
    return ht.write_mcap(track, tmp_path_factory.mktemp("run") / "a.mcap", mesh=False)


def environment(**changed: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **changed}


def test_a_closed_standard_output_is_told(recording: Path) -> None:
    """And takes no file's number: else what is printed would go into a file."""
    command = " ".join([*PROGRAM, "info", str(recording)])
    done = subprocess.run(
        ["sh", "-c", f"{command} >&-"], stderr=subprocess.PIPE, text=True, env=environment()
    )
    assert (done.returncode, done.stderr) == (1, "error: standard output is closed\n")


def test_letters_that_the_terminal_has_not(recording: Path) -> None:
    """No locale, no home: the table has lines and signs that ASCII lacks."""
    bare = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT)}
    bare |= {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    if "NUMBA_CACHE_DIR" in os.environ:
        bare["NUMBA_CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]
    done = subprocess.run(
        [*PROGRAM, "stability", str(recording)], capture_output=True, text=True, env=bare
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "PA-MPJPE" in done.stdout


def test_sigterm_keeps_what_came(sample: ht.Sequence, tmp_path: Path) -> None:
    joints = np.tile(sample.joints, (15, 1, 1))
    np.savez(tmp_path / "long.npz", joints_m=joints, fps=30.0, hand="right")
    command = [*PROGRAM, "track", "long.npz", "-o", "a.mcap", "--no-calibrate"]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    part = tmp_path / "a.mcap.part"
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and not (part.exists() and part.stat().st_size > 1_000_000):
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (128 + signal.SIGTERM, "")
    told = [line for line in err.splitlines() if "compil" not in line]
    assert told[-1] == "stopped"
    assert "a.mcap.part holds the" in told[-2]
    with pytest.warns(UserWarning, match="ends in the middle"):
        (read,) = ht.read_mcap(part)
    # a signal may come between a frame and its count: what is said is there, if not all of it
    said = re.search(r"holds the ([\d,]+) frames (?:that came|until then)", told[-2])
    assert said is not None, told
    assert 5 < int(said[1].replace(",", "")) <= len(read)
    assert [file.name for file in tmp_path.glob("*.mcap*")] == ["a.mcap.part"]


@pytest.mark.parametrize("link", ["same", "symbolic", "hard"])
def test_no_command_writes_over_its_input(
    link: str,
    recording: Path,
    sample_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def other(path: Path) -> Path:
        """Another name of the same file."""
        name = path if link == "same" else path.with_stem("other")
        if link == "symbolic":
            name.symlink_to(path)
        elif link == "hard":
            name.hardlink_to(path)
        return name

    mcap, json, html = (tmp_path / f"in.{suffix}" for suffix in ("mcap", "json", "html"))
    shutil.copy(recording, mcap)
    shutil.copy(sample_file, json)
    shutil.copy(recording, html)
    before = {path: path.read_bytes() for path in (mcap, json, html)}
    again = {path: str(other(path)) for path in before}
    for command in (
        ["track", str(mcap), "-o", again[mcap]],
        ["retrack", str(mcap), "-o", again[mcap]],
        ["recover", str(mcap), "-o", again[mcap]],
        ["calibrate", str(json), "-o", again[json]],
        ["stability", str(html), "--html", again[html]],
        ["stability", str(mcap), "--truth", str(html), "--html", again[html]],
    ):
        assert run(command) == 2, command
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert "input" in err or "the file to recover" in err, command
    assert {path: path.read_bytes() for path in before} == before


def test_two_that_write_one_file(tmp_path: Path) -> None:
    """The first that is complete has the name; the other keeps its own, and says so."""
    path = tmp_path / "a.txt"
    path.write_text("before")
    with pytest.raises(HandtrackError, match="something else has written this file") as told:
        _write_twice(path)
    assert path.read_text() == "inner"
    (part,) = tmp_path.glob("*.part")
    assert part.read_text() == "outer"
    assert str(told.value).endswith(str(part))


def _write_twice(path: Path) -> None:
    with whole_file(path) as outer:
        outer.write_text("outer")
        with whole_file(path) as inner:
            assert inner != outer
            inner.write_text("inner")


def test_a_file_that_fails_says_why_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing may be written nothing can be removed either: the reason is told though."""

    def read_only(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", read_only)
        with (
            pytest.raises(HandtrackError, match=r"a\.txt: cannot be written: No space"),
            whole_file(tmp_path / "a.txt"),
        ):
            raise OSError(28, "No space left on device")
    with suppress(InputError), whole_file(tmp_path / "a.txt") as part:
        part.write_text("x")
        raise InputError("no")
    assert list(tmp_path.iterdir()) == []
