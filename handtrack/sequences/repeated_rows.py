"""Rows that a file holds twice: loggers write the last frame again until there is a new one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from handtrack.sequences.readers.raw import Raw, take_rows


def without_repeats(raw: Raw) -> Raw:
    """The same without rows of the time, the frame number and the joints of the row before."""
    values = None if raw.stamps is None else raw.stamps.values
    n = len(raw.joints)
    if not isinstance(values, list | tuple | np.ndarray) or np.ndim(raw.joints) != 3 or n < 2:
        return raw
    if len(values) != n or raw.mano is not None or raw.pending is not None:
        return raw
    if isinstance(values, np.ndarray):
        same = np.asarray(values[1:] == values[:-1]).reshape(n - 1, -1).all(axis=1)
        again = (np.flatnonzero(same) + 1).tolist()
    else:
        again = [i for i, pair in enumerate(pairwise(values), 1) if _equal(*pair)]
    if raw.frame_index is not None:
        again = [i for i in again if raw.frame_index[i] == raw.frame_index[i - 1]]
    again = [i for i in again if np.array_equal(raw.joints[i], raw.joints[i - 1], equal_nan=True)]
    if not again:
        return raw
    kept = np.setdiff1d(np.arange(n), np.array(again))
    note = f"{len(again)} rows of {n} are the row before again, time and joints: left out"
    return replace(take_rows(raw, kept), notes=(*raw.notes, note))


def _equal(a: Any, b: Any) -> bool:
    if a is None:
        return False
    same = a == b
    return same if isinstance(same, bool) else bool(np.all(same))
