"""Rows that a file holds twice: loggers write the last frame again until there is a new one."""

from __future__ import annotations

from dataclasses import replace

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
    again = [i for i in range(1, n) if _equal(values[i], values[i - 1])]
    if raw.frame_index is not None:
        again = [i for i in again if raw.frame_index[i] == raw.frame_index[i - 1]]
    again = [i for i in again if np.array_equal(raw.joints[i], raw.joints[i - 1], equal_nan=True)]
    if not again:
        return raw
    kept = np.setdiff1d(np.arange(n), np.array(again))
    note = f"{len(again)} rows of {n} are the row before again, time and joints: left out"
    return replace(take_rows(raw, kept), notes=(*raw.notes, note))


def _equal(a: object, b: object) -> bool:
    return a is not None and bool(np.all(a == b))
