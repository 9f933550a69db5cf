"""A Rerun recording into an .rrd file, with a full disk told instead of waited for."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from handtrack.viewer.abilities import writes_footers
from handtrack.viewer.streams import forget_recordings, save_to

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

_FOOTER = b"RRF2FOOT"  # 12 bytes before the end of a complete file


@contextmanager
def rrd_file(
    path: Path, application: str, blueprint: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """A recording whose content is in the file once the block has ended.

    rerun writes files in a thread of its own. When that fails nobody is told, and a later
    flush or disconnect may wait for it for ever. So it writes into a pipe, and what comes out
    of that is written here.

    Raises:
        OSError: writing failed.
    """
    import rerun as rr

    # those before, of which an error kept hold
    forget_recordings()
    recording = rr.RecordingStream(application)
    failures: list[OSError] = []
    if sys.platform == "win32":
        save_to(recording, path, blueprint)
        try:
            yield recording
        finally:
            recording.disconnect()
    else:
        source, sink = os.pipe()
        copying = threading.Thread(target=_copy, args=(source, path, failures), daemon=True)
        copying.start()
        try:
            try:
                save_to(recording, Path(f"/dev/fd/{sink}"), blueprint)
            finally:
                # rerun has opened it again: the pipe ends when rerun closes it
                os.close(sink)
            yield recording
        finally:
            recording.disconnect()
            copying.join()
    if failures:
        raise failures[0]
    if not writes_footers():
        return
    with path.open("rb") as stream:
        stream.seek(-len(_FOOTER) - 4, os.SEEK_END)
        if stream.read(len(_FOOTER)) != _FOOTER:
            raise OSError("rerun did not complete the file")


def _copy(source: int, path: Path, failures: list[OSError]) -> None:
    """From a pipe to a file; after a failure the pipe is emptied all the same."""
    with os.fdopen(source, "rb", buffering=0) as pipe:
        try:
            with path.open("wb") as file:
                while block := pipe.read(1 << 20):
                    file.write(block)
        except OSError as error:
            failures.append(error)
            while pipe.read(1 << 20):
                continue
