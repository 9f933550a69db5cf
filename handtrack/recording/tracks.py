"""Tracks in MCAP files: written whole or as they happen, read back exactly.

What the files hold is said in `handtrack.proto`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from handtrack.errors import SettingsError
from handtrack.files.whole import whole_file
from handtrack.tracking.track import Track


def write_mcap(
    tracks: Track | Sequence[Track],
    path: str | Path,
    *,
    mesh: str | bool = "full",
    compression: str = "lz4",
    foxglove_mesh: bool = False,
) -> Path:
    """Write tracks (hands, people) of one recording to an MCAP file.

    The file takes its name only once it is complete, see `whole_file`; an existing one is
    replaced.

    Args:
        tracks: one track or several; they may have different times.
        path: the file to write.
        mesh: the skin's vertices, for viewers: "full" (float32; about 28 kB a frame),
            "quantised" (0.12 mm), "every N", "quantised,every N" or "none" (see `MeshChoice`).
            Reading back doesn't need them, unless the model is licensed.
        compression: "lz4", "zstd" or "none".
        foxglove_mesh: write the skin as `foxglove.SceneUpdate` too (about 125 kB a frame).

    Returns:
        The path written.

    Raises:
        InputError: the folder is missing, or the path is a folder.
        SettingsError: there is no track, a track's time does not increase, its settings are
            not plain JSON, or mesh or compression are unknown.
        HandtrackError: writing failed (a full disk, no permission).
    """
    from handtrack.recording.mesh_choice import MeshChoice
    from handtrack.recording.write import Choices, write_messages

    choices = Choices(MeshChoice.of(mesh), foxglove_mesh, compression)
    tracks = [tracks] if isinstance(tracks, Track) else list(tracks)
    if not tracks:
        raise SettingsError("there is no track to write")
    path = Path(path)
    with whole_file(path) as part, part.open("wb") as stream:
        write_messages(stream, tracks, choices)
        stream.flush()
        os.fsync(stream.fileno())
    return path


def read_mcap(
    path: str | Path, *, start_ns: int | None = None, end_ns: int | None = None
) -> list[Track]:
    """Read the tracks of an MCAP file of any format version, in the order written.

    All of a Track comes back exactly, to the bit; of a licensed model (MANO) not its template,
    which the file doesn't hold, but the skins that it does.

    A file whose writer was stopped is read up to its last whole chunk, with a UserWarning
    that says how much that is.

    Args:
        path: the file.
        start_ns, end_ns: first and last time wanted [ns], on the recording's clock; a complete
            file is read only there.

    Raises:
        InputError: there is no such file, it is not such a recording, it is damaged (with
            the place), or nothing of it is whole.
    """
    from handtrack.recording.read import read_tracks

    return read_tracks(Path(path), start_ns, end_ns)


def follow_mcap(
    path: str | Path, *, poll_s: float = 0.1, timeout_s: float = 10.0
) -> Iterator[Track]:
    """Read a recording while it is written.

    Args:
        path: the part that a `McapRecorder` writes (`recorder.part`), or any recording.
        poll_s: how often to look for more [s].
        timeout_s: how long to wait for more [s]; the writer may be dead.

    Yields:
        The next frames of a hand, as a Track, until the recording is complete or nothing
        comes any more.

    Raises:
        InputError: as `read_mcap`.
    """
    from handtrack.recording.read import follow_tracks

    return follow_tracks(Path(path), poll_s, timeout_s)
