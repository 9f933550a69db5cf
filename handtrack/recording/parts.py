"""Parts of recordings: the hands that are asked for, and a stretch of time."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.tracking.track import Part, Skin, Track

P = TypeVar("P", bound=Part)


def pick(
    tracks: Sequence[Track],
    hand: str | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    span_ns: tuple[int, int] | None = None,
) -> list[Track]:
    """The tracks of one hand, or all, cut to a stretch of time.

    Args:
        tracks: those of one recording: their time begins with the first frame of them all.
        hand: "left", "right", or None for both.
        start_s, end_s: first and last time [s]; None for the recording's.
        span_ns: first and last time of the whole recording, if the tracks are a part of it.

    Returns:
        The tracks that have frames there; the given ones are not changed.

    Raises:
        SettingsError: the stretch ends before it starts, or nothing is left.
    """
    if start_s is not None and end_s is not None and not start_s < end_s:
        raise SettingsError(f"the part from {start_s:g} s to {end_s:g} s is empty")
    chosen = [t for t in tracks if hand in (None, t.hand)]
    if not chosen:
        there = " and ".join(sorted({t.hand for t in tracks})) or "no"
        raise SettingsError(f"there is no {hand} hand in the recording, only {there}")
    if start_s is None and end_s is None:
        return chosen
    if span_ns is None:
        times = np.concatenate([t.time_ns for t in tracks])
        if not times.size:
            raise SettingsError("there are no frames in the recording")
        span_ns = int(times.min()), int(times.max())
    origin = span_ns[0]
    first = -np.inf if start_s is None else origin + start_s * 1e9
    last = np.inf if end_s is None else origin + end_s * 1e9
    cut = [between(t, first, last) for t in chosen]
    if not any(map(len, cut)):
        raise SettingsError(
            f"there are no frames in that part: the recording is {(span_ns[1] - origin) / 1e9:.3f}"
            " s long"
        )
    return [t for t in cut if len(t)]


def between(track: Track, first_ns: float, last_ns: float) -> Track:
    """The frames and events from one time to another on the track's clock, both included."""
    keep = np.flatnonzero((track.time_ns >= first_ns) & (track.time_ns <= last_ns))
    events = tuple(e for e in track.events if first_ns <= e.time_ns <= last_ns)
    return dataclasses.replace(frames_of(track, keep), events=events)


def rows(track: P, some: slice) -> P:
    """Some frames of a track and the events that belong to them.

    An event goes with the first frame that is not before it, the last ones with the last frame:
    parts that make up a track have all of its events, each once.
    """
    part = frames_of(track, some)
    if not len(part):
        return dataclasses.replace(part, events=())
    start, stop, _ = some.indices(len(track))
    first = int(track.time_ns[start - 1]) if start else None
    last = int(part.time_ns[-1]) if stop < len(track) else None
    events = tuple(
        e
        for e in track.events
        if (first is None or e.time_ns > first) and (last is None or e.time_ns <= last)
    )
    return dataclasses.replace(part, events=events)


def frames_of(track: P, some: slice | NDArray[np.int64]) -> P:
    """Some frames of a track, with all its events."""
    arrays: dict[str, Any] = {
        name: None if array is None else array[some] for name, array in track.arrays().items()
    }
    if not isinstance(track, Track) or track.skin is None:
        return dataclasses.replace(track, **arrays)
    skin = SkinOfFrames(track.skin, np.arange(len(track))[some])
    return dataclasses.replace(track, **arrays, skin=skin)


class SkinOfFrames:
    """The skins of some frames of a sequence, as a `Skin`.

    Args:
        whole: the skins of all frames.
        frames: (n,) which.
    """

    def __init__(self, whole: Skin, frames: NDArray[np.int64]) -> None:
        self._whole, self._frames = whole, frames
        self.n_vertices, self.faces = whole.n_vertices, whole.faces

    def vertices(self, frames: slice | NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, V, 3) in the world [m], NaN where none was recorded."""
        return self._whole.vertices(self._frames[frames])
