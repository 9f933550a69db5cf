"""Which tests are run, in which order, and for how long: for pytest, told by a file.

    QUICK_TESTS=plan.json python -m pytest -n0 -p tools.bench.quick_tests tests/kernels

The plan is JSON. `order`: tests by their names, and no others; without it all. `limit`: processor
seconds for one test, which fails when it takes more; `budget`: for all, and none is begun
after. `record`: a file for what each test took, of those that passed.
"""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Generator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

_PLAN: dict[str, Any] = json.loads(Path(os.environ["QUICK_TESTS"]).read_text())
_took: dict[str, float] = {}


class TooLong(BaseException):
    """A test takes too long: not an error that a test expects."""


def _stop(number: int, frame: FrameType | None) -> None:
    raise TooLong(f"over {_PLAN['limit']:g} s of CPU")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The plan's tests in its order."""
    if "order" in _PLAN:
        place = {name: i for i, name in enumerate(_PLAN["order"])}
        items[:] = sorted(
            (item for item in items if item.nodeid in place), key=lambda item: place[item.nodeid]
        )


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, None]:
    """Measure a test, and end it at its limit."""
    if time.process_time() > _PLAN.get("budget", float("inf")):
        pytest.skip("no budget left")
    begun = time.process_time()
    signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, _PLAN.get("limit", 0))
    try:
        outcome = yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    if outcome.excinfo is None:
        _took[item.nodeid] = round(time.process_time() - begun, 4)


def pytest_sessionfinish() -> None:
    """Write what tests took."""
    if "record" in _PLAN:
        Path(_PLAN["record"]).write_text(json.dumps(_took, indent=0) + "\n")
