"""Break runs of `handtrack batch` on purpose, go on, and compare with a run that nobody disturbed.

    python -m tools.bench.batch_faults WORK [--clips 24] [--frames 100] [--times 10] [--only KIND]

Kinds: client, worker, scheduler (each killed with SIGKILL when a random share of the files is
there), interrupt (Ctrl-C), poison (a clip that ends the process that reads it), disk (full, then
not; needs the right to mount), store (an S3 server of our own that vanishes; needs moto), cluster
(nothing breaks, but another scheduler does the work), version (a worker has another one). After
each fault the same command is given again until it succeeds; then the table must be that of the
undisturbed run, to the bit in its numbers, every recording there, and no unfinished file left. A
fault that comes when the run is over is none, and is tried again.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handtrack.batching.journal import read_table
from handtrack.batching.rows import RESULTS
from handtrack.batching.settings import BatchSettings, FreeHands
from handtrack.batching.store import Store
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence
from handtrack.viewer.process import free_port
from tools.bench.batch_places import cluster, s3, workers
from tools.make.data_set import Size, write

POISON = "clip00005"
_MOST = 6
"""Times that a command is given again at most."""


@dataclass(frozen=True)
class Poisoned(FreeHands):
    """Hands whose choice ends the process, for one clip."""

    def subject(self, sequence: Sequence, calibrate: Any) -> tuple[HandModel, Any]:
        """As `Models`."""
        if POISON in sequence.source:
            os._exit(77)
        return super().subject(sequence, calibrate)


class TooLate(Exception):
    """The run was over before it could be disturbed."""


@dataclass
class Bench:
    """What all faults share: the data set, and what a run of it comes to."""

    work: Path
    manifest: Path
    rng: random.Random
    wanted: Any = None
    files: int = 0

    def command(self, out: str, *more: str) -> list[str]:
        """The command that is disturbed."""
        given = ["batch", str(self.manifest), "--column", "action", "-o", out, *more]
        return [sys.executable, "-m", "handtrack", *given]

    def start(self, out: str, *more: str) -> subprocess.Popen[str]:
        """Start it, in a session of its own, so that Ctrl-C reaches it alone."""
        return subprocess.Popen(
            self.command(out, *more),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def finish(self, out: str, *more: str) -> int:
        """Give the command until it succeeds; how many times that took."""
        for times in range(1, _MOST + 1):
            done = self.start(out, *more)
            said = done.communicate()[0]
            if done.returncode == 0:
                return times
            print(f"    again, after: {said.strip().splitlines()[-1:]}")
        raise SystemExit(f"not finished after {_MOST} times")

    def done(self, out: str) -> int:
        """Files of a run that are there: subjects' hands and recordings."""
        store = Store(out)
        return len(store.names("hands")) + len(store.names("recordings"))

    def moment(self, run: subprocess.Popen[str], out: str) -> str:
        """Wait until a random share of a run is done; its words.

        Raises:
            TooLate: the run was over before.
        """
        wanted = self.rng.randrange(self.files)
        while (done := self.done(out)) < wanted and run.poll() is None:
            # a store answers slowly, and the run needs it too
            time.sleep(0.02 if Path(out).is_absolute() else 1.0)
        # between two files too, and while the workers start
        time.sleep(self.rng.uniform(0.0, 0.2 if wanted else 3.0))
        if run.poll() is not None:
            raise TooLate
        return f"at {done} of {self.files} files"

    def _difference(self, table: Any) -> str:
        """The first of what differs."""
        if table.num_rows != self.wanted.num_rows:
            return f"{table.num_rows} rows, expected {self.wanted.num_rows}"
        for name in RESULTS:
            pairs = zip(table[name].to_pylist(), self.wanted[name].to_pylist(), strict=True)
            for i, (got, wanted) in enumerate(pairs):
                if got != wanted:
                    clip, error = table["clip"][i], table["error"][i]
                    return f"{name} of {clip} is {got}, expected {wanted} ({error})"
        return "types of columns"

    def same(self, out: str) -> str:
        """Whether the results are those of the undisturbed run, in words."""
        store = Store(out)
        table = read_table(store)
        if table is None:
            return "WRONG: no table"
        if not table.select(list(RESULTS)).equals(self.wanted.select(list(RESULTS))):
            return f"WRONG: {self._difference(table)}"
        recordings = set(store.names("recordings"))
        if any(name not in recordings for name in table["recording"].to_pylist()):
            return "WRONG: a recording is missing"
        left = list(store.folder.rglob("*.part")) if store.folder is not None else []
        left += [Path(name) for name in store.names("journal")]
        return f"WRONG: {left} left behind" if left else "the same to the bit"


def children(pid: int) -> list[int]:
    """Processes that a process started, if they run Python's workers."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdecimal():
            continue
        with suppress(OSError, IndexError):
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == pid and b"spawn_main" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
    return found


def kill_client(bench: Bench, out: str) -> str:
    """The client, which here holds the scheduler too, is killed."""
    run = bench.start(out)
    moment = bench.moment(run, out)
    run.send_signal(signal.SIGKILL)
    if run.wait() == 0:
        raise TooLate
    return f"killed {moment}"


def interrupt(bench: Bench, out: str) -> str:
    """Ctrl-C."""
    run = bench.start(out)
    moment = bench.moment(run, out)
    run.send_signal(signal.SIGINT)
    begun = time.monotonic()
    said = run.communicate()[0].strip().splitlines()
    took = time.monotonic() - begun
    if run.returncode == 0:
        raise TooLate
    return f"interrupted {moment}, ended {took:.1f} s later ({run.returncode}): {said[-2:]}"


def kill_worker(bench: Bench, out: str) -> str:
    """A worker is killed; the run itself goes on."""
    run = bench.start(out)
    moment = bench.moment(run, out)
    killed = False
    while not killed and run.poll() is None:
        there = children(run.pid)
        if there:
            with suppress(ProcessLookupError):
                os.kill(bench.rng.choice(there), signal.SIGKILL)
                killed = True
        time.sleep(0.02)
    said = run.communicate()[0].strip().splitlines()
    if not killed:
        raise TooLate
    return f"killed {moment}, the run ended with {run.returncode}: {said[-1:]}"


def kill_scheduler(bench: Bench, out: str) -> str:
    """The scheduler of a cluster is killed."""
    with cluster() as (address, scheduler):
        run = bench.start(out, "--scheduler", address)
        moment = bench.moment(run, out)
        scheduler.kill()
        begun = time.monotonic()
        said = run.communicate()[0].strip().splitlines()
        took = time.monotonic() - begun
        if run.returncode == 0:
            raise TooLate
    return f"killed {moment}, told {took:.1f} s later ({run.returncode}): {said[-1:]}"


def elsewhere(bench: Bench, out: str) -> str:
    """A scheduler and two workers that are there already."""
    with cluster() as (address, _):
        run = bench.start(out, "--scheduler", address)
        said = run.communicate()[0].strip().splitlines()
    return f"ended with {run.returncode}: {said[-1:]}"


def other_version(bench: Bench, out: str) -> str:
    """One of two workers has another version."""
    preload = bench.work / "older.py"
    preload.write_text("import handtrack\n\nhandtrack.__version__ = '0.0.1'\n")
    with cluster(1) as (address, _), workers(address, 1, preload):
        run = bench.start(out, "--scheduler", address)
        said = run.communicate()[0].strip().splitlines()
    fine = run.returncode == 2 and "0.0.1" in said[-1]
    return f"{'' if fine else 'WRONG: '}ended with {run.returncode}: {said[-1:]}"


def full_disk(bench: Bench, out: str) -> str:
    """The results' disk is full in the middle of the run; then it is not."""
    Path(out).mkdir(parents=True)
    mount = ["mount", "-t", "tmpfs", "-o", "size=1500k", "tmpfs", out]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        raise SystemExit("not done: no right to mount a small disk")
    run = bench.start(out)
    said = run.communicate()[0].strip().splitlines()
    subprocess.run(["mount", "-o", "remount,size=500m", out], check=True)
    return f"ended with {run.returncode}: {said[-1:]}"


KINDS: dict[str, Callable[[Bench, str], str]] = {
    "client": kill_client,
    "worker": kill_worker,
    "scheduler": kill_scheduler,
    "interrupt": interrupt,
    "disk": full_disk,
    "cluster": elsewhere,
    "version": other_version,
}


AGAIN = ("client", "worker", "scheduler", "interrupt")
"""Kinds whose moment is random: they are tried several times."""


def poisoned(bench: Bench) -> str:
    """A clip that ends its worker each time: a row with the reason, all others are done."""
    from handtrack.batching.manifest import clips_of
    from handtrack.batching.run import Where, run

    out = str(bench.work / "poison")
    clips = clips_of([str(bench.manifest)], None, ["action"])
    settings = BatchSettings(models=Poisoned(), pool=False)
    outcome = run(clips, out, settings, Where(workers=2))
    failed = [path for path, _ in outcome.failed]
    fine = len(failed) == 1 and POISON in failed[0]
    fine &= outcome.table.num_rows == len(clips)
    verdict = "only the poisoned clip failed" if fine else f"WRONG: {outcome.failed}"
    return f"{outcome.failed[0][1] if outcome.failed else ''} -> {verdict}"


def vanishing_store(bench: Bench) -> str:
    """The store cannot be reached from the middle of the run on; later it can."""
    import fsspec

    out = "s3://results/out"
    with s3(free_port()) as door:
        fsspec.filesystem("s3").mkdir("results")
        run = bench.start(out)
        moment = bench.moment(run, out)
        door.shut()
        begun = time.monotonic()
        said = run.communicate()[0].strip().splitlines()
        took = time.monotonic() - begun
        door.open()
        fsspec.get_filesystem_class("s3").clear_instance_cache()
        times = bench.finish(out)
        verdict = bench.same(out)
    return (
        f"shut {moment}, ended {took:.1f} s later ({run.returncode}: {said[-1:]}), again"
        f" {times} x -> {verdict}"
    )


def main() -> None:
    """Break what is asked for, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("work", type=Path)
    parser.add_argument("--clips", type=int, default=24)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=[*KINDS, "poison", "store"], action="append")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    size = Size(given.clips, given.frames, subjects=3)
    bench = Bench(given.work, write(given.work / "data", size), random.Random(given.seed))
    calm = str(given.work / "undisturbed")
    shutil.rmtree(calm, ignore_errors=True)
    bench.finish(calm)
    bench.wanted, bench.files = read_table(Store(calm)), bench.done(calm)
    shutil.rmtree(calm)
    bench.finish(calm)
    print(f"undisturbed, twice: {bench.same(calm)}", flush=True)
    wrong = 0
    for kind in given.only or [*KINDS, "poison", "store"]:
        for i in range(given.times if kind in AGAIN else 1):
            said = _one(bench, kind, i)
            print(f"{kind} {i + 1}: {said}", flush=True)
            wrong += "WRONG" in said
    sys.exit(1 if wrong else 0)


def _one(bench: Bench, kind: str, number: int) -> str:
    for _ in range(_MOST):
        try:
            if kind in KINDS:
                return disturbed(bench, kind, number)
            return poisoned(bench) if kind == "poison" else vanishing_store(bench)
        except TooLate:
            print("    too late, tried again", flush=True)
    return "WRONG: never in time"


def disturbed(bench: Bench, kind: str, number: int) -> str:
    """A fault, and the results after going on."""
    out = str(bench.work / f"{kind}{number}")
    with ExitStack() as stack:
        if kind == "disk":
            stack.callback(subprocess.run, ["umount", out], check=False)
        shutil.rmtree(out, ignore_errors=True)
        said = KINDS[kind](bench, out)
        times = bench.finish(out)
        return f"{said}, again {times} x -> {bench.same(out)}"


if __name__ == "__main__":
    main()
