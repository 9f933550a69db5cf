"""Tracks as Rerun entities: skin, skeletons, angles, errors, status and events."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.hand.skeleton import BONES, FINGERS, JOINT_NAMES
from handtrack.recording import viewer_style as style
from handtrack.recording.blueprint import blueprint
from handtrack.recording.distances import mean_and_max
from handtrack.recording.log_lines import log_lines
from handtrack.recording.normals import VertexNormals
from handtrack.recording.rrd_file import rrd_file
from handtrack.recording.topics import hand_topics
from handtrack.recording.whole_file import whole_file
from handtrack.tracking.track import Track

if TYPE_CHECKING:
    import rerun as rr

APPLICATION = "handtrack"
BATCH = 256
"""Frames whose skin is computed and sent at a time."""
_UNIX_NS = (946_684_800 * 10**9, 4_102_444_800 * 10**9)  # the years 2000 to 2100


def log_rerun(
    tracks: Track | Sequence[Track],
    *,
    recording: rr.RecordingStream | None = None,
    save: str | Path | None = None,
    mesh: bool = True,
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

    Returns:
        The file written, if any.

    Raises:
        SettingsError: there is no track, both or neither of `recording` and `save` are there.
        InputError: the folder of `save` is missing.
        HandtrackError: writing failed.
    """
    import rerun as rr

    tracks = [tracks] if isinstance(tracks, Track) else list(tracks)
    if not tracks:
        raise SettingsError("there is no track to show")
    if save is not None:
        if recording is not None:
            raise SettingsError("give a recording or a file to save, not both")
        path = Path(save)
        with whole_file(path) as part, rrd_file(part, APPLICATION, blueprint(tracks)) as file:
            _log(file, tracks, mesh)
        return path
    recording = recording or rr.get_data_recording()
    if recording is None:
        raise SettingsError("no Rerun recording is active: give one, or a file to save")
    recording.send_blueprint(blueprint(tracks))
    _log(recording, tracks, mesh)
    recording.flush()
    return None


def _log(recording: rr.RecordingStream, tracks: Sequence[Track], mesh: bool) -> None:
    starts = [int(t.time_ns[0]) for t in tracks if len(t)]
    unix = bool(starts) and all(_UNIX_NS[0] <= start < _UNIX_NS[1] for start in starts)
    origin = None if unix else min(starts, default=0)
    topics = hand_topics((t.name, t.hand) for t in tracks)
    for i, (track, topic) in enumerate(zip(tracks, topics, strict=True)):
        hand = _Hand(recording, track, topic, origin)
        hand.skeletons()
        if mesh and len(track.model.rest_vertices):
            hand.skin(style.SKINS[i % len(style.SKINS)])
        hand.angles()
        hand.errors()
        hand.status()
        hand.lines()


class _Hand:
    """Sends what one track holds, each method one kind of it."""

    def __init__(
        self, recording: rr.RecordingStream, track: Track, topic: str, origin: int | None
    ) -> None:
        self._recording, self._track, self._topic = recording, track, topic
        self._origin = origin

    def _indexes(self, frames: NDArray[np.int64], time_ns: NDArray[np.int64]) -> list[Any]:
        import rerun as rr

        if self._origin is None:
            time = rr.TimeColumn("time", timestamp=time_ns.astype("datetime64[ns]"))
        else:
            since = (time_ns - self._origin).astype("timedelta64[ns]")
            time = rr.TimeColumn("time", duration=since)
        return [rr.TimeColumn("frame", sequence=frames), time]

    def _send(self, entity: str, columns: Any, rows: slice | NDArray[np.int64]) -> None:
        """Columns of the track's frames `rows`."""
        indexes = self._indexes(self._track.frame_index[rows], self._track.time_ns[rows])
        self._recording.send_columns(entity, indexes, columns)

    def skin(self, colour: style.Colour) -> None:
        """The skin of the filtered pose, with normals; nothing where there is no pose."""
        import rerun as rr

        track, entity = self._track, f"world/{self._topic}/skin"
        model = track.model
        static = rr.Mesh3D.from_fields(triangle_indices=model.faces, albedo_factor=colour)
        self._recording.log(entity, static, static=True)
        normals = VertexNormals(model.faces, len(model.rest_vertices))
        for rows in _batches(len(track)):
            with np.errstate(invalid="ignore", divide="ignore"):
                vertices = track.vertices(rows).astype(np.float32)
            known = np.isfinite(vertices).all((1, 2))
            vertices = vertices[known]
            columns = rr.Mesh3D.columns(
                vertex_positions=vertices.reshape(-1, 3),
                vertex_normals=normals(vertices).reshape(-1, 3),
            )
            self._send(entity, columns.partition(known * len(model.rest_vertices)), rows)

    def skeletons(self) -> None:
        """The observed, fitted, filtered and true joints, as far as there are such."""
        import rerun as rr

        track = self._track
        descriptions = [
            rr.ClassDescription(
                info=rr.AnnotationInfo(id=id_, label=label, color=colour),
                keypoint_annotations=[
                    rr.AnnotationInfo(id=j, label=name, color=colour)
                    for j, name in enumerate(JOINT_NAMES)
                ],
                keypoint_connections=BONES,
            )
            for id_, (label, colour, _) in style.SKELETONS.items()
        ]
        self._recording.log(f"world/{self._topic}", rr.AnnotationContext(descriptions), static=True)
        self._skeleton(style.OBSERVED, track.observed)
        self._skeleton(style.FITTED, track.fitted_joints)
        if track.filtered:
            self._skeleton(style.FILTERED, track.filtered_joints)
        if track.truth is not None:
            self._skeleton(style.TRUTH, track.truth)

    def _skeleton(self, class_id: int, joints: NDArray[np.float64]) -> None:
        import rerun as rr

        name, _, radius = style.SKELETONS[class_id]
        entity = f"world/{self._topic}/{name}"
        static = rr.Points3D.from_fields(class_ids=class_id, radii=radius, show_labels=False)
        self._recording.log(entity, static, static=True)
        present = np.isfinite(joints).all(-1)
        # only joints that are there, so that a missing one takes its bones with it
        columns = rr.Points3D.columns(
            positions=joints[present].astype(np.float32), keypoint_ids=np.nonzero(present)[1]
        )
        self._send(entity, columns.partition(present.sum(1)), slice(None))

    def angles(self) -> None:
        """The angles of each finger [deg], as fitted and after the filter."""
        track = self._track
        for finger, name in enumerate(FINGERS):
            entity = f"angles/{self._topic}/{name}"
            if track.filtered:
                raw = (style.RAW_ALPHA, style.RAW_WIDTH)
                self._curves(f"{entity}/raw", track.angles_raw, finger, *raw)
            self._curves(f"{entity}/angles", track.angles, finger, 255, style.FILTERED_WIDTH)

    def _curves(
        self, entity: str, angles: NDArray[np.float64], finger: int, alpha: int, width: float
    ) -> None:
        import rerun as rr

        lines = rr.SeriesLines(
            colors=[(*colour[:3], alpha) for colour in style.ANGLE_COLOURS],
            widths=[width] * 4,
            # raw and filtered share names, and so an entry in the legend
            names=style.angle_labels(finger),
        )
        self._recording.log(entity, lines, static=True)
        degrees = np.rad2deg(angles[:, 4 * finger : 4 * finger + 4])
        columns = rr.Scalars.columns(scalars=degrees.ravel())
        self._send(entity, columns.partition(np.full(len(degrees), 4)), slice(None))

    def errors(self) -> None:
        """Distances of the joints [mm]: fitted to observed, filtered to true."""
        import rerun as rr

        track = self._track
        mean, greatest = mean_and_max(track.error)
        values = [mean, greatest]
        if track.truth is not None:
            distance = np.linalg.norm(track.filtered_joints - track.truth, axis=-1)
            values.append(mean_and_max(distance)[0])
        shown = style.ERRORS[: len(values)]
        lines = rr.SeriesLines(
            colors=[colour for _, colour in shown],
            widths=[1.5] * len(shown),
            names=[name for name, _ in shown],
        )
        entity = f"errors/{self._topic}"
        self._recording.log(entity, lines, static=True)
        columns = rr.Scalars.columns(scalars=1e3 * np.stack(values, 1).ravel())
        self._send(entity, columns.partition(np.full(len(track), len(values))), slice(None))

    def status(self) -> None:
        """Where the status changes."""
        import rerun as rr

        entity, status = f"status/{self._topic}", self._track.status
        names = rr.StateConfiguration(
            values=list(style.STATUS_COLOURS), colors=list(style.STATUS_COLOURS.values())
        )
        self._recording.log(entity, names, static=True)
        rows = np.flatnonzero(
            np.concatenate([[True] * (len(status) > 0), status[1:] != status[:-1]])
        )
        if rows.size:
            self._send(entity, rr.StateChange.columns(state=status[rows].tolist()), rows)

    def lines(self) -> None:
        """The events, and changes of status, as lines of a log."""
        import rerun as rr

        track, lines = self._track, log_lines(self._track)
        if not lines or not len(track):
            return
        time_ns = np.array([line.time_ns for line in lines], np.int64)
        # an event has only a time: its frame is the last one before it
        row = np.clip(np.searchsorted(track.time_ns, time_ns, "right") - 1, 0, None)
        levels = ["WARN" if line.level == "warning" else "INFO" for line in lines]
        columns = rr.TextLog.columns(text=[line.text for line in lines], level=levels)
        indexes = self._indexes(track.frame_index[row], time_ns)
        self._recording.send_columns(f"log/{self._topic}", indexes, columns)


def _batches(frames: int) -> Iterator[slice]:
    for start in range(0, frames, BATCH):
        yield slice(start, min(start + BATCH, frames))
