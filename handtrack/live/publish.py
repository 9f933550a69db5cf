"""Tracked hands sent on as they come: datagrams, ZeroMQ, WebSocket; a line of JSON each, or a
protobuf State.

A receiver that is slow or gone ends nothing and is never waited for. Addresses are this
machine's (127.0.0.1) unless others are given.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
import socket
import threading
from collections import deque
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from handtrack.errors import SettingsError, needed

if TYPE_CHECKING:
    from handtrack.tracking.frame import TrackedFrame

LOOPBACK = "127.0.0.1"
WAITING = 64
"""Messages that wait for a WebSocket's reader, before the oldest is dropped."""
_ADDRESS = re.compile(
    r"(?P<kind>udp|zmq|ws):(?:tcp:)?(?://)?(?:(?P<host>[^:/]+|\[[^]]+\]):)?(?P<port>\d{1,5})/?"
)
_DECIMALS = 6


class Publisher(Protocol):
    """Where messages go; a context manager."""

    address: str

    def send(self, message: bytes) -> None:
        """The next message."""

    def __enter__(self) -> Publisher: ...

    def __exit__(self, *error: object) -> None: ...


def message_of(frame: TrackedFrame, hand: str, index: int) -> bytes:
    """A frame as a line of JSON; what is not known is null.

    Keys: `time_ns`, `frame`, `hand`, `status`, `reason`; of the filtered pose `joints_m` (21 x 3),
    `angles_rad` (20), `quaternion_wxyz` and `translation_m` (root to world); `error_mm`, the mean
    distance of the fitted to the observed joints.
    """
    error = np.linalg.norm(frame.fitted_joints - frame.observed, axis=-1)
    seen = error[np.isfinite(error)]
    values = {
        "time_ns": int(frame.time_ns),
        "frame": int(index),
        "hand": hand,
        "status": str(frame.status),
        "reason": str(frame.reason),
        "joints_m": _plain(frame.filtered_joints),
        "angles_rad": _plain(frame.angles),
        "quaternion_wxyz": _plain(frame.quaternion),
        "translation_m": _plain(frame.translation),
        "error_mm": round(1e3 * float(seen.mean()), 3) if len(seen) else None,
    }
    return json.dumps(values, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def state_of(frame: TrackedFrame, index: int) -> bytes:
    """A frame as the protobuf message handtrack.State, as recordings hold it (`handtrack.proto`).

    A State does not name its hand.
    """
    from dataclasses import fields

    from handtrack.hand.model import HandModel
    from handtrack.mcap.state import States, encode_states
    from handtrack.tracking.frame import TrackedFrame as Frame

    arrays: dict[str, Any] = {f.name: np.array([getattr(frame, f.name)]) for f in fields(Frame)}
    states = States(frame_index=np.array([index], np.int64), truth=None, **arrays)
    (message,) = encode_states(states, slice(None), HandModel.default())
    return message


def _plain(values: Any) -> Any:
    """Lists of numbers with 6 decimals, null where they are not finite."""

    def cell(x: Any) -> Any:
        if isinstance(x, list):
            return [cell(y) for y in x]
        return round(x, _DECIMALS) if math.isfinite(x) else None

    return cell(np.asarray(values, dtype=np.float64).tolist())


def publisher(address: str, binary: bool = False) -> Publisher:
    """What sends to an address: `udp:[HOST:]PORT` sends datagrams there; `zmq:[HOST:]PORT` and
    `ws://[HOST:]PORT` wait here for whoever subscribes.

    Args:
        address: it.
        binary: whether messages are no text, for WebSockets, which tell them apart.

    Raises:
        SettingsError: it is none, or what it needs is not installed.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 <= int(found["port"]) <= 65535:
        raise SettingsError(
            f"--publish {address} is no address, expected udp:HOST:PORT, zmq:HOST:PORT or"
            " ws://HOST:PORT"
        )
    host, port = found["host"] or LOOPBACK, int(found["port"])
    if found["kind"] == "udp":
        return _Datagrams(host, port)
    return _ZeroMQ(host, port) if found["kind"] == "zmq" else _WebSocket(host, port, binary)


class _Datagrams:
    def __init__(self, host: str, port: int) -> None:
        if port == 0:
            raise SettingsError("--publish udp: expected the port of whoever listens, not 0")
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
        except OSError as error:
            raise SettingsError(f"--publish udp:{host}:{port}: {error.strerror}") from None
        self._to: Any = found[0][4]
        self._socket = socket.socket(found[0][0], socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.address = f"udp:{host}:{port}"

    def send(self, message: bytes) -> None:
        # nobody need listen, and none is waited for
        with contextlib.suppress(OSError):
            self._socket.sendto(message, self._to)

    def __enter__(self) -> _Datagrams:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()


class _ZeroMQ:
    def __init__(self, host: str, port: int) -> None:
        self._zmq = zmq = needed("zmq", "--publish zmq: needs pyzmq", "live")
        self._context: Any = zmq.Context()
        self._socket: Any = self._context.socket(zmq.PUB)
        self._socket.setsockopt(zmq.LINGER, 200)
        where = f"tcp://{host}:{port or '*'}"
        try:
            self._socket.bind(where)
        except zmq.ZMQError as error:
            self.__exit__()
            raise SettingsError(f"--publish zmq: cannot listen at {where}: {error}") from None
        endpoint: Any = self._socket.last_endpoint
        self.address = "zmq:" + endpoint.decode().rstrip("\0")

    def send(self, message: bytes) -> None:
        with contextlib.suppress(self._zmq.Again):
            self._socket.send(message, self._zmq.NOBLOCK)

    def __enter__(self) -> _ZeroMQ:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
        self._context.term()


class _WebSocket:
    def __init__(self, host: str, port: int, binary: bool) -> None:
        self._binary = binary
        server = needed("websockets.sync.server", "--publish ws: needs websockets", "live")
        self._readers: set[_Reader] = set()
        self._lock = threading.Lock()
        try:
            self._server: Any = server.serve(self._read, host.strip("[]"), port)
        except OSError as error:
            raise SettingsError(
                f"--publish ws: cannot listen at {host}:{port}: {error.strerror}"
            ) from None
        bound = self._server.socket.getsockname()[1]
        self.address = f"ws://{host}:{bound}"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def _read(self, connection: Any) -> None:
        """One who listens, in a thread of his own, until either side ends."""
        from websockets.exceptions import ConnectionClosed

        reader = _Reader()
        with self._lock:
            self._readers.add(reader)
        try:
            for message in reader:
                connection.send(message if self._binary else message.decode().rstrip("\n"))
        except ConnectionClosed:
            pass
        finally:
            with self._lock:
                self._readers.discard(reader)

    def send(self, message: bytes) -> None:
        with self._lock:
            readers = list(self._readers)
        for reader in readers:
            reader.put(message)

    def __enter__(self) -> _WebSocket:
        return self

    def __exit__(self, *error: object) -> None:
        with self._lock:
            readers = list(self._readers)
        for reader in readers:
            reader.end()
        self._server.shutdown()
        self._thread.join(2)


class _Reader:
    """Messages that wait for one reader."""

    def __init__(self) -> None:
        self._items: deque[bytes] = deque(maxlen=WAITING)
        self._ready = threading.Condition()
        self._ended = False

    def put(self, message: bytes) -> None:
        with self._ready:
            self._items.append(message)
            self._ready.notify()

    def end(self) -> None:
        with self._ready:
            self._ended = True
            self._ready.notify()

    def __iter__(self) -> Iterator[bytes]:
        while True:
            with self._ready:
                while not self._items and not self._ended:
                    self._ready.wait()
                if not self._items:
                    return
                message = self._items.popleft()
            yield message
