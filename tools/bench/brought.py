"""What people bring, at random: made hands in every order, unit, mark, clock, name and side.

    python -m tools.bench.brought [--seeds 200] [--first 0] [--keep FOLDER] [--show]

Each file goes through `handtrack track` and `handtrack export` with default options and is
compared with its truth. Counted are: right; refused with one line that names a cure; warned;
silent errors (PA-MPJPE above 2 mm, a finger's angles 5 degrees off, another hand or another
frame rate, and not a word); and faults (a traceback, a library's warning, an error of several
lines). Files that are silent errors or faults are kept. Exit status 1 where there is any.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import re
import shutil
import sys
import tempfile
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.cli import run
from handtrack.evaluation.metrics import pa_mpjpe

MAX_MM, MAX_DEG = 2.0, 5.0
CURE = re.compile(r"--[a-z]+|expected|would fit|name it")
_LIBRARY = re.compile(r"Traceback|[A-Z]\w+Warning|site-packages|numpy\.|model default")
_ROUTINE = re.compile(
    r"frames/s assumed|no hand named|taken as missing|read as (s|ms|us|ns)\b|columns not used"
)
"""Notes that say what was taken, not that something may be wrong."""

_tests = Path(__file__).resolve().parents[2] / "tests" / "brought"
sys.path.insert(0, str(_tests))
combination: Any = importlib.import_module("made_combinations").combination


@dataclass(frozen=True)
class Outcome:
    """What came of one file.

    Attributes:
        kind: right, refused, warned, silent or fault.
        said: what stood on stderr.
        why: where it is not right, in what.
    """

    kind: str
    said: str
    why: str = ""


def command(*arguments: str) -> tuple[int, str, str]:
    """Run `handtrack` in this process: exit status, stderr and stdout."""
    out, err = io.StringIO(), io.StringIO()
    streams = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
    with streams[0], streams[1], warnings.catch_warnings():
        warnings.simplefilter("always")
        status = run(list(arguments))
    return status, err.getvalue(), out.getvalue()


def judge(made: Any, folder: Path) -> Outcome:
    """What comes of a combination written into an empty folder."""
    path = made.make(folder)
    recording = folder / "out.mcap"
    try:
        status, said, _ = command(
            *("track", str(path), "-o", str(recording), "--mesh", "none", *made.arguments)
        )
        if status == 0:
            command("export", str(recording), str(folder / "out.npz"), "-q")
    except Exception as error:  # noqa: BLE001 - whatever escapes the command is a fault
        return Outcome("fault", "", f"{type(error).__name__}: {error}")
    if _LIBRARY.search(said):
        return Outcome("fault", said, "a library speaks")
    if status:
        errors = [line for line in said.splitlines() if line.startswith("error: ")]
        if status != 2 or len(errors) != 1 or str(path) not in errors[0]:
            return Outcome("fault", said, f"exit status {status}")
        return Outcome("refused" if CURE.search(errors[0]) else "fault", said, "no cure named")
    wrong = compare(made.brought, sorted(folder.glob("out*.npz")))
    if not wrong:
        return Outcome("right", said)
    notes = [x for x in said.splitlines() if x.startswith("warning: ")]
    doubts = [x for x in notes if not _ROUTINE.search(x)]
    if any(w.startswith("hands are") for w in wrong):  # a file that names no hand: that is said
        doubts += [x for x in notes if "no hand named" in x]
    return Outcome("warned" if doubts else "silent", said, "; ".join(wrong))


def compare(brought: Any, exported: list[Path]) -> list[str]:
    """What of the exported files is not as the truth has it."""
    wanted = {one.hand: one for one in brought.each()}
    files = [dict(np.load(path)) for path in exported]
    hands = sorted(str(f["hand"]) for f in files)
    if hands != sorted(wanted):
        return [f"hands are {hands}"]
    return [w for f in files for w in _compared(f, wanted[str(f["hand"])])]


def _compared(exported: dict[str, Any], one: Any) -> list[str]:
    hand = one.hand
    found, angles, truth, true_angles = (
        *(exported["filtered_joints_m"], exported["angles_rad"]),
        *(one.expected, one.angles),
    )
    if len(found) != len(truth):
        seen = np.isfinite(truth).all(-1).any(1)
        truth, true_angles = truth[seen], true_angles[seen]
        there = exported["status"] != "lost"
        found, angles = found[there][: len(truth)], angles[there][: len(truth)]
    if len(found) != len(truth):
        return [f"{hand}: {len(found)} frames of {len(truth)}"]
    known = np.isfinite(truth).all(-1) & np.isfinite(found).all(-1)
    if known.mean() < 0.7:
        return [f"{hand}: {known.mean():.0%} of the joints came out"]
    rows = [t for t in range(len(truth)) if known[t].sum() > 3]
    off = [1e3 * float(pa_mpjpe(found[t, known[t]], truth[t, known[t]])) for t in rows]
    out = [f"{hand}: {np.mean(off):.1f} mm off"] if np.mean(off) > MAX_MM else []
    turned = np.where(known[:, 1:], np.abs(np.rad2deg(angles - true_angles)), np.nan)
    worst = max(float(np.nanmean(turned[:, f : f + 4])) for f in range(0, 20, 4))
    out += [f"{hand}: a finger {worst:.1f} degrees off"] if worst > MAX_DEG else []
    if one.fps is not None:
        fps = 1e9 / float(np.median(np.diff(exported["time_ns"])))
        out += [f"{hand}: {fps:.4g} frames/s"] if abs(fps / one.fps - 1) > 0.02 else []
    return out


def main() -> int:
    """Run the combinations and print the counts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200, help="how many combinations")
    parser.add_argument("--first", type=int, default=0, help="the first one's number")
    parser.add_argument("--keep", type=Path, help="folder for the files that fail")
    parser.add_argument("--show", action="store_true", help="print every outcome")
    given = parser.parse_args()
    count: Counter[str] = Counter()
    for seed in range(given.first, given.first + given.seeds):
        made = combination(seed)
        with tempfile.TemporaryDirectory() as name:
            found = judge(made, Path(name))
            count[found.kind] += 1
            bad = found.kind in ("silent", "fault")
            if bad and given.keep is not None:
                shutil.copytree(name, given.keep / f"{seed:04d}", dirs_exist_ok=True)
        if bad or given.show:
            print(f"{seed} {found.kind}: {made.words} {' '.join(made.arguments)}\n    {found.why}")
            for line in found.said.splitlines():
                print(f"    {line}")
    print(", ".join(f"{kind} {count[kind]}" for kind in _KINDS), f"of {given.seeds}")
    return 1 if count["silent"] or count["fault"] else 0


_KINDS = ("right", "refused", "warned", "silent", "fault")

if __name__ == "__main__":
    sys.exit(main())
