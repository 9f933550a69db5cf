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
    """

    clips: int = 0
    done: int = 0
    frames: int = 0
    failed: int = 0
    dashboard: str = ""
    doing: str = ""
    started: float = field(default_factory=time.monotonic)

    def begin(self, doing: str, clips: int) -> None:
        """A stage begins."""
        self.doing, self.clips, self.started = doing, clips, time.monotonic()
        self.done = self.frames = self.failed = 0
        self.show()

    def add(self, clips: int, frames: int, failed: int) -> None:
        """So many are done."""
        self.done += clips
        self.frames += frames
        self.failed += failed
        self.show()

    def show(self) -> None:
        """Called now and then."""

    def says(self, text: str) -> None:
        """Something is to be told by itself."""

    def end(self) -> None:
        """All is done."""

    @property
    def line(self) -> str:
        """All of it in one line."""
        seconds = max(time.monotonic() - self.started, 1e-3)
        parts = [f"{self.doing}: {self.done:,} of {self.clips:,}"]
        if self.done:
            parts.append(f"{self.done / seconds:.1f}/s")
            if self.frames:
                parts.append(f"{self.frames / seconds:,.0f} frames/s")
            left = (self.clips - self.done) * seconds / self.done
            parts.append(f"{duration(left)} left")
        parts.append(f"{self.failed} failed" if self.failed else "none failed")
        if self.dashboard:
            parts.append(self.dashboard)
        return ", ".join(parts)


def duration(seconds: float) -> str:
    """Seconds as people say them: 45 s, 12 min, 3.5 h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
