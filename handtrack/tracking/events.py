"""What is worth saying of tracked frames: events, and remarks on what was done to the input."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from handtrack.mcap.hand import Event
from handtrack.sequences.sequence import Remark
from handtrack.tracking.frame import TrackedFrame


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
