"""How fast each kind of file is read: `python -m tools.bench.reading` makes files, reads them and
writes the numbers of the docs; `--memory GB` writes what reading large ones takes of memory.

MB/s are of CPU seconds (user and system) of all that `ht.load` does, the best of some runs: other
work on the machine slows them down less than the wall's, but it does.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import handtrack as ht
from handtrack.sequences.picture_landmarks import load_picture_landmarks
from tools.bench import reading_json, reading_memory, reading_tables
from tools.bench.reading_arrays import ARRAYS, Read
from tools.bench.reading_files import motion
from tools.docs.generated import NUMBERS

_SAID: dict[str, dict[str, Any]] = {
    "deeplabcut.csv": {"unit": "cm", "hand": "right"},
    "anipose.csv": {"unit": "mm", "hand": "right"},
}
"""What must be said of files that do not say it."""


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mb", type=float, default=30.0, help="size of each file")
    parser.add_argument("--runs", type=int, default=2, help="the best of so many counts")
    parser.add_argument("--only", default="", help="a part of the names of files")
    parser.add_argument("--memory", type=float, help="measure memory with files of so many GB")
    parser.add_argument("--json", type=Path, help="where to, instead of the docs' numbers")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="reading-", dir=os.environ.get("TMPDIR")) as folder:
        if given.memory:
            head, rows = reading_memory.measured(Path(folder), given.memory, given.only)
        else:
            head, rows = _speeds(Path(folder), given.mb, given.runs, given.only)
    machine = f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.0f}"
    name = "reading_memory" if given.memory else "reading"
    kept = {"machine": machine, "head": head, "rows": rows}
    where = given.json or NUMBERS / f"{name}.json"
    where.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n")


def kinds() -> Iterator[tuple[str, str, Callable[[Path, float], Path], Read, Read]]:
    """Of each: what it is, the file's name, what makes it, and our and the plain reading of it."""
    world = {**reading_tables.TABLES, **reading_json.JSON}
    for name, (file, make) in world.items():
        yield name, file, make, _load, _bytes
    for name, (file, make) in {**reading_tables.PICTURES, **reading_json.PICTURES}.items():
        yield name, file, make, load_picture_landmarks, _bytes
    for name, kind in ARRAYS.items():
        yield name, kind.file, kind.make, _load, kind.plain


def _load(path: Path) -> object:
    return ht.load(path, **_SAID.get(path.name, {}))


def _bytes(path: Path) -> object:
    return [file.read_bytes() for file in _files(path)]


def _files(path: Path) -> list[Path]:
    return sorted(path.iterdir()) if path.is_dir() else [path]


def _speeds(folder: Path, mb: float, runs: int, only: str) -> tuple[list[str], list[list[str]]]:
    """MB per CPU second of reading each into sequences, and by the library of the format."""
    head = ["kind", "file, MB", "read, MB/s", "by its library, MB/s", "times its library"]
    rows = []
    _warm(folder)
    for name, file, make, read, plain in kinds():
        if only not in file:
            continue
        path = make(folder / file, mb)
        size = sum(f.stat().st_size for f in _files(path)) / 1e6
        ours, theirs = _best(read, path, runs), _best(plain, path, runs)
        row = [name, f"{size:.1f}", f"{size / ours:.0f}", "", ""]
        if name in ARRAYS:
            row[3:] = [f"{size / theirs:.0f}", f"{ours / theirs:.2f}"]
        rows.append(row)
        print(f"{name:36}", *row[1:], flush=True)
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return head, rows


def _best(read: Read, path: Path, runs: int) -> float:
    best = float("inf")
    for _ in range(runs):
        start = time.process_time()
        read(path)
        best = min(best, time.process_time() - start)
    return max(best, 1e-4)


def _warm(folder: Path) -> None:
    """Compile and load what the first file would wait for."""
    motion()
    for name, make in (*reading_tables.TABLES.values(), *reading_json.JSON.values()):
        if name in ("long.csv", "umetrack_hand_pose_trajectory.jsonl"):
            _load(make(folder / name, 0.1))


if __name__ == "__main__":
    main()
