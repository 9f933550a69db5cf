"""How much memory the reading of large files takes: each is made, read by a process of its own,
and deleted."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tools.bench import reading_arrays, reading_json, reading_tables

FILES = (
    *("wide.csv", "long.csv", "flat.jsonl", "frames.json", "a.hdf5", "columns.parquet"),
    *("lerobot.parquet", "a.npz", "packed.npz", "poses.mcap", "own.mcap"),
)
_READ = """
import resource, sys, time
import handtrack as ht

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

import pyarrow.csv
before, start = peak(), time.process_time()
found = ht.load(sys.argv[1], max_size="64GB")
spent = time.process_time() - start
print(before, peak(), sum(s.joints.nbytes for s in found) / 1e6, spent)
"""


class Taken(NamedTuple):
    """What reading one file takes: its size and that of its joints [MB], peaks of memory before
    and after [MB], CPU seconds."""

    size: float
    joints: float
    before: float
    after: float
    seconds: float


def measured(folder: Path, gb: float, only: str) -> tuple[list[str], list[list[str]]]:
    """Peaks of memory of loading files of a fifth of the size and of the whole.

    Returns:
        Head and rows of a table.
    """
    head = [
        "kind",
        "file, GB",
        "joints, MB",
        "peak at a fifth, MB",
        "peak, MB",
        "grows by, of file",
    ]
    texts = {**reading_tables.TABLES, **reading_json.JSON}
    makers = {file: (name, make) for name, (file, make) in texts.items()}
    makers |= {kind.file: (name, kind.make) for name, kind in reading_arrays.ARRAYS.items()}
    rows = []
    for file in FILES:
        if only not in file:
            continue
        name, make = makers[file]
        small, large = (taken(folder / file, make, 1000 * g) for g in (gb / 5, gb))
        grows = (large.after - small.after) / (large.size - small.size)
        numbers = f"{large.size / 1e3:.2f}", f"{large.joints:.0f}"
        row = [name, *numbers, f"{small.after:.0f}", f"{large.after:.0f}", f"{grows:.2f}"]
        rows.append(row)
        print(*row, f"{large.seconds:.0f} s CPU", flush=True)
    return head, rows


def taken(path: Path, make: Callable[[Path, float], Path], mb: float) -> Taken:
    """What reading a file of so many MB takes."""
    make(path, mb)
    said = subprocess.run(
        [sys.executable, "-c", _READ, str(path)], check=True, capture_output=True, text=True
    ).stdout
    size = path.stat().st_size / 1e6
    path.unlink()
    before, after, joints, seconds = map(float, said.split())
    return Taken(size, joints, before, after, seconds)
