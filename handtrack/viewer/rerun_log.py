"""Tracks as Rerun entities, into a recording or an .rrd file that opens well arranged."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from handtrack.errors import SettingsError
from handtrack.files.whole import whole_file
from handtrack.tracking.track import Track, mean_and_max, tracks_of
from handtrack.viewer import style
from handtrack.viewer.blueprint import Placed, blueprint, placed
from handtrack.viewer.eye import Eye
from handtrack.viewer.hand_log import HandLog
from handtrack.viewer.key import log_key
from handtrack.viewer.picture_log import PictureView, log_pictures
from handtrack.viewer.sending import forget_recordings, indexes, save_to, send_blueprint
from handtrack.viewer.shown import Run, Shown, counterpart, origin_ns, shown
from handtrack.viewer.style import Look
from handtrack.viewer.versions import writes_footers

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

APPLICATION = "handtrack"


def application(name: str) -> str:
    """The application that a recording says it is of: viewers keep one layout for each."""
    return f"{APPLICATION}: {name}" if name else APPLICATION


def log_rerun(
    tracks: Track | Sequence[Track],
    *,
    recording: rr.RecordingStream | None = None,
    save: str | Path | None = None,
    mesh: bool = True,
    light: bool = False,
    pictures: Sequence[PictureView] = (),
) -> Path | None:
    """Show tracks in Rerun, or save them as an .rrd file that opens well arranged.

    Every hand is under its own name (see `hand_topics`): `world/NAME/...` in metres,
    `angles/NAME/FINGER/...` in degrees, `errors/NAME` in millimetres, `status/NAME` and
    `log/NAME`. The timelines are "frame", the source's frame numbers, and "time": the time
    since the first frame, or the date where the stamps are Unix time.

    Args:
        tracks: one track or several, drawn in the same world.
        recording: where to log; Rerun's active recording if neither this nor `save` is given.
        save: an .rrd file to write instead; it takes its name only once it is complete.
        mesh: draw the skin, where the model has one.
        light: draw on a light ground.
        pictures: what cameras saw, shown beside the hands.

    Returns:
        The file written, if any.

    Raises:
        SettingsError: there is no track, both or neither of `recording` and `save` are there.
        InputError: the folder of `save` is missing.
        HandtrackError: writing failed.
    """
    import rerun as rr

    tracks = tracks_of(tracks)
    if not tracks:
        raise SettingsError("there is no track to show")
    hands, look = shown([Run("", tracks)]), Look(mesh=mesh, light=light)
    if save is not None:
        if recording is not None:
            raise SettingsError("give a recording or a file to save, not both")
        return save_hands(hands, Path(save), look, pictures)
    recording = recording or rr.get_data_recording()
    if recording is None:
        raise SettingsError("no Rerun recording is active: give one, or a file to save")
    at = placed(hands, look, bool(pictures))
    names = [picture.name for picture in pictures]
    send_blueprint(recording, blueprint(hands, look, at=at, pictures=names))
    log_hands(recording, hands, look, pictures, at=at)
    recording.flush()
    return None


def save_hands(
    hands: Sequence[Shown],
    path: Path,
    look: Look | None = None,
    pictures: Sequence[PictureView] = (),
) -> Path:
    """Write hands to an .rrd file; arguments and errors as of `log_rerun` and `blueprint`."""
    at = placed(hands, look, bool(pictures))
    arranged = blueprint(hands, look, at=at, pictures=[view.name for view in pictures])
    with whole_file(path) as part, rrd_file(part, application(path.stem), arranged) as file:
        log_hands(file, hands, look, pictures, at=at)
    del file
    forget_recordings()
    return path


def log_hands(
    recording: rr.RecordingStream,
    hands: Sequence[Shown],
    look: Look | None = None,
    pictures: Sequence[PictureView] = (),
    *,
    at: Placed | None = None,
) -> None:
    """Send hands whole, and how far those of later runs are from those of the first.

    Args:
        recording: where to.
        hands, look, pictures: as of `blueprint`.
        at: where the eye is, as the blueprint that was sent has it.
    """
    origin = origin_ns([hand.track for hand in hands])
    at = at or placed(hands, look, bool(pictures))
    log_pictures(recording, pictures, lambda frame, time: indexes(frame, time, origin))
    for log, hand in logs_of(recording, hands, look, at.view, origin):
        log.add(hand.track)
        if (first := counterpart(hand, hands)) is not None:
            _difference(log, hand, first, (look or Look()).light)


def logs_of(
    recording: rr.RecordingStream,
    hands: Sequence[Shown],
    look: Look | None,
    view: Eye,
    origin: int | None,
) -> list[tuple[HandLog, Shown]]:
    """What sends each hand, after what stays was sent; the first of each run has the scale."""
    log_key(recording, hands, (look or Look()).light)
    found = []
    for i, hand in enumerate(hands):
        first = not any(other.run == hand.run for other in hands[:i])
        log = HandLog(recording, hand, origin, look, view if first else None)
        log.begin()
        found.append((log, hand))
    return found


def _difference(log: HandLog, hand: Shown, first: Shown, light: bool) -> None:
    """Distance of the filtered joints to those of another run at the same times [mm]."""
    import rerun as rr

    _, at, there = np.intersect1d(hand.track.time_ns, first.track.time_ns, return_indices=True)
    if not at.size:
        return
    joints = hand.track.filtered_joints[at], first.track.filtered_joints[there]
    values = 1e3 * np.stack(mean_and_max(np.linalg.norm(joints[0] - joints[1], axis=-1)), 1)
    colour = style.toned(style.run_colour(hand.run), light)
    lines = rr.SeriesLines(
        colors=[colour, (*colour[:3], style.RAW_ALPHA)],
        widths=[1.8, 1.0],
        names=[f"{kind}, {hand.run_name} to {first.run_name}" for kind in ("mean", "max")],
    )
    entity = f"difference/{hand.topic}"
    log.sender.static(entity, lines)
    log.sender.scalars(entity, hand.track, values, at)


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
