"""Dask, as far as it is needed: a cluster of this machine's cores, or one that is there."""

from __future__ import annotations

import os
import platform
import queue
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, TypeVar

from handtrack import __version__
from handtrack.batching.optional import needed
from handtrack.errors import HandtrackError, SettingsError

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

TICK_S = 0.5
"""Progress is looked at so often."""
_COUNT_S = 2.0
"""Workers are counted so often."""
_CONNECT_S = 10
_STARTS = 3
_GONE_S = 20.0
"""A scheduler that has not answered for so long is gone."""
_THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB_MAXIMUM")


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


def _settings(failures: int | None) -> dict[str, Any]:
    environment = {f"{name}_NUM_THREADS": 1 for name in _THREADS}
    found: dict[str, Any] = {
        "distributed.nanny.pre-spawn-environ": environment,
        "distributed.comm.timeouts.connect": f"{_CONNECT_S}s",
        "distributed.admin.low-level-log-length": 0,
        "distributed.worker.memory.recent-to-old-time": "30s",
    }
    if failures is not None:
        found["distributed.scheduler.allowed-failures"] = failures
    return found


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

    def results(
        self,
        function: Callable[..., _Result],
        tasks: Callable[[], _Task | None],
        arguments: tuple[Any, ...],
        alone: bool = False,
        tick: Callable[[], None] = lambda: None,
    ) -> Iterator[tuple[_Task, _Result | Died]]:
        """Run a function on tasks, as many at a time as keeps the workers busy.

        So the scheduler knows of few tasks at a time, whatever their number.

        Args:
            function: called with a task and the arguments.
            tasks: gives the next task, None when there are no more.
            arguments: of every call.
            alone: no task waits at a worker behind another one, so that one that dies with its
                worker takes no other with it.
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
                width = max(1, self.workers) * (1 if alone else 2)
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
        killed = needed("distributed").KilledWorker
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


@contextmanager
def engine(
    client: Any = None,
    scheduler: str | None = None,
    workers: int | None = None,
    processes: bool = True,
) -> Iterator[Engine]:
    """What runs the work while the block lasts.

    Args:
        client: of Dask's; it stays open.
        scheduler: address of a scheduler; by default a cluster of this machine's cores is made.
        workers: how many processes of this machine; by default one for each core.
        processes: whether they are processes, or threads of this one.

    Raises:
        SettingsError: Dask is not installed, no scheduler answers, or workers do not fit.
    """
    distributed = needed("distributed")
    import dask

    if client is not None:
        made = Engine(client, str(getattr(client, "dashboard_link", "") or ""))
        made.check()
        yield made
        return
    with dask.config.set(_settings(0)):
        if scheduler is not None:
            with _connected(distributed, scheduler) as remote:
                made = Engine(remote, str(remote.dashboard_link or ""))
                made.check()
                yield made
            return
        with (
            tempfile.TemporaryDirectory(prefix="handtrack-workers-") as folder,
            _local(distributed, workers or cores(), processes, folder) as cluster,
            distributed.Client(cluster, timeout=60) as local,
        ):
            yield Engine(local, str(cluster.dashboard_link) if _has_dashboard() else "")


@contextmanager
def _connected(distributed: Any, address: str) -> Iterator[Any]:
    with _quiet():
        try:
            client = distributed.Client(address, timeout=_CONNECT_S)
        except (OSError, TimeoutError, ValueError) as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise SettingsError(
                f"--scheduler {address}: no scheduler answers there ({reason}); `dask scheduler`"
                " starts one"
            ) from None
    try:
        yield client
    finally:
        with suppress(OSError, TimeoutError, RuntimeError):
            client.close(timeout=2)


@contextmanager
def _local(distributed: Any, workers: int, processes: bool, folder: str) -> Iterator[Any]:
    options = {
        "n_workers": workers,
        "threads_per_worker": 1,
        "processes": processes,
        "host": "127.0.0.1",
        "dashboard_address": "127.0.0.1:0" if _has_dashboard() else None,
        "local_directory": folder,
        "silence_logs": "CRITICAL",
    }
    with _interrupts_left_to_us():
        cluster = _started(distributed.LocalCluster, options)
    try:
        yield cluster
    finally:
        with suppress(OSError, TimeoutError, RuntimeError):
            cluster.close(timeout=10)


def _started(cluster: Callable[..., Any], options: dict[str, Any]) -> Any:
    """A cluster; a worker that dies while it starts is no reason to give up at once.

    Raises:
        EngineError: it does not start.
    """
    for left in range(_STARTS - 1, -1, -1):
        try:
            return cluster(**options)
        except (RuntimeError, OSError, TimeoutError) as error:
            if not left:
                reason = str(error).partition("\n")[0] or type(error).__name__
                raise EngineError(f"workers cannot be started: {reason}") from error
    return None


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _has_dashboard() -> bool:
    try:
        import bokeh  # noqa: F401
    except ImportError:
        return False
    return True


@contextmanager
def _interrupts_left_to_us() -> Iterator[None]:
    """Processes that are started meanwhile do not hear Ctrl-C: this one ends them in order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask's own words on what is told in one line anyway are not printed."""
    import logging

    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
