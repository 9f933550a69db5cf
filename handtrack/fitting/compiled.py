"""How the project's inner loops are compiled: numba, cached on disk.

Kernels are compiled on their first run and kept in numba's cache: beside the package, or in
the user's cache folder where that is not writable. Their arguments are trusted; callers
validate.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

# reordering sums is allowed, assuming that NaN never occurs is not
_FAST = {"reassoc", "contract", "arcp", "nsz"}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function, without the GIL and with its machine code cached on disk."""
    return numba.njit(cache=True, nogil=True, fastmath=_FAST, error_model="numpy")(function)


def inline(function: Callable[..., Any]) -> Any:
    """Compile a small function that kernels call; LLVM inlines it there."""
    return numba.njit(nogil=True, fastmath=_FAST, error_model="numpy")(function)
