"""Spoil inputs of every kind, at random and on purpose, and see that each is read or refused.

    python -m tools.fuzz --seconds 120 [--inputs 100000] [--seed 1] [--only csv,ho3d] [--bombs]
        [--gadgets] [--keep DIR]

Each input is read in a process of its own that may take 5 s and 1 GB and is watched for imports,
files it writes and programs it starts. Ends that count as faults: traceback, WRONG (a value that
was not there), hang, memory, executed, warning (of a library), bad line (an error that is none).
Exit status 1 if there is one. Inputs of faults stay in DIR, with a line on each in faults.jsonl.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FINE = ("ok", "refused")
SECONDS = 5.0
_STARTING = 1800.0
"""Seconds until kernels are compiled, on a machine with other work."""
_STILL = 120
"""Seconds without any work, after which a worker waits for something that does not come."""
Case = tuple[str, str, int]


class Worker:
    """The process that reads, started anew where it does not answer."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.errors = folder, (folder / "errors").open("w+")
        self.start()

    def start(self) -> None:
        """Start it, and take what it has to say of itself."""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tools.fuzz.worker", str(self.folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            text=True,
        )
        first = self._answer(_STARTING)
        if first is None:
            self.errors.seek(0)
            raise SystemExit(f"the worker does not start: {self.errors.read()[-500:]}")
        self.about = first

    def run(self, case: Case) -> dict[str, Any]:
        """What becomes of a case."""
        stdin = self.process.stdin
        if stdin is None:
            raise SystemExit("the worker has no input")
        stdin.write(json.dumps(case) + "\n")
        stdin.flush()
        # making a bomb takes its time too
        answer = self._answer_within(2 * SECONDS + (30 if case[0] == "bomb" else 0))
        if answer is not None:
            return answer
        code = self.process.poll()
        self.process.kill()
        self.process.wait()
        self.start()
        end = "hang" if code is None else "executed" if code >= 0 else "crash"
        return {"label": str(case), "end": end, "text": f"status {code}", "seconds": SECONDS}

    def _answer_within(self, seconds: float) -> dict[str, Any] | None:
        """The answer, unless the worker takes that many seconds of the processor for it, or takes
        none any more: on a machine with other work the clock on the wall says nothing."""
        begun = self._busy_seconds()
        busy, still = begun, 0
        while busy - begun <= seconds and still < _STILL:
            answer = self._answer(1.0)
            if answer is not None or self.process.poll() is not None:
                return answer
            before, busy = busy, self._busy_seconds()
            still = still + 1 if busy == before else 0
        return None

    def _busy_seconds(self) -> float:
        """Seconds of the processor that the worker has had."""
        try:
            text = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="latin-1")
        except OSError:  # it has ended
            return 0.0
        user, system = text.rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def _answer(self, seconds: float) -> dict[str, Any] | None:
        stdout = self.process.stdout
        if stdout is None:
            return None
        with selectors.DefaultSelector() as waiting:
            waiting.register(stdout, selectors.EVENT_READ)
            if not waiting.select(seconds):
                return None
        line = stdout.readline()
        return json.loads(line) if line else None


def cases(about: dict[str, Any], options: argparse.Namespace) -> Iterator[Case]:
    """Gadgets and bombs once, then mutants of all kinds in turn, without end."""
    kinds = [k for k in about["kinds"] if options.only is None or k in options.only.split(",")]
    alone = options.bombs or options.gadgets
    some = alone or options.only is not None
    if options.gadgets or not some:
        step = 1 if options.gadgets else 17
        yield from (("gadget", "", i) for i in range(0, about["gadgets"], step))
    if options.bombs or not some:
        step = 1 if options.bombs else 9
        yield from (("bomb", "", i) for i in range(options.seed % step, about["bombs"], step))
    number = options.seed * 10**9
    while not alone:
        yield from (("mutant", kind, number) for kind in kinds)
        if number % 3 == 0:
            yield from ((way, kind, number) for kind in kinds for way in about["kinds"][kind])
        number += 1


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="how long")
    parser.add_argument("--inputs", type=int, default=10**9, help="how many at most")
    parser.add_argument("--at-least", type=int, default=1, help="fewer inputs than so many fail")
    parser.add_argument("--seed", type=int, default=1, help="other inputs for another number")
    parser.add_argument("--only", help="kinds, with commas between")
    parser.add_argument("--bombs", action="store_true", help="all bombs, nothing else")
    parser.add_argument("--gadgets", action="store_true", help="all gadgets, nothing else")
    parser.add_argument("--keep", type=Path, help="folder for inputs of faults")
    options = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    seen: set[str] = set()
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as temp:
        worker = Worker(Path(temp))
        stop = time.monotonic() + options.seconds  # what starts the worker is not counted
        for case in cases(worker.about, options):
            answer = worker.run(case)
            kind = case[1] if case[0] == "mutant" else case[0]
            counts[kind, answer["end"]] += 1
            if answer["end"] not in FINE:
                place = answer["text"].rpartition(" at ")[2]
                if f"{answer['end']} {place}" not in seen or case[0] != "mutant":
                    print(json.dumps(answer), flush=True)
                    seen.add(f"{answer['end']} {place}")
                    _keep(options.keep, Path(temp) / "case", answer, case)
            if time.monotonic() > stop or counts.total() >= options.inputs:
                break
        worker.process.kill()
        worker.process.wait()
    _table(counts)
    if counts.total() < options.at_least:
        print(f"{counts.total()} inputs are too few: {options.at_least} were asked for")
        return 1
    return int(any(end not in FINE for _, end in counts))


def _keep(keep: Path | None, case: Path, answer: dict[str, Any], of: Case) -> None:
    if keep is None or not case.is_dir():
        return
    keep.mkdir(parents=True, exist_ok=True)
    number = len(list(keep.iterdir()))
    shutil.copytree(case, keep / f"{number:04d}")
    with (keep / "faults.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps({"number": number, "case": of} | answer) + "\n")


def _table(counts: Counter[tuple[str, str]]) -> None:
    ends = sorted({end for _, end in counts}, key=lambda e: (e not in FINE, e))
    print(f"{'':16}" + "".join(f"{end:>11}" for end in ends))
    for kind in dict.fromkeys(kind for kind, _ in counts):
        print(f"{kind:16}" + "".join(f"{counts[kind, end]:11}" for end in ends))
    total = "".join(f"{sum(n for (_, e), n in counts.items() if e == end):11}" for end in ends)
    print(f"{'all':16}{total}   {sum(counts.values())} inputs")


if __name__ == "__main__":
    sys.exit(main())
