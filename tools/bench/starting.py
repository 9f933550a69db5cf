"""What people wait for: commands from start to end, where the machine compiled before."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tools.bench.timed import Rows

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = ROOT / "recordings" / "sample.npz"
ROUNDS = 5


def start_part(quick: bool, limits: str) -> dict[str, Rows]:
    """Seconds of commands, the shortest of some rounds: on the clock, and of the processor.

    The last row is of an environment that keeps Python from storing its byte code
    (PYTHONDONTWRITEBYTECODE): each start compiles all modules again.
    """
    del limits
    rounds = 2 if quick else ROUNDS
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "out.mcap")
        track = ["track", str(SAMPLE), "-o", out, "--overwrite", "-q"]
        kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        empty = str(Path(folder) / "no-byte-code")
        again = kept | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPYCACHEPREFIX": empty}
        cases = {
            "handtrack --help": (["--help"], kept),
            "track, a clip of 10 s": (track, kept),
            "the same with --filter rts": ([*track, "--filter", "rts"], kept),
            "track, byte code not stored": (track, again),
        }
        rows: Rows = []
        for name, (arguments, environment) in cases.items():
            taken(arguments, environment)  # what is compiled and read from the disk once
            found = [taken(arguments, environment) for _ in range(rounds)]
            seconds, cpu = (min(column) for column in zip(*found, strict=True))
            rows.append({"what": name, "s": seconds, "CPU s": cpu})
    return {"from start to end of a command": rows}


def taken(arguments: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Seconds of one run of handtrack: on the clock, and of the processor with its children.

    Raises:
        RuntimeError: it fails.
    """
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "handtrack", *arguments],
        stdout=subprocess.DEVNULL, env=environment, cwd=ROOT,
    )  # fmt: skip
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"handtrack {' '.join(arguments)} ended with status {status}")
    return time.perf_counter() - start, used.ru_utime + used.ru_stime
