"""A part of a recording, without reading all of it."""

from __future__ import annotations

import math
from pathlib import Path

from handtrack.errors import SettingsError
from handtrack.recording.info import info
from handtrack.recording.tracks import read_mcap
from handtrack.recording.window import pick
from handtrack.tracking.track import Track


def read_part(
    path: str | Path,
    hand: str | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> list[Track]:
    """`pick` from a recording; of a complete file only what is asked for is read.

    Raises:
        InputError: as `read_mcap`.
        SettingsError: as `pick`.
    """
    if start_s is None and end_s is None:
        return pick(read_mcap(path), hand)
    spans = [(h["first_ns"], h["last_ns"]) for h in info(path)["hands"].values() if h["frames"]]
    if not spans:
        raise SettingsError("there are no frames in the recording")
    span = min(first for first, _ in spans), max(last for _, last in spans)
    # a nanosecond more on either side: `pick` is exact
    start = None if start_s is None else span[0] + math.floor(start_s * 1e9) - 1
    end = None if end_s is None else span[0] + math.ceil(end_s * 1e9) + 1
    return pick(read_mcap(path, start_ns=start, end_ns=end), hand, start_s, end_s, span)
