"""Folders for files that are on their way to somewhere else."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder of this machine that is gone when the block ends."""
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder:
        yield Path(folder)
