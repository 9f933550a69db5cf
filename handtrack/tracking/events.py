"""What is worth saying of tracked frames: events, remarks on what was done to the input, and the
lines of a log."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from handtrack.files.long_arrays import blocks
from handtrack.hand.skeleton import N_JOINTS
from handtrack.mcap.hand import Event
from handtrack.sequences.sequence import Remark
from handtrack.tracking.block import Block
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


class EventsOf:
    """The events of a hand's blocks, one after another."""

    def __init__(self) -> None:
        self._status = ""
        self._rejected = np.zeros((1, N_JOINTS), np.bool_)

    def __call__(self, block: Block) -> list[Event]:
        """As `frame_events`, of the next block."""
        fitted, status = block.fitted, block.status
        changed = status != np.concatenate([[self._status], status[:-1]])
        before = np.concatenate([self._rejected, fitted.rejected[:-1]])
        newly = (fitted.rejected & ~before).any(1)
        self._status, self._rejected = str(status[-1]), fitted.rejected[-1:]
        events = []
        for t in np.flatnonzero(changed | fitted.restart | newly).tolist():
            level = "info" if status[t] == "fitted" else "warning"
            words = (str(status[t]) if changed[t] else "", fitted.reasons[t])
            time_ns = int(fitted.times_ns[t])
            events.append(Event(time_ns, level, ": ".join(filter(None, words))))
        return events


def remark_events(remarks: Iterable[Remark], block: Block) -> list[Event]:
    """An event for every remark that begins in these frames."""
    times = block.fitted.times_ns
    first, last = int(times[0]), int(times[-1])
    return [Event(r.first_ns, "info", r.text) for r in remarks if first <= r.first_ns <= last]


def with_remarks(block: Block, remarks: Iterable[Remark]) -> Block:
    """The frames, with each remark among the reasons of those that it is about."""
    reasons, times = list(block.fitted.reasons), block.fitted.times_ns
    for remark in remarks:
        begin = int(np.searchsorted(times, remark.first_ns, "left"))
        end = int(np.searchsorted(times, remark.last_ns, "right"))
        for i in range(begin, end):
            reasons[i] = "; ".join(filter(None, (remark.text, reasons[i])))
    return replace(block, fitted=replace(block.fitted, reasons=reasons))


def log_lines(track: Part, before: tuple[str, str] = ("fitted", "")) -> list[Event]:
    """The lines of a log: events, and the changes of status that none of them tells, in order.

    Args:
        track: a track, or a stretch of one.
        before: status and reason of the frame before its first.
    """
    lines = list(track.events)
    told = {line.time_ns for line in lines}
    columns = (track.frame_index, track.time_ns, track.status, track.reason)
    rows = (
        row
        for part in blocks(len(track))
        for row in zip(*(column[part].tolist() for column in columns), strict=True)
    )
    for frame, time, status, reason in rows:
        now = (status, reason)
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
