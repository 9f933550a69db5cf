"""What people bring: a file for each kind and format, and its right value."""

from __future__ import annotations

import re
import warnings
from collections import Counter

import pytest
import rows_marks
import rows_names
import rows_shape
import rows_tables
import rows_time
from rows import Row, check

TABLE: list[Row] = [
    *rows_marks.ROWS,
    *rows_names.ROWS,
    *rows_tables.ROWS,
    *rows_time.ROWS,
    *rows_shape.ROWS,
]


def _id(row: Row) -> str:
    return re.sub(r"[^\w.,()+-]+", "_", row.id)


def test_the_table_is_large_and_has_each_row_once():
    count = Counter(row.id for row in TABLE)
    assert len(count) >= 120
    assert max(count.values()) == 1, count.most_common(3)


@pytest.mark.parametrize("row", TABLE, ids=_id)
def test_brought(row: Row, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(row, tmp_path)
