"""Break runs of `handtrack batch` on purpose, go on, and compare with a run that nobody disturbed.

    python -m tools.bench.batch_faults WORK [--clips 24] [--frames 100] [--times 10] [--only KIND]

Kinds: client, worker, scheduler (each killed with SIGKILL at a random time), interrupt (Ctrl-C),
poison (a clip that ends the process that reads it), disk (full, then not; needs the right to
mount), store (an S3 server of our own that vanishes; needs moto). After each fault the same
command is given again until it succeeds; then the table must be that of the undisturbed run, to
the bit in its numbers, every recording there, and no unfinished file left.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handtrack.batching.journal import read_table
from handtrack.batching.rows import RESULTS
from handtrack.batching.settings import BatchSettings, FreeHands
from handtrack.batching.store import Store
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence
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


@dataclass
class Bench:
    """What all faults share: the data set, and what a run of it comes to."""

    work: Path
    manifest: Path
    rng: random.Random
    wanted: Any = None
    seconds: float = 0.0

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

    def moment(self) -> float:
        """A random time of an undisturbed run [s]."""
        return self.rng.uniform(0.1, 1.0) * self.seconds

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
    moment = bench.moment()
    time.sleep(moment)
    run.send_signal(signal.SIGKILL)
    run.wait()
    return f"killed at {moment:.1f} s"


def interrupt(bench: Bench, out: str) -> str:
    """Ctrl-C."""
    run = bench.start(out)
    moment = bench.moment()
    time.sleep(moment)
    run.send_signal(signal.SIGINT)
    begun = time.monotonic()
    said = run.communicate()[0].strip().splitlines()
    took = time.monotonic() - begun
    return (
        f"interrupted at {moment:.1f} s, ended {took:.1f} s later ({run.returncode}): {said[-2:]}"
    )


def kill_worker(bench: Bench, out: str) -> str:
    """A worker is killed; the run itself goes on."""
    run = bench.start(out)
    until = time.monotonic() + 2 * bench.seconds
    moment = bench.moment()
    time.sleep(moment)
    while time.monotonic() < until and run.poll() is None:
        there = children(run.pid)
        if there:
            with suppress(ProcessLookupError):
                os.kill(bench.rng.choice(there), signal.SIGKILL)
            break
        time.sleep(0.05)
    said = run.communicate()[0].strip().splitlines()
    return f"killed at {moment:.1f} s, the run ended with {run.returncode}: {said[-1:]}"


@contextmanager
def cluster(workers: int = 2) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """`dask scheduler` and some `dask worker` on loopback: the address, and the scheduler."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m", "dask"]
    environment = os.environ | {
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
        "NUMBA_NUM_THREADS": "1",
    }
    place = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = subprocess.Popen(
        [*dask, "scheduler", *place, "--port", str(port)], env=environment, **quiet
    )
    local = tempfile.gettempdir()
    started = [
        subprocess.Popen(
            [
                *(*dask, "worker", address, *place, "--nthreads", "1"),
                *("--local-directory", f"{local}/handtrack-dask-{port}", "--death-timeout", "30"),
            ],
            env=environment,
            **quiet,
        )
        for _ in range(workers)
    ]
    try:
        yield address, scheduler
    finally:
        for process in (*started, scheduler):
            process.terminate()
        for process in (*started, scheduler):
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
        shutil.rmtree(f"{local}/handtrack-dask-{port}", ignore_errors=True)


def kill_scheduler(bench: Bench, out: str) -> str:
    """The scheduler of a cluster is killed."""
    with cluster() as (address, scheduler):
        run = bench.start(out, "--scheduler", address)
        moment = bench.moment()
        time.sleep(moment)
        scheduler.kill()
        begun = time.monotonic()
        said = run.communicate()[0].strip().splitlines()
        took = time.monotonic() - begun
    return f"killed at {moment:.1f} s, told {took:.1f} s later ({run.returncode}): {said[-1:]}"


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


@contextmanager
def s3(port: int) -> Iterator[Proxy]:
    """An S3 server on loopback behind a door that can be shut."""
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    server.start()
    door = Proxy(port)
    os.environ |= {
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{door.port}",
    }
    try:
        yield door
    finally:
        door.shut()
        server.stop()


class Proxy:
    """Passes connections on to a port, while it is open.

    Attributes:
        port: its own.
    """

    def __init__(self, to: int) -> None:
        self._to, self.port = to, 0
        self._open: list[socket.socket] = []
        self._listener: socket.socket | None = None
        self.open()

    def open(self) -> None:
        """Let connections in."""
        listener = socket.create_server(("127.0.0.1", self.port))
        self.port, self._listener = listener.getsockname()[1], listener
        threading.Thread(target=self._accept, args=(listener,), daemon=True).start()

    def shut(self) -> None:
        """End all connections, and let none in."""
        if self._listener is not None:
            with suppress(OSError):
                self._listener.shutdown(socket.SHUT_RDWR)
            self._listener.close()
        for one in self._open:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()
        self._open, self._listener = [], None

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):
            while True:
                one, _ = listener.accept()
                other = socket.create_connection(("127.0.0.1", self._to))
                self._open += [one, other]
                for a, b in ((one, other), (other, one)):
                    threading.Thread(target=_passed, args=(a, b), daemon=True).start()


def _passed(a: socket.socket, b: socket.socket) -> None:
    with suppress(OSError):
        while data := a.recv(65536):
            b.sendall(data)
    with suppress(OSError):
        b.shutdown(socket.SHUT_WR)


def vanishing_store(bench: Bench) -> str:
    """The store cannot be reached from the middle of the run on; later it can."""
    import fsspec

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with s3(port) as door:
        fsspec.filesystem("s3").mkdir("results")
        run = bench.start("s3://results/out")
        moment = bench.moment() + 2
        time.sleep(moment)
        door.shut()
        said = run.communicate()[0].strip().splitlines()
        door.open()
        fsspec.filesystem("s3").clear_instance_cache()
        time.sleep(1)
        # the lock of a run that could not give it back counts as long as its process is there
        times = bench.finish("s3://results/out")
        verdict = bench.same("s3://results/out")
    return f"shut at {moment:.1f} s ({run.returncode}: {said[-1:]}), again {times} x -> {verdict}"


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
    bench.wanted = read_table(Store(calm))
    shutil.rmtree(calm)
    begun = time.monotonic()
    bench.finish(calm)
    bench.seconds = time.monotonic() - begun
    print(f"undisturbed: {bench.seconds:.1f} s, twice {bench.same(calm)}", flush=True)
    wrong = 0
    for kind in given.only or [*KINDS, "poison", "store"]:
        for i in range(
            given.times if kind in ("client", "worker", "scheduler", "interrupt") else 1
        ):
            if kind in KINDS:
                said = disturbed(bench, kind, i)
            else:
                said = poisoned(bench) if kind == "poison" else vanishing_store(bench)
            print(f"{kind} {i + 1}: {said}", flush=True)
            wrong += "WRONG" in said
    sys.exit(1 if wrong else 0)


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
