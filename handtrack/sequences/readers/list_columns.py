"""Columns of lists of numbers as arrays."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files.long_arrays import Growing, blocks

if TYPE_CHECKING:
    import pyarrow


def is_list(kind: Any) -> bool:
    """Whether a column is of lists, or lists of lists, of numbers."""
    from pyarrow import types

    return bool(
        types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
    ) and is_numbers(kind.value_type)


def is_numbers(kind: Any) -> bool:
    """Whether values are numbers, or lists of them."""
    from pyarrow import types

    return bool(types.is_floating(kind) or types.is_integer(kind)) or is_list(kind)


def is_plain(kind: Any, pyarrow: Any) -> bool:
    """Whether values are numbers, times or texts."""
    types = pyarrow.types
    numbers = types.is_floating(kind) or types.is_integer(kind) or types.is_timestamp(kind)
    return bool(numbers or types.is_string(kind) or types.is_large_string(kind))


def is_flat(kind: Any) -> bool:
    """Whether values can stand in the cell of a table of text."""
    from pyarrow import types

    return not (types.is_nested(kind) or types.is_binary(kind) or types.is_large_binary(kind))


def is_of_width(kind: Any, width: int) -> bool:
    """Whether a type says that lists are so long."""
    from pyarrow import types

    return bool(types.is_fixed_size_list(kind)) and kind.list_size == width


def rows_of_lists(table: pyarrow.Table, name: str, path: Path) -> NDArray[np.float64] | None:
    """(rows, numbers) of a column of lists of one length; None where they are not."""
    import pyarrow

    found = _even(table.column(name), name, path)
    if found is not None:
        return found
    column = table.column(name).combine_chunks()
    if isinstance(column, pyarrow.ChunkedArray):
        column = pyarrow.concat_arrays(column.chunks)
    n, there = len(column), np.asarray(column.is_valid())
    flat = column.drop_null()
    while is_list(flat.type):
        flat = flat.flatten()
    if flat.null_count:
        flat = flat.cast(pyarrow.float64()).fill_null(np.nan)
    values = np.asarray(flat)
    count = int(there.sum())
    if not count or len(values) % count:
        return None
    width = len(values) // count
    some = column.drop_null().slice(0, 1000).to_pylist()
    if not is_of_width(column.type, width) and any(len(_flat(row)) != width for row in some):
        return None
    if count == n:
        out = values.reshape(n, width).astype(np.float64)
    else:
        out = np.full((n, width), np.nan)
        out[there] = values.reshape(count, width)
    if any(np.isinf(out[part]).any() for part in blocks(n)):
        raise InputError(f"column {shown(name, 40)} holds an infinite number", path)
    return out


def rows_in_batches(
    batches: Iterable[pyarrow.RecordBatch], names: list[str], path: Path
) -> dict[str, NDArray[np.float64]] | None:
    """(rows, numbers) of columns of lists, taken some rows at a time; None where a column's are
    not all there and of one length.

    Raises:
        InputError: an infinite number.
    """
    made: dict[str, Growing] = {}
    for batch in batches:
        for name in names:
            values = _even_values(batch.column(name))
            if values is None:
                return None
            grown = made.setdefault(name, Growing(values.shape[1:]))
            if grown.shape != values.shape[1:]:
                return None
            _add(grown, values, name, path)
    return {name: grown.whole() for name, grown in made.items()}


def _even(column: Any, name: str, path: Path) -> NDArray[np.float64] | None:
    """(rows, numbers) of lists that all are there and as long as the first; None of others."""
    made: Growing | None = None
    for chunk in column.chunks:
        values = _even_values(chunk)
        if values is None:
            return None
        made = Growing(values.shape[1:]) if made is None else made
        if made.shape != values.shape[1:]:
            return None
        _add(made, values, name, path)
    return None if made is None else made.whole()


def _even_values(chunk: Any) -> NDArray[Any] | None:
    """(rows, numbers) of an Arrow array of lists; None where they are not all of one length."""
    from pyarrow import compute

    flat = chunk
    while is_list(flat.type):
        flat = flat.flatten()
    width = len(flat) // max(len(chunk), 1)
    if chunk.null_count or flat.null_count or len(chunk) * width != len(flat):
        return None
    if not is_of_width(chunk.type, width):
        if is_list(chunk.type.value_type):
            return None
        least_most = compute.min_max(compute.list_value_length(chunk)).as_py()
        if len(chunk) and set(least_most.values()) != {width}:
            return None
    return np.asarray(flat).reshape(len(chunk), width)


def _add(made: Growing, values: NDArray[Any], name: str, path: Path) -> None:
    for part in blocks(len(values)):
        if np.isinf(values[part]).any():
            raise InputError(f"column {shown(name, 40)} holds an infinite number", path)
        made.append(values[part])


def _flat(value: Any) -> list[Any]:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return [x for part in value for x in _flat(part)]
    return value if isinstance(value, list) else []
