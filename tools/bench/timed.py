"""How benchmarks take times, and show them with the machine that took them."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

Array = NDArray[np.float64]
Rows = list[dict[str, Any]]


# ---- clocks ----


def each(work: Callable[..., Any], cases: list[tuple[Any, ...]], rounds: int) -> Array:
    """The shortest time of work(*case) over several rounds, for every case [s]."""
    times = np.empty((rounds, len(cases)))
    for r in range(rounds):
        for t, case in enumerate(cases):
            start = time.perf_counter_ns()
            work(*case)
            times[r, t] = time.perf_counter_ns() - start
    return np.asarray(1e-9 * times.min(0))


def machine() -> dict[str, Any]:
    """What it ran on."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    cpu = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    packages = ("handtrack", "numpy", "scipy", "numba", "rerun-sdk", "mcap")
    return {
        "cpu": cpu[0] if cpu else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 2),
        "versions": {"python": platform.python_version()} | {p: version(p) for p in packages},
    }


def show(console: Console, title: str, rows: Rows) -> None:
    """Print rows as a table, its columns in the order in which they first appear."""
    table = Table(title=title, title_justify="left")
    columns = list(dict.fromkeys(key for row in rows for key in row))
    for column in columns:
        text = isinstance(rows[0].get(column), str)
        table.add_column(column, justify="left" if text else "right")
    for row in rows:
        cells = [row.get(column, "") for column in columns]
        table.add_row(*(f"{x:.5g}" if isinstance(x, float) else str(x) for x in cells))
    console.print(table)
