"""How far a data set is."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass
class Progress:
    """What has been done of a data set; this one shows nothing.

    Attributes:
        clips: how many are to be done.
        done, frames, failed: how many clips are, their frames, and clips that failed.
        dashboard: address of the engine's, or "".
        doing: what is going on.
        started, counted: when it began, and when the last of them was done.
    """

    clips: int = 0
    done: int = 0
    frames: int = 0
    failed: int = 0
    dashboard: str = ""
    doing: str = ""
    started: float = field(default_factory=time.monotonic)
    counted: float = field(default_factory=time.monotonic)

    def prepare(self, doing: str) -> None:
        """Something is done that has no count."""
        self.doing, self.clips = doing, 0
        self.show()

    def begin(self, doing: str, clips: int) -> None:
        """A stage begins."""
        self.doing, self.clips, self.started = doing, clips, time.monotonic()
        self.counted = self.started
        self.done = self.frames = self.failed = 0
        self.show()

    def add(self, clips: int, frames: int, failed: int) -> None:
        """So many are done."""
        self.done += clips
        self.frames += frames
        self.failed += failed
        self.counted = time.monotonic()
        self.show()

    def show(self) -> None:
        """Called now and then."""

    def says(self, text: str) -> None:
        """Something is to be told by itself."""

    def end(self) -> None:
        """All is done."""

    def line(self, width: int | None = None) -> str:
        """All of it in one line, of so many characters at most."""
        if not self.clips:
            return f"{self.doing} ..."[:width]
        parts = self._parts()
        if self.dashboard:
            parts.append(self.dashboard)
        # what was said before, and what is of least use, goes first
        while width is not None and len(parts) > 1 and len(", ".join(parts)) > width:
            parts.pop()
        return ", ".join(parts)[:width]

    def _parts(self) -> list[str]:
        seconds = max(time.monotonic() - self.started, 1e-3)
        parts = [f"{self.doing}: {self.done:,} of {self.clips:,}"]
        if self.done:
            parts.append(f"{duration(self._left(seconds))} left")
        parts.append(f"{self.failed:,} failed" if self.failed else "none failed")
        if self.done:
            rate = self.done / seconds
            parts.append(f"{rate:.1f}/s" if rate >= 1 else f"{60 * rate:.1f}/min")
            if self.frames:
                parts.append(f"{self.frames / seconds:,.0f} frames/s")
        return parts

    def _left(self, seconds: float) -> float:
        """Seconds that the rest takes; they grow only when the next one is late."""
        waiting = time.monotonic() - self.counted
        each, rest = (seconds - waiting) / self.done, self.clips - self.done
        if waiting <= each:
            return each * rest - waiting
        return seconds / (self.done + 1) * (rest - 1)


def duration(seconds: float) -> str:
    """Seconds as people say them: 45 s, 12 min, 3.5 h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
