"""Recordings in the viewer: in a window, in a browser, or as an .rrd file."""

from __future__ import annotations

import importlib.util
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from handtrack.errors import HandtrackError, SettingsError
from handtrack.recording.mcap_io import read_mcap
from handtrack.recording.rerun_log import log_rerun

LOOPBACK = "127.0.0.1"
_START_SECONDS = 30.0


def replay(
    paths: str | Path | Sequence[str | Path],
    *,
    save: str | Path | None = None,
    web: bool = False,
    port: int | None = None,
    open_viewer: bool = True,
    mesh: bool = True,
    say: Callable[[str], None] = print,
) -> Path | None:
    """Show what MCAP files hold.

    The viewer runs as a child process that ends with this call; nothing listens on any
    address but 127.0.0.1. Without `save` this returns when the viewer is closed or, for the
    browser, on Ctrl-C.

    Args:
        paths: one file or several, shown in the same world.
        save: write this .rrd file and open nothing.
        web: serve the viewer for a browser.
        port: port of the browser's page; a free one by default.
        open_viewer: with `web`, open the address in the browser too.
        mesh: draw the skin.
        say: is told, with `web`, the address once it answers.

    Returns:
        The file saved, if any.

    Raises:
        InputError: a file can't be read; see `read_mcap`.
        SettingsError: no file is given, or the port is taken.
        HandtrackError: the viewer can't be started, or writing failed.
    """
    paths = [paths] if isinstance(paths, str | Path) else list(paths)
    if not paths:
        raise SettingsError("there is no file to replay")
    tracks = [track for path in paths for track in read_mcap(path)]
    if save is not None:
        return log_rerun(tracks, save=save, mesh=mesh)
    page = _free_port(port) if web else 0
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder, _sigterm_as_exit():
        file = Path(folder) / f"{Path(paths[0]).stem}.rrd"
        log_rerun(tracks, save=file, mesh=mesh)
        try:
            if web:
                _serve(file, page, say, open_viewer)
            else:
                _window(file)
        except KeyboardInterrupt:
            # how a user says that it is enough
            return None
    return None


def _window(file: Path) -> None:
    """The native viewer, until it is closed."""
    with _viewer(file, "--port", str(_free_port())) as process:
        code = process.wait()
    if code:
        raise HandtrackError(
            f"the viewer ended with status {code}; is there a display? --web serves it to a"
            " browser, --save writes a file"
        )


def _serve(file: Path, page: int, say: Callable[[str], None], open_browser: bool) -> None:
    """The viewer for browsers, until Ctrl-C."""
    data = _free_port()
    while data == page:
        data = _free_port()
    ports = ("--port", str(data), "--web-viewer-port", str(page))
    # the server drops what exceeds its memory: the whole recording must fit
    limit = ("--server-memory-limit", f"{max(1, 2 * file.stat().st_size >> 30)}GiB")
    with _viewer(file, "--serve-web", *ports, *limit) as process:
        _wait_for(process, page)
        source = f"rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"
        address = f"http://{LOOPBACK}:{page}/?url={source}"
        say(address)
        if open_browser:
            webbrowser.open(address)
        code = process.wait()
    raise HandtrackError(f"the viewer's server ended with status {code}")


@contextmanager
def _viewer(*arguments: str | Path) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer process that ends with the block at the latest."""
    command = [str(_executable()), "--bind", LOOPBACK, *map(str, arguments)]
    environment = {"RUST_LOG": "warn", **os.environ}
    try:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, env=environment)
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


def _wait_for(process: subprocess.Popen[bytes], port: int) -> None:
    """Until the port answers.

    Raises:
        HandtrackError: the process ended, or nothing answers for 30 s.
    """
    deadline = time.monotonic() + _START_SECONDS
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise HandtrackError(f"the viewer's server ended with status {process.returncode}")
        with socket.socket() as probe:
            probe.settimeout(1)
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.05)
    raise HandtrackError(f"the viewer's server does not answer on port {port}")


def _free_port(wanted: int | None = None) -> int:
    """The port if it is free; any free one if none is wanted.

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
        return int(probe.getsockname()[1])


@contextmanager
def _sigterm_as_exit() -> Iterator[None]:
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
