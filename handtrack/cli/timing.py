"""What took a command's time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_LEAST_S = 0.05
"""Less than that is not told."""
_began = time.perf_counter()


def begin() -> None:
    """A command begins now."""
    global _began
    _began = time.perf_counter()


class Times:
    """Seconds by what they were spent with; what is inside of something else counts once."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inner = 0.0

    @contextmanager
    def during(self, what: str) -> Iterator[None]:
        """Count the time inside the block, without that of blocks in it."""
        start, before, self._inner = time.perf_counter(), self._inner, 0.0
        try:
            yield
        finally:
            spent = time.perf_counter() - start
            self.add(what, spent - self._inner)
            self._inner = before + spent

    def add(self, what: str, seconds: float) -> None:
        """Count seconds."""
        self.seconds[what] = self.seconds.get(what, 0.0) + seconds

    def move(self, seconds: float, source: str, to: str) -> None:
        """Count seconds of one thing as another's."""
        self.add(source, -seconds)
        self.add(to, seconds)

    @property
    def wall(self) -> float:
        """Since the command began [s]."""
        return time.perf_counter() - _began

    def to_dict(self) -> dict[str, float]:
        """All of them [s], and `total`; what is not named is `other`."""
        total = self.wall
        named = {what: round(spent, 3) for what, spent in self.seconds.items()}
        other = total - sum(self.seconds.values())
        return {**named, "other": round(max(other, 0.0), 3), "total": round(total, 3)}

    def said(self) -> str:
        """ "2.31 s: reading 0.21, fitting 1.60 ...", the longest first."""
        found = self.to_dict()
        total = found.pop("total")
        parts = sorted(found.items(), key=lambda part: -part[1])
        told = ", ".join(f"{what} {spent:.2f}" for what, spent in parts if spent >= _LEAST_S)
        return f"{total:.2f} s{f': {told}' if told else ''}"
