"""Places that runs of a data set work at, and that can be taken away under them.

A Dask cluster of processes on loopback, and an S3 server behind a door that can be shut.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from handtrack.viewer.process import free_port

_ENVIRONMENT = {
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
    **{f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")},
}
_PLACE = ("--host", "127.0.0.1", "--no-dashboard")


def _started(*given: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *given],
        env=os.environ | _ENVIRONMENT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _ended(processes: list[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        process.terminate()
    for process in processes:
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def workers(address: str, number: int, preload: Path | None = None) -> Iterator[None]:
    """Some `dask worker` of a scheduler on loopback; each imports a file of Python first."""
    with tempfile.TemporaryDirectory(prefix="handtrack-dask-") as local:
        given = ["--nthreads", "1", "--local-directory", local, "--death-timeout", "30"]
        given += [] if preload is None else ["--preload", str(preload)]
        started = [_started("worker", address, *_PLACE, *given) for _ in range(number)]
        try:
            yield
        finally:
            _ended(started)


@contextmanager
def cluster(number: int = 2) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """`dask scheduler` and some `dask worker` on loopback: the address, and the scheduler."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = _started("scheduler", *_PLACE, "--port", str(port))
    try:
        with workers(address, number):
            yield address, scheduler
    finally:
        _ended([scheduler])


@contextmanager
def s3(port: int) -> Iterator[Proxy]:
    """An S3 server on loopback behind a door that can be shut."""
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
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
