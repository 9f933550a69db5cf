"""Parts of a hand on their way to Rerun: frames with their times, in pieces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.tracking.track import Part

if TYPE_CHECKING:
    import rerun as rr

Array = NDArray[np.float64]

ROWS = 4096
"""Rows that are sent at a time: the viewer looks through few of them for a frame."""


def indexes(frames: NDArray[np.int64], time_ns: NDArray[np.int64], origin: int | None) -> list[Any]:
    """The time columns of frames (T,) at time_ns (T,): since the origin, or dates without one."""
    import rerun as rr

    if origin is None:
        time = rr.TimeColumn("time", timestamp=time_ns.astype("datetime64[ns]"))
    else:
        time = rr.TimeColumn("time", duration=(time_ns - origin).astype("timedelta64[ns]"))
    return [rr.TimeColumn("frame", sequence=frames), time]


def batches(frames: int, size: int) -> Iterator[slice]:
    """Slices of at most `size` that make up all frames."""
    for start in range(0, frames, size):
        yield slice(start, min(start + size, frames))


class Sender:
    """Sends entities to a recording.

    Args:
        recording: where to.
        origin: zero of the clock [ns]; None for dates.
    """

    def __init__(self, recording: rr.RecordingStream, origin: int | None) -> None:
        self.recording, self.origin = recording, origin

    def static(self, entity: str, archetype: Any) -> None:
        """What stays."""
        self.recording.log(entity, archetype, static=True)

    def send(self, part: Part, entity: str, columns: Any, rows: Any = slice(None)) -> None:
        """Columns of the part's frames `rows`."""
        times = indexes(part.frame_index[rows], part.time_ns[rows], self.origin)
        self.recording.send_columns(entity, times, columns)

    def scalars(self, entity: str, part: Part, values: Array, rows: NDArray[np.int64]) -> None:
        """Values (n, k) of the part's frames `rows` (n,) to plot."""
        import rerun as rr

        for some in batches(len(rows), ROWS):
            columns = rr.Scalars.columns(scalars=values[some].ravel())
            counts = np.full(len(values[some]), values.shape[1])
            self.send(part, entity, columns.partition(counts), rows[some])
