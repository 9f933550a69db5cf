"""Which types of Arrow's columns are of numbers, of lists of numbers, of plain values."""

from __future__ import annotations

from typing import Any


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
