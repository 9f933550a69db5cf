"""What a viewer shows: tracks of one recording or of several, side by side or one over another."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.mcap.hand import Event, hand_topics
from handtrack.tracking.track import Part, Track

Array = NDArray[np.float64]

_UNIX_NS = (946_684_800 * 10**9, 4_102_444_800 * 10**9)  # the years 2000 to 2100


class Run(NamedTuple):
    """A recording to show: its name and its tracks."""

    name: str
    tracks: list[Track]


class Shown(NamedTuple):
    """A hand to show.

    Attributes:
        track: its frames.
        topic: its place in the viewer, as "right" or "before_right".
        run: number of its recording.
        run_name: name of its recording; "" where there is only one.
        number: number of the hand over all recordings.
        offset: (3,) by which it is moved in the world [m].
        pale: its skin is seen through, as it lies over another's.
    """

    track: Part
    topic: str
    run: int = 0
    run_name: str = ""
    number: int = 0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pale: bool = False


def shown(runs: Sequence[Run]) -> list[Shown]:
    """All hands of all runs, each under a name of its own."""
    out: list[Shown] = []
    names: list[str] = []
    for number, run in enumerate(runs):
        name = slug = re.sub(r"[^a-z0-9]+", "_", run.name.lower()).strip("_") or "run"
        while slug in names:
            slug = f"{name}_{1 + sum(other.startswith(name) for other in names)}"
        names.append(slug)
        topics = hand_topics((t.name, t.hand) for t in run.tracks)
        for track, topic in zip(run.tracks, topics, strict=True):
            if len(runs) > 1:
                out.append(Shown(track, f"{slug}_{topic}", number, slug, len(out)))
            else:
                out.append(Shown(track, topic, number=len(out)))
    return out


def on_one_clock(runs: Sequence[Run]) -> tuple[list[Run], bool]:
    """Runs whose times can be compared, and whether they had to be moved.

    Recordings that do not overlap in time are moved so that they start together.
    """
    spans = [
        (min(t.time_ns[0] for t in known), max(t.time_ns[-1] for t in known))
        for run in runs
        if (known := [t for t in run.tracks if len(t)])
    ]
    if not spans or max(first for first, _ in spans) <= min(last for _, last in spans):
        return list(runs), False
    start = int(spans[0][0])
    moved = []
    for run in runs:
        first = min((int(t.time_ns[0]) for t in run.tracks if len(t)), default=start)
        moved.append(Run(run.name, [later(t, start - first) for t in run.tracks]))
    return moved, True


def later(track: Track, by_ns: int) -> Track:
    """The same track, so much later."""
    events = tuple(Event(e.time_ns + by_ns, e.level, e.text) for e in track.events)
    return dataclasses.replace(track, time_ns=track.time_ns + by_ns, events=events)


def origin_ns(tracks: Sequence[Part]) -> int | None:
    """What is zero on the viewer's clock: the first frame; None where stamps are Unix time."""
    return zero_of([int(t.time_ns[0]) for t in tracks if len(t)])


def zero_of(starts: Sequence[int]) -> int | None:
    """What is zero on the clock of what starts at these times [ns]; None for Unix time."""
    if starts and all(_UNIX_NS[0] <= start < _UNIX_NS[1] for start in starts):
        return None
    return min(starts, default=0)


def counterpart(hand: Shown, hands: Sequence[Shown]) -> Shown | None:
    """The hand of the first run that one of a later run is compared with, if there is one."""
    if hand.run == 0:
        return None
    first = [h for h in hands if h.run == 0 and h.track.hand == hand.track.hand]
    if len(first) > 1:
        first = [h for h in first if h.track.name == hand.track.name]
    return first[0] if len(first) == 1 else None
