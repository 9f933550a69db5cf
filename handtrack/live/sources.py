"""Frames as they come: pictures of a camera or of a file in real time, joints as JSON lines.

A camera and datagrams never make their reader wait for what is old: they hold the newest frames
and count those that they had to drop. A pipe is read as fast as its frames are tracked.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

import numpy as np

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.video.media import Picture, opencv, pictures

_Item = TypeVar("_Item")

LOOPBACK = "127.0.0.1"
WAITING = 3
"""Pictures that wait for a slow moment to pass, before the oldest is dropped."""
MAX_DATAGRAM = 65_536
_POLL_S = 0.2


@dataclass
class Newest(Generic[_Item]):
    """A short queue from one thread to another; what does not fit pushes the oldest out, or waits.

    Attributes:
        size: how many items wait at most.
        patient: whether what does not fit waits until there is room, and nothing is dropped.
        dropped: how many were pushed out.
    """

    size: int = 1
    dropped: int = 0
    patient: bool = False
    _items: deque[_Item] = field(default_factory=deque)
    _ready: threading.Condition = field(default_factory=threading.Condition)
    _ended: bool = False
    _error: BaseException | None = None

    def put(self, item: _Item) -> None:
        with self._ready:
            while self.patient and len(self._items) >= self.size and not self._ended:
                self._ready.wait(_POLL_S)
            if len(self._items) >= self.size:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._ready.notify_all()

    def end(self, error: BaseException | None = None) -> None:
        """Nothing more comes; an error is raised for the reader."""
        with self._ready:
            self._ended, self._error = True, error
            self._ready.notify_all()

    @property
    def ended(self) -> bool:
        return self._ended

    def __iter__(self) -> Iterator[_Item]:
        while True:
            with self._ready:
                # a wait without an end could not be interrupted by Ctrl-C everywhere
                while not self._items and not self._ended:
                    self._ready.wait(_POLL_S)
                if not self._items:
                    if self._error is not None:
                        raise self._error
                    return
                item = self._items.popleft()
                self._ready.notify_all()
            yield item


def in_background(
    fill: Callable[[Newest[_Item]], None], size: int = 1, patient: bool = False
) -> Newest[_Item]:
    """A queue that a thread of its own fills; the thread dies with the program."""
    queue: Newest[_Item] = Newest(size, patient=patient)

    def run() -> None:
        try:
            fill(queue)
        except (HandtrackError, OSError) as error:
            queue.end(error)
        else:
            queue.end()

    threading.Thread(target=run, daemon=True).start()
    return queue


def file_in_real_time(path: Path) -> Newest[Picture]:
    """The pictures of a video when they are due by its own clock."""

    def fill(queue: Newest[Picture]) -> None:
        begun = first = None
        for picture in pictures(path):
            if begun is None or first is None:
                begun, first = time.monotonic_ns(), picture.time_ns
            wait = (begun + picture.time_ns - first - time.monotonic_ns()) * 1e-9
            if wait > 0:
                time.sleep(wait)
            queue.put(picture)
            if queue.ended:
                return

    return in_background(fill, WAITING)


def camera(index: int) -> Newest[Picture]:
    """The pictures of a camera of this machine, stamped with the time since the first.

    Raises (when read):
        InputError: there is no such camera, or it stops giving pictures.
        SettingsError: OpenCV is missing.
    """

    def fill(queue: Newest[Picture]) -> None:
        cv2 = opencv()
        # it says of a camera that is not there what is said below, in many lines
        logging = cv2.utils.logging
        before = logging.setLogLevel(logging.LOG_LEVEL_SILENT)
        try:
            device = cv2.VideoCapture(index)
        finally:
            logging.setLogLevel(before)
        where = Path(f"camera {index}")
        if not device.isOpened():
            raise InputError("there is no such camera, or it is in use", where)
        try:
            begun, n = time.monotonic_ns(), 0
            while not queue.ended:
                there, bgr = device.read()
                if not there:
                    raise InputError(f"no picture after {n}", where)
                now = time.monotonic_ns() - begun
                queue.put(Picture(n, now, np.ascontiguousarray(bgr[..., ::-1]), where))
                n += 1
        finally:
            device.release()

    return in_background(fill, WAITING)


def lines(stream: IO[bytes] | None = None, size: int = 8) -> Newest[bytes]:
    """Lines of a stream, standard input by default; whoever writes it waits for the reader."""
    stream = stream or sys.stdin.buffer

    def fill(queue: Newest[bytes]) -> None:
        for line in stream:
            if line.strip():
                queue.put(line)

    return in_background(fill, size, patient=True)


def datagrams(address: str, size: int = 8) -> tuple[Newest[bytes], tuple[str, int]]:
    """What arrives at a UDP address, and where it listens.

    Args:
        address: HOST:PORT, or PORT alone for this machine only (127.0.0.1); port 0: any.

    Raises:
        SettingsError: the address makes no sense or is taken.
    """
    import socket

    host, _, text = address.rpartition(":")
    host = host or LOOPBACK
    if not text.isdigit() or int(text) > 65535:
        raise SettingsError(f"{address} is no address, expected HOST:PORT or PORT")
    opened: Any = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.bind((host, int(text)))
    except OSError as error:
        opened.close()
        raise SettingsError(f"cannot listen at {address}: {error.strerror or error}") from None

    def fill(queue: Newest[bytes]) -> None:
        with opened:
            opened.settimeout(_POLL_S)
            while not queue.ended:
                try:
                    queue.put(opened.recv(MAX_DATAGRAM))
                except TimeoutError:
                    continue

    bound = opened.getsockname()
    return in_background(fill, size), (str(bound[0]), int(bound[1]))
