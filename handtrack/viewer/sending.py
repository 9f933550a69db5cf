"""Parts of a hand on their way to Rerun, and its recordings ended in full.

Rerun's own calls leave threads behind: every `RecordingStream` has two, and so has its blueprint.
Those of a blueprint that goes by `save(default_blueprint=)` or `send_blueprint` never end, as it
holds on to itself; all others only with the process. After some 260 recordings the system gives
no more. (rerun-sdk 0.41)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.tracking.track import Part

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

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


def forget_recordings() -> None:
    """End the threads of recordings that nobody has any more."""
    import rerun_bindings

    rerun_bindings.flush_and_cleanup_orphaned_recordings()


def save_to(recording: rr.RecordingStream, path: Path, arranged: rrb.Blueprint) -> None:
    """As `RecordingStream.save` with that default blueprint.

    Raises:
        OSError: rerun cannot write there.
    """
    import rerun_bindings

    with _stored(recording, arranged) as storage:
        try:
            rerun_bindings.save(
                path=str(path), default_blueprint=storage, recording=recording.to_native()
            )
        except RuntimeError as error:
            raise OSError(f"rerun cannot write to {path}: {error}") from error


def send_blueprint(recording: rr.RecordingStream, arranged: rrb.Blueprint) -> None:
    """As `RecordingStream.send_blueprint`."""
    import rerun_bindings

    with _stored(recording, arranged) as storage:
        rerun_bindings.send_blueprint(storage, True, True, recording=recording.to_native())


@contextmanager
def _stored(recording: rr.RecordingStream, arranged: rrb.Blueprint) -> Iterator[Any]:
    """A blueprint as rerun passes it on, which goes when the block ends."""
    import rerun as rr
    import rerun_bindings
    from rerun.recording_stream import get_application_id

    name = get_application_id(recording) or "handtrack"
    native = rerun_bindings.new_blueprint(
        application_id=name, make_default=False, make_thread_default=False, default_enabled=True
    )
    stream = rr.RecordingStream._from_native(native)
    stream.set_time("blueprint", sequence=0)
    arranged._log_to_stream(stream)
    try:
        yield rr.memory_recording(stream).storage
    finally:
        # it holds its stream, and the stream it
        stream.disconnect()
