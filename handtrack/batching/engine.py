"""Dask, as far as it is needed: a cluster of this machine's cores, or one that is there."""

from __future__ import annotations

import platform
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

from handtrack import __version__
from handtrack.errors import HandtrackError, SettingsError, needed

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

TICK_S = 0.5
"""Progress is looked at so often."""
_COUNT_S = 2.0
"""Workers are counted so often."""
CONNECT_S = 10
_GONE_S = 20.0
"""A scheduler that has not answered for so long is gone."""


class Died(NamedTuple):
    """A task whose worker died under it.

    Attributes:
        task: it.
        worker: the last worker.
    """

    task: Any
    worker: str


class EngineError(HandtrackError):
    """The scheduler is gone, or the workers cannot do the work."""


def versions() -> tuple[str, str]:
    """Of handtrack and of Python, where this runs."""
    return __version__, ".".join(platform.python_version_tuple()[:2])


class Engine:
    """What runs functions elsewhere: a client of Dask's.

    Attributes:
        client: it.
        dashboard: the address of its dashboard, or "".
    """

    def __init__(self, client: Any, dashboard: str = "") -> None:
        self.client, self.dashboard = client, dashboard
        self._answered = self._counted = time.monotonic()
        self._workers = 0

    @property
    def workers(self) -> int:
        """How many workers there are now, each thread counted."""
        if not self._workers or time.monotonic() - self._counted > _COUNT_S:
            with suppress(OSError, TimeoutError, RuntimeError):
                self._workers = sum(self.client.nthreads().values())
            self._counted = time.monotonic()
        return self._workers

    def check(self) -> None:
        """Refuse workers that would do something else than this machine.

        Raises:
            SettingsError: a worker has another version of handtrack or of Python, or none.
        """
        here = versions()
        found = self.client.run(versions, on_error="return")
        for worker, there in found.items():
            if not isinstance(there, tuple):
                raise SettingsError(
                    f"worker {worker} cannot run handtrack {here[0]}: {there}: install it there"
                    " with pip install 'handtrack[batch]'"
                )
            if tuple(there) != here:
                raise SettingsError(
                    f"worker {worker} has handtrack {there[0]} on Python {there[1]}, this is"
                    f" {here[0]} on Python {here[1]}: install the same on both"
                )

    def warm_up(
        self,
        function: Callable[..., bool],
        *arguments: Any,
        tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Have machine code compiled by one worker of each host, and that worker started anew.

        Args:
            function: does so, and tells whether anything had to be compiled.
            arguments: its.
            tick: called now and then.

        Raises:
            EngineError: the scheduler is gone.
            HandtrackError: what the function raised.
        """
        hosts: dict[str, str] = {}
        for address in sorted(self.client.nthreads()):
            hosts.setdefault(address.rpartition(":")[0], address)
        for address in hosts.values():
            future = self.client.submit(
                _called,
                function,
                arguments[0],
                arguments[1:],
                versions(),
                workers=[address],
                allow_other_workers=True,
                pure=False,
            )
            ready = threading.Event()
            future.add_done_callback(lambda _, ready=ready: ready.set())
            while not ready.wait(TICK_S):
                tick()
                self._check_alive()
            # of a worker that died meanwhile the one that took its place compiles when asked
            if self._result(address, future) is True and not address.startswith("inproc"):
                with suppress(ValueError, OSError, TimeoutError, RuntimeError):
                    self.client.restart_workers([address], timeout=CONNECT_S)

    def results(
        self,
        function: Callable[..., _Result],
        tasks: Callable[[], _Task | None],
        arguments: tuple[Any, ...],
        most: int | None = None,
        tick: Callable[[], None] = lambda: None,
    ) -> Iterator[tuple[_Task, _Result | Died]]:
        """Run a function on tasks, as many at a time as keeps the workers busy.

        So the scheduler knows of few tasks at a time, whatever their number.

        Args:
            function: called with a task and the arguments.
            tasks: gives the next task, None when there are no more.
            arguments: of every call.
            most: tasks at a time at most. Of one at a time, one that dies with its worker takes
                no other with it.
            tick: called now and then.

        Yields:
            Each task with its result, or with word that its worker died.

        Raises:
            EngineError: the scheduler is gone.
            HandtrackError: what the function raised.
        """
        finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        waiting: dict[str, tuple[_Task, Any]] = {}
        more = True
        try:
            while True:
                # workers come and go
                width = most or 2 * max(1, self.workers)
                while more and len(waiting) < width:
                    task = tasks()
                    if task is None:
                        more = False
                        break
                    future = self.client.submit(
                        _called, function, task, arguments, versions(), pure=False, retries=0
                    )
                    waiting[future.key] = task, future
                    future.add_done_callback(finished.put)
                if not waiting:
                    return
                tick()
                try:
                    done = finished.get(timeout=TICK_S)
                except queue.Empty:
                    self._check_alive()
                    continue
                self._answered = time.monotonic()
                task, future = waiting.pop(done.key)
                yield task, self._result(task, future)
        finally:
            with suppress(RuntimeError, OSError, TimeoutError):
                self.client.cancel([future for _, future in waiting.values()], force=True)

    _answers: float = 0.0

    def _check_alive(self) -> None:
        if self.client.status == "running":
            self._answered = time.monotonic()
            return
        if self.client.status == "closed" or time.monotonic() - self._answered > _GONE_S:
            raise EngineError("the scheduler is gone")

    def _result(self, task: _Task, future: Any) -> Any:
        killed = needed("distributed", "whole data sets need Dask", "batch").KilledWorker
        if future.status in ("cancelled", "lost"):
            raise EngineError("the scheduler is gone")
        if future.status == "error":
            error = future.exception()
            if isinstance(error, killed):
                return Died(task, str(getattr(error, "last_worker", "")))
            raise error
        return future.result()


def _called(
    function: Callable[..., Any], task: Any, arguments: tuple[Any, ...], wanted: tuple[str, str]
) -> Any:
    """Call a function on a worker, if that is what the client takes it for.

    Raises:
        SettingsError: it is of another version.
    """
    here = versions()
    if here != tuple(wanted):
        raise SettingsError(
            f"a worker has handtrack {here[0]} on Python {here[1]}, the client {wanted[0]} on"
            f" Python {wanted[1]}: install the same on both"
        )
    return function(task, *arguments)
