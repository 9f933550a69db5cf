"""Columns of a large table all at once: numbers as floats, texts as codes of what they say.

A row as a list of cells costs a microsecond a cell; read as columns a table of gigabytes takes
what its letters take. Whatever is not plain here is None, and is read cell by cell, which also
says what is wrong and where.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.readers.raw import Array

MISSING = {"", "nan", "na", "n/a", "n.a.", "null", "none", "-", "--", "#n/a", "nat", "<na>"}
"""What cells say where nothing is."""
LARGE = 10**6
"""Letters of a table that is worth it."""
_BLOCK = 4 * 10**6
_NARROW = 16
_EMPTY = sorted({way(m) for m in MISSING for way in (str, str.upper, str.title)} | {"NaN", "<NA>"})


@dataclass
class Coded:
    """Texts that say few things often.

    Attributes:
        codes: (rows,) which of `texts` each row says.
        texts: all different, in the order of their first rows.
    """

    codes: NDArray[np.int64]
    texts: list[str]

    @classmethod
    def of(cls, texts: Items[str]) -> Self:
        """Some texts, one a row."""
        index = {text: i for i, text in enumerate(dict.fromkeys(texts))}
        return cls(np.array([index[text] for text in texts], dtype=np.int64), list(index))

    def __len__(self) -> int:
        return len(self.codes)

    def all(self) -> list[str]:
        """The text of each row."""
        out: list[str] = np.array(self.texts, dtype=object)[self.codes].tolist()
        return out

    def with_other(self, other: Coded) -> Coded:
        """What two columns say, a blank between."""
        both = self.codes * len(other.texts) + other.codes
        _, first, codes = np.unique(both, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        rows = first[order].tolist()
        texts = [f"{self.texts[self.codes[i]]} {other.texts[other.codes[i]]}" for i in rows]
        return Coded(rank[codes.ravel()], texts)


@dataclass
class AtOnce:
    """The rows of a table, to be read by columns.

    Attributes:
        text: lines with an end of line between them.
        separator: of one letter.
        width: how many columns there are.
        rows: how many lines.
    """

    text: bytes
    separator: str
    width: int
    rows: int
    _said: dict[int, Coded] = field(default_factory=dict, init=False, repr=False)

    def floats(self, columns: Iterable[int]) -> Array | None:
        """(rows, columns) numbers, NaN where cells are empty; None where a cell is no number."""
        columns = list(columns)
        table = self._read(columns, "double")
        if table is None:
            return None
        out = np.empty((self.rows, len(columns)))
        for i, column in enumerate(table.columns):
            out[:, i] = values_of(column, np.float64)
        return out

    def coded(self, column: int) -> Coded | None:
        """One column's texts; None where they have blanks around them."""
        if column not in self._said:
            columns = sorted({column, *self._few()})
            table = self._read(columns, "texts")
            if table is None:
                return None
            for c, found in zip(columns, table.unify_dictionaries().columns, strict=True):
                parts = [values_of(chunk.indices, np.int32) for chunk in found.chunks]
                texts = found.chunk(0).dictionary.to_pylist()
                self._said[c] = Coded(np.concatenate(parts).astype(np.int64), texts)
        said = self._said[column]
        return None if any(text != text.strip() for text in said.texts) else said

    def is_even(self) -> bool:
        """Whether all rows have as many columns as there are."""
        few = self._few() or [0]
        return self.coded(few[0]) is not None or self._read([0], "texts") is not None

    def _few(self) -> list[int]:
        """The columns that seem to say few things, of a table of few."""
        if self.width > _NARROW:
            return []
        first = self.text[: self.text.find(b"\n")].split(self.separator.encode())
        return [c for c, cell in enumerate(first[: self.width]) if b"." not in cell]

    def _read(self, columns: list[int], kind: str) -> Any:
        import pyarrow as pa
        from pyarrow import csv

        of = pa.float64() if kind == "double" else pa.dictionary(pa.int32(), pa.string())
        names = [str(c) for c in range(self.width)]
        wanted = [str(c) for c in columns]
        if len(set(wanted)) < len(wanted):
            return None
        try:
            table = csv.read_csv(
                io.BytesIO(self.text),
                csv.ReadOptions(use_threads=False, block_size=_BLOCK, column_names=names),
                csv.ParseOptions(delimiter=self.separator, quote_char=False),
                csv.ConvertOptions(
                    column_types=dict.fromkeys(wanted, of),
                    include_columns=wanted,
                    null_values=_EMPTY,
                    strings_can_be_null=False,
                ),
            )
        except pa.ArrowException:
            return None
        return table if table.num_rows == self.rows else None


def values_of(column: Any, dtype: type[np.generic]) -> NDArray[Any]:
    """The numbers of an Arrow array, NaN where it has none: its own way loads pandas for it.

    Args:
        column: of a type of numbers, whole or in chunks.
        dtype: that type.
    """
    parts = [
        _values_of(chunk, dtype) for chunk in getattr(column, "chunks", [column]) if len(chunk)
    ]
    return np.concatenate(parts) if parts else np.empty(0, dtype)


def _values_of(array: Any, dtype: type[np.generic]) -> NDArray[Any]:
    known, values = array.buffers()
    a, n = array.offset, len(array)
    out = np.frombuffer(values, dtype, a + n)[a:]
    if array.null_count:
        bits = np.unpackbits(np.frombuffer(known, np.uint8), count=a + n, bitorder="little")[a:]
        out = np.where(bits == 1, out, np.nan)
    return out
