"""The viewer as a child process: a window, or a server for browsers; it ends with its block."""

from __future__ import annotations

import importlib.util
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import IO

from handtrack.errors import HandtrackError, SettingsError

LOOPBACK = "127.0.0.1"
_START_SECONDS = 30.0


@contextmanager
def viewer(
    *arguments: str | Path, errors: IO[bytes] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer process that ends with the block at the latest; it listens on loopback only.

    Args:
        arguments: its options and files.
        errors: where to write what it says, instead of to our own standard error.

    Raises:
        HandtrackError: it is not installed, or it cannot be started.
    """
    command = [str(_executable()), "--bind", LOOPBACK, *map(str, arguments)]
    environment = {"RUST_LOG": "warn", **os.environ}
    try:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stderr=errors, env=environment
        )
    except OSError as error:
        raise HandtrackError(f"the viewer {command[0]} cannot be started: {error}") from error
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def until_closed(process: subprocess.Popen[bytes]) -> None:
    """Wait until a window is closed.

    Raises:
        HandtrackError: it ended with an error.
    """
    if code := process.wait():
        raise HandtrackError(
            f"the viewer ended with status {code}; is there a display? --web serves it to a"
            " browser, --save writes a file"
        )


def grpc_address(port: int) -> str:
    """Where a viewer on this machine takes data."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def page_address(page: int, data: int) -> str:
    """What to open in a browser."""
    return f"http://{LOOPBACK}:{page}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"


def answers(host: str, port: int, seconds: float = 1.0) -> bool:
    """Whether something listens there."""
    with socket.socket() as probe:
        probe.settimeout(seconds)
        try:
            return probe.connect_ex((host, port)) == 0
        except OSError:  # no such host
            return False


def wait_for(process: subprocess.Popen[bytes], port: int) -> None:
    """Until the port answers.

    Raises:
        HandtrackError: the process ended, or nothing answers for 30 s.
    """
    deadline = time.monotonic() + _START_SECONDS
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise HandtrackError(
                f"the viewer ended with status {process.returncode}; is there a display?"
            )
        if answers(LOOPBACK, port):
            return
        time.sleep(0.05)
    raise HandtrackError(f"the viewer does not answer on port {port}")


def free_port(wanted: int | None = None, but: int | None = None) -> int:
    """The port if it is free; any free one if none is wanted, but not `but`.

    Raises:
        SettingsError: it is taken.
    """
    with socket.socket() as probe:
        # as servers do: a connection that was just closed doesn't hold the port
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, wanted or 0))
        except (OSError, OverflowError) as error:
            raise SettingsError(f"port {wanted} cannot be used: {error}") from error
        found = int(probe.getsockname()[1])
        return found if found != but else free_port(None, but)


@contextmanager
def sigterm_as_exit() -> Iterator[None]:
    """SIGTERM raises SystemExit, so that the viewer and temporary files go too."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _executable() -> Path:
    """The viewer itself: ending rerun's console script would leave the viewer running."""
    if path := os.environ.get("RERUN_CLI_PATH"):
        return Path(path)
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise HandtrackError("the viewer is not installed: pip install rerun-sdk")
    folder = Path(package.origin).parent
    bundled = folder / "Rerun.app" / "Contents" / "MacOS" / "Rerun"
    if bundled.exists():
        return bundled
    return folder / ("rerun.exe" if sys.platform == "win32" else "rerun")
