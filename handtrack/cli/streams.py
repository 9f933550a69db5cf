"""Standard output and error as they are given to us: closed ones, and those of odd alphabets."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

STOPPED, INTERRUPTED, NOT_READ = 128 + signal.SIGTERM, 128 + signal.SIGINT, 128 + 13
"""Exit statuses of a command that was told to end, by Ctrl-C too, or whose output nobody reads any
more: as shells know them."""


class _Closed(io.TextIOBase):
    """A standard output that is not there: nothing is lost in silence."""

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        raise OSError(errno.EBADF, "standard output is closed")


def usable_streams() -> None:
    """Make the standard streams such that nothing we print can fail for its letters.

    Where one is closed its number is taken: else the next file that is opened has it, and what
    any library prints goes into a recording.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            with suppress(OSError):
                os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = _Closed()
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - until the end
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


@contextmanager
def stopping() -> Iterator[None]:
    """SIGTERM ends the block as an error would: parts are kept or removed, and told."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, frame: FrameType | None) -> None:
        # once is enough: what ends must not be stopped while it does
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise SystemExit(STOPPED)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
