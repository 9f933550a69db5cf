"""Kernels as the Python that they are written in, for whole fits, filters and smoothers.

    python -m pytest -n0 -p tools.bench.interpreted tests/kernels

Nothing is compiled: a changed kernel is tried on a few frames at once, where compiling it anew
takes a minute. A frame takes some hundred times longer. What only the compiler does differently
(integers that overflow, division by zero) is not seen here; tests that need it fail.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache, wraps
from typing import Any

os.environ["NUMBA_DISABLE_JIT"] = "1"

import numba
import numpy as np

from handtrack.kernels import compiled


class Rows(np.ndarray):
    """(T,) Records: what an index gives is a view with the fields as attributes."""

    def __getitem__(self, key: Any) -> Any:
        found = super().__getitem__(key)
        return record(found) if isinstance(found, np.void) else found

    def __setitem__(self, key: Any, value: Any) -> None:
        super().__setitem__(key, getattr(value, "_row", value))


class Record:
    """One record: arrays are views, scalars are written through."""

    def __init__(self, row: np.void):
        self._row = row

    def __getattr__(self, name: str) -> Any:
        value = self.__dict__[name] = self._row[name]
        return value

    def __getitem__(self, name: str) -> Any:
        return self._row[name]

    def __setitem__(self, name: str, value: Any) -> None:
        self._row[name] = value


@cache
def _kind(dtype: Any) -> type[Record]:
    def scalar(name: str) -> property:
        def put(self: Any, value: Any) -> None:
            self._row[name] = value

        return property(lambda self: self._row[name], put)

    scalars = {name: scalar(name) for name in dtype.names if not dtype[name].shape}
    return type("Record", (Record,), scalars)


def record(row: np.void) -> Record:
    """A view of a row."""
    return _kind(row.dtype)(row)


def _taken(value: Any) -> Any:
    """An argument as compiled code sees it."""
    if isinstance(value, tuple):
        parts = [_taken(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if isinstance(value, np.ndarray):
        plain = value.view(np.ndarray)
        return plain.view(Rows) if value.dtype.names else plain
    return record(value) if isinstance(value, np.void) else value


class _NumPy:
    """NumPy, of which records are made as `Rows`."""

    def __getattr__(self, name: str) -> Any:
        found = getattr(np, name)
        if name not in ("zeros", "empty"):
            return found
        return lambda *args, **options: _taken(found(*args, **options))


def _prepared(function: Any) -> Any:
    if "np" in function.__globals__:
        function.__globals__["np"] = _NumPy()
    function.py_func = function
    return function


def _kernel(function: Any) -> Any:
    function = _prepared(function)

    @wraps(function)
    def called(*args: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*map(_taken, args))

    called.__dict__["py_func"] = function
    return called


_solvers: dict[int, Callable[..., Any]] = {}


class _Solver(compiled.Solver):
    """A solver whose address is a number of its own."""

    def __init__(self, function: Callable[..., Any]):
        super().__init__(_prepared(function))
        self.__dict__["address"] = 1 + len(_solvers)
        _solvers[1 + len(_solvers)] = self.function


def _call(solver: Any, work: Any) -> None:
    if isinstance(solver, compiled.Solver):
        solver.function(work)
    else:
        _solvers[int(solver)](work)


def _njit(function: Any = None, **_: Any) -> Any:
    """What tests compile."""
    return _kernel if function is None else _kernel(function)


for _name, _value in {
    "kernel": _kernel,
    "inline": _prepared,
    "Solver": _Solver,
    "call": _call,
}.items():
    setattr(compiled, _name, _value)
vars(numba)["njit"] = _njit
