"""Rows that are still open, by the ids of `open.txt`: expected to fail."""

from __future__ import annotations

from pathlib import Path

import pytest

OPEN = Path(__file__).with_name("open.txt")


def pytest_collection_modifyitems(items):
    still = set(OPEN.read_text().splitlines()) if OPEN.exists() else set()
    for item in items:
        if item.nodeid.removeprefix("tests/brought/") in still:
            item.add_marker(pytest.mark.xfail(reason="its kind is not fixed yet", strict=False))
