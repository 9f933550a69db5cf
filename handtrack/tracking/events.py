"""What is worth saying of tracked frames: events, remarks on what was done to the input, and the
lines of a log."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from handtrack.mcap.hand import Event
from handtrack.sequences.sequence import Remark
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.track import Part


def frame_events(frames: list[TrackedFrame], before: TrackedFrame | None = None) -> list[Event]:
    """What happened in frames: changes of status, hands found anew, joints newly rejected.

    Args:
        frames: in order of time.
        before: the frame before the first of them.
    """
    events = []
    for frame in frames:
        changed = before is None or frame.status != before.status
        newly = frame.rejected if before is None else frame.rejected & ~before.rejected
        if changed or frame.restart or newly.any():
            level = "info" if frame.status == "fitted" else "warning"
            words = (frame.status if changed else "", frame.reason)
            events.append(Event(frame.time_ns, level, ": ".join(filter(None, words))))
        before = frame
    return events


def remark_events(remarks: Iterable[Remark], frames: list[TrackedFrame]) -> list[Event]:
    """An event for every remark that begins in these frames."""
    first, last = frames[0].time_ns, frames[-1].time_ns
    return [Event(r.first_ns, "info", r.text) for r in remarks if first <= r.first_ns <= last]


def with_remarks(frames: list[TrackedFrame], remarks: Iterable[Remark]) -> list[TrackedFrame]:
    """The frames, with each remark among the reasons of those that it is about."""
    out = list(frames)
    for remark in remarks:
        for i, frame in enumerate(out):
            if remark.first_ns <= frame.time_ns <= remark.last_ns:
                reason = "; ".join(filter(None, (remark.text, frame.reason)))
                out[i] = replace(frame, reason=reason)
    return out


def log_lines(track: Part, before: tuple[str, str] = ("fitted", "")) -> list[Event]:
    """The lines of a log: events, and the changes of status that none of them tells, in order.

    Args:
        track: a track, or a stretch of one.
        before: status and reason of the frame before its first.
    """
    lines = list(track.events)
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
            lines.append(Event(time, level, text))
        before = now
    return sorted(lines, key=lambda line: line.time_ns)


def _words(reason: str) -> str:
    return re.sub(r"\d+", "", reason)
