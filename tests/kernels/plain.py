"""Kernels as the Python that they are written in: nothing is compiled, every part can be called.

What the compiler makes of the same lines is for the tests of fits, filters and smoothers to see.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from types import CellType, FunctionType, SimpleNamespace
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher

from handtrack.kernels import exchange
from handtrack.kernels.compiled import Solver
from handtrack.kernels.workspace import WORK


def plain(kernel: Dispatcher | Solver) -> Callable[..., Any]:
    """A kernel as a Python function, and so all that it calls; a solver's address is the solver."""
    function = kernel.function if isinstance(kernel, Solver) else kernel.py_func
    names = _names(function.__module__)
    cells = tuple(CellType(_plain_too(cell.cell_contents)) for cell in function.__closure__ or ())
    return FunctionType(
        function.__code__, names, function.__name__, function.__defaults__, cells or None
    )


def _plain_too(value: Any) -> Any:
    return plain(value) if isinstance(value, Dispatcher) else value


@cache
def _spaces() -> dict[str, dict[str, Any]]:
    return {}


def _names(module: str) -> dict[str, Any]:
    """What a module's names mean to its plain functions."""
    spaces = _spaces()
    if module not in spaces:
        spaces[module] = names = dict(vars(sys.modules[module]))
        for name, value in list(names.items()):
            names[name] = _plain_too(value)
        if "call" in names:
            names["call"] = lambda solver, work: plain(solver)(work)
    return spaces[module]


def record(dtype: np.dtype, seed: int | None = None) -> SimpleNamespace:
    """A record of its own: zeros, or random numbers in all fields that are real."""
    made = SimpleNamespace()
    rng = np.random.default_rng(seed)
    for name in dtype.names or ():
        kind, shape = dtype[name].base, dtype[name].shape
        real = seed is not None and kind.kind == "f"
        value = rng.normal(size=shape) if real else np.zeros(shape, kind)
        setattr(made, name, value if shape else kind.type(value))
    return made


def workspace(model, joints, weights, angles, rotation, translation, twist=0.0):
    """A workspace with hand, frame and pose in it, as a record."""
    w = record(WORK)
    lower, upper = model.limits.lower, model.limits.upper
    hand = model.rest_joints, model.axes, lower, upper, twist, model.landmark_offsets
    plain(exchange.load_model)(w, hand)
    plain(exchange.load_frame)(w, joints, weights, 1.0)
    plain(exchange.load_pose)(w, angles, np.append(rotation, translation))
    return w


def positive(rng: np.random.Generator, n: int) -> np.ndarray:
    """(n, n) A positive definite matrix, well conditioned."""
    a = rng.normal(size=(n, n))
    return a @ a.T / n + 0.5 * np.eye(n)
