"""The catalogue of formats is a table that can be put into a document."""

from __future__ import annotations

from handtrack.hand.skeleton import ORDERS
from handtrack.sequences.readers.catalogue import FORMATS, as_markdown


def test_each_format_is_one_row_of_equal_width():
    lines = as_markdown().splitlines()
    assert len(lines) == len(FORMATS) + 2
    assert {line.count(" | ") for line in lines} == {6}


def test_formats_have_different_names_and_known_orders():
    assert len({f.name for f in FORMATS}) == len(FORMATS)
    said = {w for f in FORMATS for w in f.order.split(", ")}
    assert {w for w in said if " " not in w} <= {*ORDERS}
