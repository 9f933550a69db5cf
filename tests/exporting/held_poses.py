"""Poses that are held where none is known."""

from __future__ import annotations

import numpy as np


def held(values: np.ndarray) -> np.ndarray:
    """Values with every frame of NaN replaced by the one before, the first ones by the next."""
    out, known = values.copy(), np.isfinite(values).reshape(len(values), -1).all(1)
    first = int(np.flatnonzero(known)[0])
    for t in range(len(out)):
        if not known[t]:
            out[t] = out[t - 1] if t > first else values[first]
    return out
