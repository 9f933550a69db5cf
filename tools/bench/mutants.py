"""Seed faults into the package, one at a time, and see whether the tests notice them.

    python -m tools.bench.mutants handtrack/kernels handtrack/tracking [--count 72] [--seed 1]
        [--times TIMES] [--budget 60] [--json OUT]

The faults stand one after another in a copy of the project, so that only what depends on one is
compiled again. First the tests are run without a fault, and what each takes is kept (--times): of
the module's package (see TESTS) and those that name a module of the places. With a fault the
tests nearest to its module are run first (the one named as it, those that import it, those that
import what imports it), quick ones before slow ones, until one fails or the budget of processor
seconds is used up. Kernels are tried as plain Python first (see `interpreted`), and compiled only
if that sees nothing.
A fault that all of them pass is printed with its place: it is a hole in the tests, or makes no
difference. Exit status 1 if more than --survive of the faults survive.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tools.bench.distance import distances
from tools.bench.seeding import Finder, Mutant, again, mutants

__all__ = ["Finder", "main"]

ROOT = HERE = Path(__file__).resolve().parents[2]
COPIED = (
    "handtrack",
    "tests",
    "tools",
    "recordings",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
)
TESTS = {
    "kernels": ["tests/kernels", "tests/fitting", "tests/tracking"],
    "fitting": ["tests/fitting", "tests/tracking"],
    "mcap": ["tests/mcap", "tests/recording"],
    "viewer": ["tests/viewer"],
    "exporting": ["tests/exporting"],
    "live": ["tests/live"],
    "files": ["tests/mcap", "tests/recording", "tests/sequences"],
}
"""Where a package's tests are, if not in the folder of its name."""

PLAIN, COMPILED = "plain", "compiled"
Times = dict[str, dict[str, float]]
"""By PLAIN and COMPILED: what each test that passes takes [s of CPU]."""


@dataclass(frozen=True)
class Limits:
    """Processor seconds.

    Attributes:
        test: for one test; one that takes more has noticed something: time to compile is in it.
        budget: for the tests of a fault in one way of running: none is begun after it.
    """

    test: float = 90.0
    budget: float = 60.0

    @property
    def hard(self) -> int:
        """When a process is ended, which no Python code can do inside compiled code."""
        return int(4 * self.budget + 4 * self.test)


class Copy:
    """A copy of the project, with what it has compiled: files keep their times, as that needs."""

    def __init__(self, folder: Path, limits: Limits):
        self._folder, self._limits = folder, limits
        for name in COPIED:
            if (ROOT / name).exists():
                copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
                copy(ROOT / name, folder / name)

    def _run(self, way: str, names: list[str], limits: Limits, **plan: Any) -> tuple[int, str]:
        told = self._folder / "plan.json"
        told.write_text(json.dumps({"limit": limits.test, "budget": limits.budget, **plan}))
        environment = {
            **os.environ,
            "PYTHONPATH": f"{self._folder}{os.pathsep}{HERE}",
            "OPENBLAS_NUM_THREADS": "1",
            "QUICK_TESTS": str(told),
            "COLUMNS": "400",  # why a test failed is not cut off
        }
        command = [sys.executable, "-m", "pytest", "-q", "-n0", "--tb=no"]
        command += ["-p", "no:cacheprovider", "-p", "tools.bench.quick_tests"]
        command += ["-p", "tools.bench.interpreted"] if way == PLAIN else []

        def limited() -> None:
            resource.setrlimit(resource.RLIMIT_CPU, (limits.hard, limits.hard + 5))

        run = subprocess.run(
            [*command, *names],
            cwd=self._folder,
            env=environment,
            capture_output=True,
            text=True,
            preexec_fn=limited,
            check=False,
        )
        return run.returncode, run.stdout

    def times(self, way: str, names: list[str]) -> dict[str, float]:
        """What tests take without a fault, of those that pass within their limit."""
        found = self._folder / "times.json"
        long = Limits(self._limits.test, 3600.0)
        self._run(way, names, long, record=str(found))
        taken: dict[str, float] = json.loads(found.read_text())
        return taken

    def noticed(self, mutant: Mutant, times: Times) -> str:
        """The test that notices a fault; "" for none. The copy is put back."""
        path = self._folder / mutant.path
        data, stamp = path.read_bytes(), path.stat()
        path.write_bytes(data[: mutant.start] + mutant.text.encode() + data[mutant.end :])
        try:
            for way in ways(mutant.path):
                for order in ordered(mutant.path, times[way]):
                    if by := self._seen(way, order):
                        return f"{by} ({way})"
            return ""
        finally:
            path.write_bytes(data)
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))

    def _seen(self, way: str, order: list[str]) -> str:
        if not order:
            return ""
        files = list(dict.fromkeys(name.split("::")[0] for name in order))
        status, said = self._run(way, ["-x", *files], self._limits, order=order)
        if status in (0, 5):
            return ""
        failed = [line for line in said.splitlines() if line.startswith(("FAILED", "ERROR"))]
        if not failed:
            return f"the tests end with {status}"
        name, _, why = failed[0].partition(" - ")
        return f"{name}, which took too long" if "TooLong" in why else name


def ways(path: str) -> tuple[str, ...]:
    """How the tests of a module are run."""
    return (PLAIN, COMPILED) if Path(path).parts[1] == "kernels" else (COMPILED,)


def ordered(path: str, times: dict[str, float]) -> tuple[list[str], list[str]]:
    """Tests that import a module, and the others: nearer ones first, and quick ones of them.

    They are two runs, as loading the others takes longer than most of the first.
    """
    files = sorted({name.split("::")[0] for name in times})
    near = distances(ROOT, path, files)
    steps = {name: near[file] for name in times if (file := name.split("::")[0]) in near}
    reached = sorted(steps, key=lambda name: (steps[name], times[name]))
    first = [name for name in reached if steps[name] <= 1]
    return first, reached[len(first) :]


def tests_of(places: list[str]) -> list[str]:
    """Folders and files of tests for some files or folders of the package."""
    rooms = {Path(place).parts[1].removesuffix(".py") for place in places}
    named = [name for room in sorted(rooms) for name in TESTS.get(room, [f"tests/{room}"])]
    found = {name for name in named if (ROOT / name).exists()}
    for place in places:
        near = distances(ROOT, place, [str(p.relative_to(ROOT)) for p in _test_files()])
        found |= {name for name, steps in near.items() if steps <= 1}
    inside = tuple(f"{name}/" for name in found)
    return sorted(name for name in found if not name.startswith(inside))


def _test_files() -> list[Path]:
    return sorted((ROOT / "tests").rglob("test_*.py"))


def measured(copy: Copy, places: list[str], file: Path | None) -> Times:
    """What tests take, from a file or by running them; kept in the file."""
    if file and file.exists():
        known: Times = json.loads(file.read_text())
        return known
    wanted = {way for place in places for way in ways(place)}
    taken = {way: copy.times(way, tests_of(places)) for way in sorted(wanted)}
    if file:
        file.write_text(json.dumps(taken, indent=0) + "\n")
    return taken


def main(arguments: list[str] | None = None) -> int:
    """Seed faults, print what survived, and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("places", nargs="+", help="files or folders, as handtrack/tracking")
    parser.add_argument("--count", type=int, default=72)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--times", type=Path, help="what tests take; made if it is not there")
    parser.add_argument("--budget", type=float, default=60, help="CPU seconds of a fault's tests")
    parser.add_argument("--survive", type=float, default=0.05, help="share that may survive")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write what became of each")
    parser.add_argument("--again", type=Path, metavar="OUT", help="only what survived there")
    options = parser.parse_args(arguments)
    survived, told = 0, []
    if options.again:
        left = [old for old in json.loads(options.again.read_text()) if not old["noticed"]]
        chosen = again(ROOT, left)
    else:
        chosen = mutants(ROOT, options.places, options.count, options.seed)
    with tempfile.TemporaryDirectory(prefix="mutant") as folder:
        copy = Copy(Path(folder), Limits(budget=options.budget))
        times = measured(copy, options.places, options.times)
        for number, mutant in enumerate(chosen, 1):
            before = _spent()
            by = copy.noticed(mutant, times)
            spent = round(_spent() - before, 1)
            survived += not by
            told.append({**asdict(mutant), "noticed": by, "seconds": spent})
            what = f"SURVIVED: {mutant.before!r} -> {mutant.text!r}"
            said = f"noticed by {by}" if by else what
            place = f"{mutant.path}:{mutant.line}"
            print(f"{number}/{len(chosen)} {place} {mutant.kind} [{spent} s]: {said}", flush=True)
            if options.json:
                options.json.write_text(json.dumps(told, indent=1) + "\n")
    print(f"{survived} of {len(chosen)} faults survived")
    return int(survived > options.survive * len(chosen))


def _spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    sys.exit(main())
