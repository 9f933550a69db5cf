"""The printed table keeps what matters most where the terminal is narrow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_html_report import sequences

from handtrack.evaluation.report_columns import _COLUMNS, mean_std, that_fit
from handtrack.evaluation.stability import stability_of_pair

MUST = {"sequence", "frames", "lost", "PA-MPJPE"}


@pytest.fixture(scope="module")
def rows():
    truth, a, b = sequences()
    return [stability_of_pair(a, truth), stability_of_pair(b, truth)]


def headings(rows, width):
    columns, left_out = that_fit(rows, width)
    return [c.heading for c in columns], left_out


def test_what_matters_least_goes_first(rows):
    """Column after column as the terminal gets narrower, in the order of their importance."""
    wide, none = headings(rows, 1000)
    assert none == []
    importance = {c.heading: c.importance for c in _COLUMNS}
    gone = []
    for width in range(200, 0, -1):
        kept, left_out = headings(rows, width)
        assert left_out[: len(gone)] == gone
        gone = left_out
        assert sorted([*kept, *left_out]) == sorted(wide)
    assert [importance[h] for h in gone] == sorted(importance[h] for h in gone)
    assert gone[0] == "median"
    assert set(kept) == MUST


def test_a_column_is_there_if_any_row_fills_it(rows):
    """`input` of one row alone is shown; of none, it is not."""
    assert "input" not in headings(rows, 1000)[0]
    given = replace(rows[1], input_pa_mpjpe_mm=rows[1].pa_mpjpe_mm)
    assert "input" in headings([rows[0], given], 1000)[0]


def test_what_errors_are_against_is_in_the_caption_where_it_is_one(rows):
    assert "against" not in headings(rows, 1000)[0]
    other = replace(rows[1], against="observed")
    assert rows[0].against != other.against
    assert "against" in headings([rows[0], other], 1000)[0]
    assert np.isfinite(rows[0].pa_mpjpe_mm.mean)


def test_of_nothing_there_is_one_dash(rows):
    spread = rows[0].pa_mpjpe_mm
    assert mean_std(replace(spread, mean=np.nan, std=np.nan)) == "-"
    assert mean_std(replace(spread, mean=1.234, std=0.5)) == "1.23 ± 0.50"
    unknown = replace(rows[1], input_pa_mpjpe_mm=replace(spread, mean=np.nan, std=np.nan))
    assert "input" not in headings([rows[0], unknown], 1000)[0]
