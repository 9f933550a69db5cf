"""Where and when records stand in a file: in words, made only where an error needs them; their
times and their numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Sequence as Items
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.fields import FINEST, frame_numbers
from handtrack.sequences.titles import is_frame_number, time_unit


class Places(Sequence[str]):
    """The places of records: a word and each one's number.

    Args:
        word: what is counted: "line", "frame".
        numbers: of the records.
    """

    def __init__(self, word: str, numbers: Sequence[int]):
        self._word, self._numbers = word, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> Places: ...

    def __getitem__(self, at: int | slice) -> str | Places:
        if isinstance(at, slice):
            return Places(self._word, self._numbers[at])
        return f"{self._word} {self._numbers[at]}"


class Picked(Sequence[str]):
    """Some of the places.

    Args:
        places: all of them.
        rows: which.
    """

    def __init__(self, places: Sequence[str], rows: Sequence[int]):
        self._places, self._rows = places, rows

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> Picked: ...

    def __getitem__(self, at: int | slice) -> str | Picked:
        if isinstance(at, slice):
            return Picked(self._places, self._rows[at])
        return self._places[self._rows[at]]


_HEADERS = ("header", "stamp", "meta", "metadata")


def stamps_of(frames: Items[Any], places: Items[str]) -> Stamps | None:
    """The times that frames hold; None where none does."""
    columns: dict[tuple[str, ...], None] = {}
    for frame in frames:
        if not isinstance(frame, dict):
            continue
        for key, value in frame.items():
            if value is None or isinstance(value, bool | list):
                continue
            if isinstance(value, dict) and key in _HEADERS and not _is_ros(value):
                columns |= {(key, k): None for k, v in value.items() if _is_time(k, v)}
            elif _is_time(key, value):
                columns[(key,)] = None
    if not columns:
        return None
    keys = min(columns, key=lambda c: FINEST.index(time_unit(c[-1]) or ""))
    values = []
    for frame in frames:
        value = frame
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        values.append(value)
    unit = time_unit(keys[-1])
    return Stamps(values, keys[-1], unit or None, places)


def _is_time(key: str, value: Any) -> bool:
    if isinstance(value, bool | list) or value is None or time_unit(str(key)) is None:
        return False
    return not isinstance(value, dict) or _is_ros(value)


def _is_ros(value: dict[str, Any]) -> bool:
    return any(k in value for k in ("sec", "secs")) and len(value) <= 2


def frame_index_of(frames: Items[Any], path: Path) -> NDArray[np.int64] | None:
    """Frame numbers, where the frames have them; between neighbours' where one has nothing."""
    key = next(
        (
            k
            for f in frames
            if isinstance(f, dict)
            for k, v in f.items()
            if is_frame_number(str(k)) and isinstance(v, int | float)
        ),
        None,
    )
    if key is None:
        return None
    given = [f.get(key) if isinstance(f, dict) else None for f in frames]
    known = [i for i, v in enumerate(given) if v is not None]
    numbers = frame_numbers([given[i] for i in known], len(known), path, key)
    if len(known) == len(given):
        return numbers
    out = np.interp(np.arange(len(given)), known, numbers.astype(np.float64))
    out += np.minimum(np.arange(len(given)) - known[0], 0)
    out += np.maximum(np.arange(len(given)) - known[-1], 0)
    if (out != np.round(out)).any() or (np.diff(out) <= 0).any():
        return None
    return out.astype(np.int64)
