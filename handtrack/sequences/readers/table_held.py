"""Tables of numbers that no text holds: a Parquet file's columns as a table of cells."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.readers.raw import Array
from handtrack.sequences.readers.table_cells import Table, is_number, numbered

if TYPE_CHECKING:
    import pyarrow

FEWEST_ROWS, FEWEST_COLUMNS = 200, 60
"""Smaller tables are read as text: narrow ones may have a row for each joint."""


@dataclass
class HeldTable(Table):
    """The columns of an Arrow table, all of them numbers.

    Attributes:
        held_in: the table.
    """

    held_in: Any = None

    def check_width(self) -> None:
        """All rows are as wide."""

    def _at_once(self) -> None:
        return None

    def texts(self, column: int) -> list[str]:
        """One column's cells."""
        import pyarrow

        texts = self.held_in.column(column).cast(pyarrow.string()).to_pylist()
        return [text or "" for text in texts]

    def held(self, column: int) -> NDArray[np.float64 | np.int64] | None:
        """One column's numbers, where none is missing."""
        given = self.held_in.column(column)
        if given.null_count:
            return None
        kind = np.int64 if str(given.type) in _WHOLE else np.float64
        return np.asarray(given.to_numpy(), kind)

    def numbers(self, columns: Items[int], names: Items[str]) -> Array:
        """(rows, columns) numbers, NaN where there is none."""
        out = np.empty((len(self.lines), len(columns)))
        for c, column in enumerate(columns):
            at = 0
            for chunk in self.held_in.column(column).chunks:
                out[at : at + len(chunk), c] = chunk.to_numpy(zero_copy_only=False)
                at += len(chunk)
        return out


_WHOLE = ("int8", "int16", "int32", "int64")


class _Rows(Items[str]):
    """Rows as lines of text, made where they are looked at."""

    def __init__(self, table: pyarrow.Table) -> None:
        self._table = table

    def __len__(self) -> int:
        return len(self._table)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> list[str]: ...

    def __getitem__(self, at: int | slice) -> str | list[str]:
        if isinstance(at, slice):
            return [self[i] for i in range(*at.indices(len(self)))]
        row = self._table.slice(at if at >= 0 else at + len(self), 1).to_pylist()[0]
        return ",".join("" if v is None else str(v) for v in row.values())


def as_held(table: pyarrow.Table, path: Path, fewest: int = FEWEST_ROWS) -> HeldTable | None:
    """A large table of numbers alone, with plain titles; None of others."""
    from pyarrow import types

    titles = [name.strip() for name in table.column_names]
    if len(table) < fewest or len(titles) < FEWEST_COLUMNS or len(set(titles)) < len(titles):
        return None
    numbers = (types.is_float64, types.is_float32, types.is_signed_integer)
    if not all(any(of(kind) for of in numbers) for kind in table.schema.types):
        return None
    if any(is_number(t) or not t or set(t) & set('",\n\r#') for t in titles):
        return None
    if numbered(titles) is not titles:
        return None
    lines = _Rows(table)
    places = range(2, len(table) + 2)
    made = HeldTable(lines, places, ",", titles, [], path, held_in=table)  # type: ignore[arg-type]
    made.first = made.cells(0)
    return made
