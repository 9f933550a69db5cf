"""Some rows of many, evenly spread."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.files.long_arrays import evenly


@pytest.mark.parametrize("n", [0, 1, 7, 8])
def test_all_where_they_are_few(n: int):
    rows = np.arange(n) * 3
    np.testing.assert_array_equal(evenly(rows, 8), rows)


@pytest.mark.parametrize(("n", "most"), [(9, 8), (1000, 7), (64, 3), (10**6, 1000)])
def test_so_many_from_the_first_to_the_last(n: int, most: int):
    found = evenly(np.arange(n), most)
    steps = np.diff(found)
    assert (len(found), found[0], found[-1]) == (most, 0, n - 1)
    assert steps.max() - steps.min() <= 1
    assert steps.min() >= 1
