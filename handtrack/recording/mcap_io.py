"""Tracks in MCAP files: written whole or not at all, read back exactly.

What the files hold is said in `handtrack.proto`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from handtrack.errors import SettingsError
from handtrack.recording.whole_file import whole_file
from handtrack.tracking.track import Track


def write_mcap(
    tracks: Track | Sequence[Track],
    path: str | Path,
    *,
    mesh: bool = True,
    compression: str = "lz4",
) -> Path:
    """Write tracks (hands, people) of one recording to an MCAP file.

    The file takes its name only once it is complete, see `whole_file`; an existing one is
    replaced.

    Args:
        tracks: one track or several; they may have different times.
        path: the file to write.
        mesh: write the skin's vertices in every frame, for viewers (float32; about 20 kB a
            frame). Reading back doesn't need them.
        compression: "lz4", "zstd" or "none".

    Returns:
        The path written.

    Raises:
        InputError: the folder is missing, or the path is a folder.
        SettingsError: there is no track, a track's time does not increase, its settings are
            not plain JSON, or the compression is unknown.
        HandtrackError: writing failed (a full disk, no permission).
    """
    from handtrack.recording.mcap_write import write_messages

    tracks = [tracks] if isinstance(tracks, Track) else list(tracks)
    if not tracks:
        raise SettingsError("there is no track to write")
    path = Path(path)
    with whole_file(path) as part, part.open("wb") as stream:
        write_messages(stream, tracks, mesh=mesh, compression=compression)
        stream.flush()
        os.fsync(stream.fileno())
    return path


def read_mcap(path: str | Path) -> list[Track]:
    """Read the tracks of an MCAP file that `write_mcap` wrote, in the order written.

    All of a Track comes back exactly, to the bit; of a licensed model (MANO) not its skin,
    which the file doesn't hold.

    A file whose writer was stopped is read up to its last whole chunk, with a UserWarning
    that says how much that is.

    Raises:
        InputError: there is no such file, it is not such a recording, it is damaged (with
            the place), or nothing of it is whole.
    """
    from handtrack.recording.mcap_read import read_tracks

    return read_tracks(Path(path))
