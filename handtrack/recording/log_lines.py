"""The lines of a track's log: its events, and the changes of status that no event tells."""

from __future__ import annotations

import re
from typing import NamedTuple

from handtrack.tracking.track import Part


class Line(NamedTuple):
    """A line of the log.

    Attributes:
        time_ns: when, on the sequence's clock [ns].
        level: "info" or "warning".
        text: one line.
    """

    time_ns: int
    level: str
    text: str


def log_lines(track: Part, before: tuple[str, str] = ("fitted", "")) -> list[Line]:
    """All lines in order of time.

    Args:
        track: a track, or a stretch of one.
        before: status and reason of the frame before its first.
    """
    lines = [Line(e.time_ns, e.level, e.text) for e in track.events]
    told = {line.time_ns for line in lines}
    states = zip(track.status.tolist(), track.reason.tolist(), strict=True)
    for frame, time, now in zip(
        track.frame_index.tolist(), track.time_ns.tolist(), states, strict=True
    ):
        status, reason = now
        # a reason that only its numbers tell from the last one is no news, nor is none any more
        new_reason = bool(reason) and _words(reason) != _words(before[1])
        if (status != before[0] or new_reason) and time not in told:
            level = "warning" if status == "lost" else "info"
            text = f"frame {frame}: {status}{f': {reason}' if reason else ''}"
            lines.append(Line(time, level, text))
        before = now
    return sorted(lines, key=lambda line: line.time_ns)


def _words(reason: str) -> str:
    return re.sub(r"\d+", "", reason)
