"""Random combinations through the command line; `tools/bench/brought.py` runs as many as one
likes."""

from __future__ import annotations

import pytest

from tools.bench.brought import combination, judge


@pytest.mark.parametrize("seed", range(24))
def test_no_combination_goes_wrong_without_a_word(seed, tmp_path):
    made = combination(seed)
    found = judge(made, tmp_path)
    assert found.kind in ("right", "refused", "warned"), f"{made.words}: {found.why}\n{found.said}"
