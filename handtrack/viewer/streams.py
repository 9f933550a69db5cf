"""Rerun's recordings, ended in full: its own calls leave threads behind.

Every `RecordingStream` has two threads, and so has its blueprint. Those of a blueprint that goes
by `save(default_blueprint=)` or `send_blueprint` never end, as it holds on to itself; all others
only with the process. After some 260 recordings the system gives no more. (rerun-sdk 0.41)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb


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
