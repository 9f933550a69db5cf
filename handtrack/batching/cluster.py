"""Clusters: of this machine's cores, or one that is there already."""

from __future__ import annotations

import logging
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from handtrack.batching.engine import CONNECT_S, Engine, EngineError
from handtrack.errors import SettingsError, needed

_STARTS = 3
_THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB_MAXIMUM")


def _settings(failures: int | None) -> dict[str, Any]:
    environment = {f"{name}_NUM_THREADS": 1 for name in _THREADS}
    found: dict[str, Any] = {
        "distributed.nanny.pre-spawn-environ": environment,
        "distributed.comm.timeouts.connect": f"{CONNECT_S}s",
        "distributed.admin.low-level-log-length": 0,
        "distributed.worker.memory.recent-to-old-time": "30s",
        # nobody reads it, and looking into the frames of running threads can end Python 3.11
        "distributed.worker.profile.enabled": False,
    }
    if failures is not None:
        found["distributed.scheduler.allowed-failures"] = failures
    return found


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
    distributed = needed("distributed", "whole data sets need Dask", "batch")
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
    # a client that finds nobody leaves a thread behind: so ask first, in a thread of our own
    runner = distributed.utils.LoopRunner()
    runner.start()
    try:
        with _quiet():
            try:
                distributed.utils.sync(runner.loop, _reach, distributed, address)
                client = distributed.Client(address, timeout=CONNECT_S, loop=runner.loop)
            except (OSError, TimeoutError, ValueError) as error:
                reason = str(error).partition("\n")[0] or type(error).__name__
                raise SettingsError(
                    f"--scheduler {address}: no scheduler answers there ({reason}); `dask"
                    " scheduler` starts one"
                ) from None
        try:
            yield client
        finally:
            with suppress(OSError, TimeoutError, RuntimeError):
                client.close(timeout=2)
    finally:
        with suppress(OSError, TimeoutError, RuntimeError):
            runner.stop(timeout=2)


async def _reach(distributed: Any, address: str) -> None:
    comm = await distributed.comm.connect(address, timeout=CONNECT_S)
    await comm.close()


@contextmanager
def _local(distributed: Any, workers: int, processes: bool, folder: str) -> Iterator[Any]:
    options: dict[str, Any] = {
        "n_workers": workers,
        "threads_per_worker": 1,
        "processes": processes,
        "dashboard_address": "127.0.0.1:0" if _has_dashboard() else None,
        "local_directory": folder,
        "silence_logs": "CRITICAL",
    }
    if processes:  # threads talk without sockets, and must not be given an address
        options |= {"host": "127.0.0.1", "preload": ["handtrack.batching.interrupts"]}
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
    """Ctrl-C waits meanwhile: workers that have started do not hear it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask's own words on what is told in one line anyway are not printed."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
