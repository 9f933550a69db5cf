"""How the project's inner loops are compiled: numba, cached on disk.

Machine code is made on the first run and kept in numba's cache: beside the package, or in the
user's cache folder where that is not writable. Arguments of compiled code are trusted; callers
validate.

A *solver* is a compiled function of the fitter's buffer alone. Compiled code calls it by its
address, so each is compiled once instead of once more inside each of its callers.
"""

from __future__ import annotations

import hashlib
import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core.caching import FunctionCache
from numba.extending import intrinsic

# reordering sums is allowed, assuming that NaN never occurs is not
_OPTIONS: Any = {
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
    "error_model": "numpy",
}
_BUFFER = types.Array(types.float64, 1, "C")


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


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls, without the GIL."""
    options: Any = {"no_cfunc_wrapper": True, **_OPTIONS}
    return numba.njit(cache=True, nogil=True, **options)(_versioned(function))


def inline(function: Callable[..., Any]) -> Any:
    """Compile a function that other compiled code calls; small ones are inlined."""
    wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    options: Any = {**wrappers, **_OPTIONS}
    return numba.njit(**options)(function)


class Solver:
    """A compiled function of the fitter's buffer, called by its `address`."""

    def __init__(self, function: Callable[..., Any]):
        self.function = _versioned(function)
        self.__doc__ = function.__doc__

    @cached_property
    def address(self) -> int:
        """Where its machine code is; loads it from the cache, or compiles it."""
        compiled = numba.cfunc(types.void(_BUFFER), cache=True, **_OPTIONS)(self.function)
        self._keep = compiled  # the code lives as long as this object
        address: Any = compiled.address
        return int(address)

    @property
    def cached(self) -> bool:
        """Whether its machine code is in the cache on disk."""
        stored: Any = FunctionCache(self.function)  # type: ignore[no-untyped-call]
        return any(Path(stored.cache_path).glob(f"*.{self.function.__qualname__}-*.nbi"))


def compile_beside(solvers: dict[str, str]) -> subprocess.Popen[bytes]:
    """Start compiling solvers, by module, in a second process, into the shared cache."""
    code = "; ".join(f"import {m}; {m}.{name}.address" for m, name in solvers.items())
    return subprocess.Popen([sys.executable, "-c", code])


@intrinsic
def call(typing_context: Any, address: Any, buffer: Any) -> Any:
    """Call the solver at an address on a buffer, from compiled code."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        native = context.get_value_type(signature.args[1])
        function = ir.FunctionType(ir.VoidType(), [native]).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), [arguments[1]])
        return context.get_dummy_value()

    return types.void(types.int64, _BUFFER), generate
