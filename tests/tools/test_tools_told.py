"""The project's own programs end on Ctrl-C and on unwritable files with one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import tools

ROOT = Path(__file__).resolve().parents[2]


def test_an_unwritable_picture_is_one_line(tmp_path):
    program = [sys.executable, "-m", "tools.render.hand", str(tmp_path / "no" / "a.png")]
    small = ["--poses", "flat", "--views", "dorsal", "--size", "24"]
    done = subprocess.run(program + small, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert "a.png" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_ctrl_c_is_one_line():
    # as the tool would be stopped, while its imports or its work last
    stopped = "import sys; sys.argv = ['-m']; import tools, signal; signal.raise_signal(2)"
    begin = "import signal; signal.signal(2, signal.default_int_handler); "
    done = subprocess.run(
        [sys.executable, "-c", begin + stopped], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode != 0
    assert done.stderr == "stopped\n"


def test_other_errors_keep_their_traces(capsys):
    error = ValueError("a fault of ours")
    tools._told(ValueError, error, None)
    assert "ValueError: a fault of ours" in capsys.readouterr().err
    assert sys.excepthook is not tools._told
