"""One run at a time: what two would write into the same results would be a mixture."""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any
from uuid import uuid4

from handtrack.batching.store import Store, StoreError
from handtrack.errors import SettingsError

NAME = "batch.lock"
BEAT_S = 20.0
"""A run in a store says so often that it is still there."""
DEAD_S = 90.0
"""One that has not for so long is gone."""


@contextmanager
def only_run(store: Store) -> Iterator[None]:
    """Hold the results while the block runs.

    On this machine the lock is the operating system's and goes with the process, however that
    ends. In a store it is a file that is renewed; of a run that was killed it counts for 90 s,
    and not at all if its process was on this machine and is gone.

    Raises:
        SettingsError: another run holds them.
        StoreError: the store does not answer.
    """
    if store.folder is None:
        with _in_store(store):
            yield
        return
    import fcntl

    path = store.folder / NAME
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror or error}") from error
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            said = os.pread(handle, 4096, 0).decode(errors="replace")
            raise SettingsError(_taken(store, _parsed(said))) from None
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps(_own("")).encode(), 0)
        yield
    finally:
        os.close(handle)


def _own(token: str) -> dict[str, Any]:
    return {
        "host": socket.gethostname(),
        "process": os.getpid(),
        "token": token,
        "time": time.time(),
    }


def _parsed(text: str) -> dict[str, Any]:
    try:
        said = json.loads(text)
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}


def _taken(store: Store, said: dict[str, Any]) -> str:
    who = f"process {said.get('process', '?')} on {said.get('host', '?')}"
    return f"{store.place}: another run ({who}) is writing here; wait for it, or give another -o"


@contextmanager
def _in_store(store: Store) -> Iterator[None]:
    token = uuid4().hex
    said = _held(store)
    if said and not _is_dead(said):
        age = time.time() - float(said.get("time", 0))
        raise SettingsError(f"{_taken(store, said)} (heard of {age:.0f} s ago, gone after 90 s)")
    store.write(NAME, json.dumps(_own(token)).encode())
    # whoever wrote last has it
    if _held(store).get("token") != token:
        raise SettingsError(_taken(store, _held(store)))
    over = threading.Event()

    def renew() -> None:
        while not over.wait(BEAT_S):
            with suppress(StoreError):
                store.write(NAME, json.dumps(_own(token)).encode())

    beat = threading.Thread(target=renew, daemon=True)
    beat.start()
    try:
        yield
    finally:
        over.set()
        beat.join()
        with suppress(StoreError):
            store.remove(NAME)


def _held(store: Store) -> dict[str, Any]:
    try:
        return _parsed(store.read(NAME).decode(errors="replace"))
    except FileNotFoundError:
        return {}


def _is_dead(said: dict[str, Any]) -> bool:
    if time.time() - float(said.get("time", 0)) > DEAD_S:
        return True
    if said.get("host") != socket.gethostname():
        return False
    try:
        os.kill(int(said.get("process", 0)), 0)
    except (ProcessLookupError, ValueError, TypeError):
        return True
    except PermissionError:
        return False
    return False
