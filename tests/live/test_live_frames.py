"""Frames as they come: the newest is kept, what was dropped is counted."""

from __future__ import annotations

import io
import socket
import threading

import pytest

from handtrack.errors import InputError, SettingsError
from handtrack.live.sources import Newest, datagrams, in_background, lines


def test_a_slow_reader_gets_the_newest_and_the_count():
    queue: Newest[int] = Newest(2)
    for i in range(7):
        queue.put(i)
    queue.end()
    assert list(queue) == [5, 6]
    assert queue.dropped == 5


def test_a_reader_waits_for_what_comes():
    go = threading.Event()

    def fill(queue):
        go.wait(5)
        queue.put("a")

    queue = in_background(fill)
    reader = iter(queue)
    go.set()
    assert next(reader) == "a"
    assert list(reader) == []
    assert queue.dropped == 0


def test_an_error_of_the_source_reaches_the_reader():
    def fill(queue):
        queue.put(1)
        raise InputError("gone", "camera 0")

    reader = iter(in_background(fill))
    assert next(reader) == 1
    with pytest.raises(InputError, match="camera 0: gone"):
        next(reader)


def test_lines_of_a_stream():
    assert list(lines(io.BytesIO(b'{"a": 1}\n\n{"a": 2}\n'))) == [b'{"a": 1}\n', b'{"a": 2}\n']


def test_datagrams_arrive_on_loopback():
    queue, (host, port) = datagrams("0")
    assert host == "127.0.0.1"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"hello", (host, port))
    assert next(iter(queue)) == b"hello"
    with pytest.raises(SettingsError, match=f"cannot listen at 127.0.0.1:{port}"):
        datagrams(f"127.0.0.1:{port}")
    queue.end()
    for address in ("localhost", "a:b", "1:99999"):
        with pytest.raises(SettingsError, match="expected HOST:PORT"):
            datagrams(address)
