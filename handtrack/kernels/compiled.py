"""How the project's inner loops are compiled: numba, cached on disk.

Machine code is made on the first run and kept in numba's cache: beside the package, or in the
user's cache folder where that is not writable; with no such folder it is made in every process.
Arguments of compiled code are trusted; callers
validate.

A *solver* is a compiled function of the workspace alone. Compiled code calls it by its address,
so each is compiled once instead of once more inside each of its callers.
"""

from __future__ import annotations

import gc
import hashlib
import inspect
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.core.runtime.nrt import rtsys
from numba.extending import intrinsic

from handtrack.kernels.workspace import WORK

# reordering sums is allowed, assuming that NaN never occurs is not
_OPTIONS: Any = {
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
    "error_model": "numpy",
}
_RECORD = numba.from_dtype(WORK)


def _versioned(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function under a name that holds a digest of the sources that it is compiled from.

    numba looks for changes only in the file that a function stands in, by size and time; the
    name keeps machine code of other versions of its callees out.
    """
    digest = hashlib.sha256()
    for name in sorted(_needed(function.__module__)):
        digest.update(_source(name).encode())
    function.__qualname__ = f"{function.__qualname__}_{digest.hexdigest()[:12]}"
    return function


def _needed(module: str) -> set[str]:
    """A module of the project, with those that it takes names from, and so on."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += re.findall(r"^from (handtrack\.\S+) import", _source(name), re.MULTILINE)
    return found


@cache
def _source(module: str) -> str:
    return inspect.getsource(sys.modules[module])


class _Store(FunctionCache):
    """numba's cache, without all that numba loads to compile: kept code does not need it.

    numba fills its tables of what can be compiled before it looks into its cache, which takes
    longer than all the rest of loading; the compiler fills them by itself where code is missing.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)  # names that machine code of arrays refers to
        return self._load_overload(sig, target_context)


def _store(function: Callable[..., Any]) -> Any:
    """Where the function's machine code is kept; None where no folder can be written to."""
    try:
        return _Store(function)
    except RuntimeError:
        return None


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, without the GIL."""
    options: Any = {"no_cfunc_wrapper": True, **_OPTIONS}
    function = _versioned(function)
    compiled: Any = numba.njit(nogil=True, **options)(function)
    store = _store(function)
    if store is not None:
        compiled._cache = store
    return compiled


def inline(function: Callable[..., Any]) -> Any:
    """Compile a function that other compiled code calls; small ones are inlined."""
    wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    options: Any = {**wrappers, **_OPTIONS}
    return numba.njit(**options)(function)


@contextmanager
def uncollected() -> Iterator[None]:
    """No garbage collection meanwhile: over all that numba keeps it takes a tenth of the time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


class Solver:
    """A compiled function of the workspace, called by its `address`."""

    def __init__(self, function: Callable[..., Any]):
        self.name = function.__name__
        self.function = _versioned(function)
        self.__doc__ = function.__doc__

    @cached_property
    def address(self) -> int:
        """Where its machine code is; loads it from the cache, or compiles it."""
        compiled: Any = CFunc(self.function, ((_RECORD,), types.void), {}, _OPTIONS)
        store = _store(self.function)
        if store is not None:
            compiled._cache = store
        with uncollected():
            compiled.compile()
        self._keep = compiled  # the code lives as long as this object
        address: Any = compiled.address
        return int(address)

    @property
    def ready(self) -> bool:
        """Whether its machine code is loaded or on disk, or will not stay there."""
        if "address" in self.__dict__:
            return True
        store = _store(self.function)
        if store is None:
            return True
        return any(Path(store.cache_path).glob(f"*.{self.function.__qualname__}-*.nbi"))


def addresses(
    *solvers: Solver,
    meanwhile: Callable[[], object] | None = None,
    beside: Callable[[], object] | None = None,
) -> tuple[int, ...]:
    """The solvers' addresses. What is to be compiled is compiled on two cores.

    Args:
        solvers: the first one, the longest to compile, is compiled here, the others in a second
            process, into the shared cache.
        meanwhile: is called here while the second process may still compile.
        beside: is called there, at last; a function of some module.
    """
    missing = [solver for solver in solvers[1:] if not solver.ready]
    second = None
    if missing and not solvers[0].ready:
        code = f"import sys; sys.path[:] = {sys.path}"
        for solver in missing:
            module = solver.function.__module__
            code += f"; import {module}; {module}.{solver.name}.address"
        if beside is not None:
            name = beside.__name__
            code += f"; from {beside.__module__} import {name}; {name}()"
        # should it fail, the code is made here
        second = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    first = solvers[0].address
    if second is not None:
        if meanwhile is not None:
            with uncollected():
                meanwhile()
        second.wait()
    return (first, *(solver.address for solver in solvers[1:]))


@intrinsic
def call(typing_context: Any, address: Any, work: Any) -> Any:
    """Call the solver at an address on a workspace, from compiled code."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        native = context.get_value_type(signature.args[1])
        function = ir.FunctionType(ir.VoidType(), [native]).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), [arguments[1]])
        return context.get_dummy_value()

    return types.void(types.int64, _RECORD), generate
