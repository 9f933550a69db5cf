"""One hand in Rerun, sent as a whole or part by part: skin, skeletons, angles, errors, events."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.limits import Limits
from handtrack.hand.normals import VertexNormals
from handtrack.hand.skeleton import ANGLE_JOINT, BONES, FINGERS, JOINT_NAMES
from handtrack.tracking.events import log_lines
from handtrack.tracking.track import Part, mean_and_max
from handtrack.viewer import style
from handtrack.viewer.blueprint import draws_states
from handtrack.viewer.limit_marks import HELD, OUTSIDE, limit_marks
from handtrack.viewer.shown import Shown

if TYPE_CHECKING:
    import rerun as rr

Array = NDArray[np.float64]

BATCH = 256
"""Frames whose skin is computed and sent at a time."""
ROWS = 4096
"""Rows of all else that are sent at a time: the viewer looks through few of them for a frame."""


def indexes(frames: NDArray[np.int64], time_ns: NDArray[np.int64], origin: int | None) -> list[Any]:
    """The time columns of frames (T,) at time_ns (T,): since the origin, or dates without one."""
    import rerun as rr

    if origin is None:
        time = rr.TimeColumn("time", timestamp=time_ns.astype("datetime64[ns]"))
    else:
        time = rr.TimeColumn("time", duration=(time_ns - origin).astype("timedelta64[ns]"))
    return [rr.TimeColumn("frame", sequence=frames), time]


class HandLog:
    """Sends a hand to a recording: `begin` once, then `add` for every stretch of its frames.

    Entities are as `log_rerun` says.

    Args:
        recording: where to.
        hand: where in the recording, and in which colours; of its track only what does not
            change over time is looked at.
        origin: zero of the clock [ns]; None for dates.
        mesh: send the skin, if there is one.
        limits: the limits to draw and to hold the angles against; the model's by default.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        hand: Shown,
        origin: int | None,
        mesh: bool = True,
        limits: Limits | None = None,
    ) -> None:
        self._recording, self._hand, self._origin = recording, hand, origin
        model = hand.track.model
        self._limits = limits or model.limits
        self._skeletons = [
            (style.OBSERVED, "observed"),
            (style.FITTED, "fitted_joints"),
            *([(style.FILTERED, "filtered_joints")] if hand.track.filtered else []),
            *([(style.TRUTH, "truth")] if hand.track.truth is not None else []),
        ]
        self._normals: VertexNormals | None = None
        if mesh and hand.track.n_vertices:
            self._normals = VertexNormals(hand.track.faces, hand.track.n_vertices)
        self._before = ("fitted", "")
        self._had_rejected = self._had_turns = False
        self._status = ""

    def begin(self) -> None:
        """Send what stays: triangles, colours, names."""
        import rerun as rr

        hand, track, world = self._hand, self._hand.track, f"world/{self._hand.topic}"
        self._static(world, rr.AnnotationContext(self._descriptions()))
        if any(hand.offset):
            self._static(world, rr.Transform3D(translation=hand.offset))
        for class_id, _ in self._skeletons:
            name, _, radius = style.SKELETONS[class_id]
            points = rr.Points3D.from_fields(class_ids=class_id, radii=radius, show_labels=False)
            self._static(f"{world}/{name}", points)
        marks = rr.Points3D.from_fields(radii=style.MARK_RADIUS, show_labels=False)
        self._static(f"{world}/limits", marks)
        rejected = rr.Points3D.from_fields(
            radii=style.REJECTED_RADIUS, colors=style.REJECTED, show_labels=False
        )
        self._static(f"{world}/rejected", rejected)
        if self._normals is not None:
            colour = style.skin_colour(hand.number, hand.run)
            mesh = rr.Mesh3D.from_fields(triangle_indices=track.faces, albedo_factor=colour)
            self._static(f"{world}/skin", mesh)
        for finger, name in enumerate(FINGERS):
            entity = f"angles/{hand.topic}/{name}"
            labels = style.angle_labels(finger)
            colours = style.angle_colours(hand.run)
            wide = {"angles": (255, style.FILTERED_WIDTH), "limits": (style.LIMIT_ALPHA, 1.0)}
            if track.filtered:
                wide["raw"] = (style.RAW_ALPHA, style.RAW_WIDTH)
            for kind, (alpha, width) in wide.items():
                lines = rr.SeriesLines(
                    colors=[(*colour[:3], alpha) for colour in colours] * (1 + (kind == "limits")),
                    widths=[width] * (4 + 4 * (kind == "limits")),
                    # what shares a name shares its entry in the legend
                    names=labels * (1 + (kind == "limits")),
                )
                self._static(f"{entity}/{kind}", lines)
        shown = style.ERRORS[: 2 + (track.truth is not None)]
        lines = rr.SeriesLines(
            colors=[colour for _, colour in shown],
            widths=[1.5] * len(shown),
            names=[name for name, _ in shown],
        )
        self._static(f"errors/{hand.topic}", lines)
        if draws_states():
            states = rr.StateConfiguration(
                values=list(style.STATUS_COLOURS), colors=list(style.STATUS_COLOURS.values())
            )
            self._static(f"status/{hand.topic}", states)

    def add(self, part: Part) -> None:
        """Send the next frames."""
        if not len(part):
            return
        for class_id, attribute in self._skeletons:
            self._skeleton(part, class_id, getattr(part, attribute))
        self._rejected(part)
        self._angles(part)
        self._marks(part)
        self._errors(part)
        self._turns(part)
        self._states(part)
        self._lines(part)
        if self._normals is not None:
            self._skin(part, self._normals)

    def scalars(self, entity: str, part: Part, values: Array, rows: NDArray[np.int64]) -> None:
        """Send values (n, k) of the part's frames `rows` (n,) to plot."""
        for some in batches(len(rows), ROWS):
            self._send(part, entity, _scalars(values[some]), rows[some])

    def _static(self, entity: str, archetype: Any) -> None:
        self._recording.log(entity, archetype, static=True)

    def _send(self, part: Part, entity: str, columns: Any, rows: Any = slice(None)) -> None:
        """Columns of the part's frames `rows`."""
        times = indexes(part.frame_index[rows], part.time_ns[rows], self._origin)
        self._recording.send_columns(entity, times, columns)

    def _descriptions(self) -> list[Any]:
        """What the skeletons are called, their colours and bones."""
        import rerun as rr

        return [
            rr.ClassDescription(
                info=rr.AnnotationInfo(id=id_, label=label, color=colour),
                keypoint_annotations=[
                    rr.AnnotationInfo(id=j, label=name, color=colour)
                    for j, name in enumerate(JOINT_NAMES)
                ],
                keypoint_connections=BONES,
            )
            for id_, (label, colour, _) in style.skeletons(self._hand.run).items()
        ]

    def _skin(self, part: Part, normals: VertexNormals) -> None:
        """The skin of the filtered pose, with normals; nothing where there is no pose."""
        import rerun as rr

        for batch in batches(len(part), BATCH):
            with np.errstate(invalid="ignore", divide="ignore"):
                vertices = part.vertices(batch).astype(np.float32)
            known = np.asarray(np.isfinite(vertices[:, 0]).all(1))
            vertices = vertices[known]
            # a skin that was not recorded, though there is a pose, leaves the one before
            lost = ~np.asarray(np.isfinite(part.angles[batch]).all(1))
            sent = np.asarray(known | lost)
            rows, known = np.arange(len(part))[batch][sent], known[sent]
            columns = rr.Mesh3D.columns(
                vertex_positions=vertices.reshape(-1, 3),
                vertex_normals=normals(vertices).reshape(-1, 3),
            )
            counts = known * part.n_vertices
            self._send(part, f"world/{self._hand.topic}/skin", columns.partition(counts), rows)

    def _skeleton(self, part: Part, class_id: int, joints: Array) -> None:
        """Only joints that are there, so that a missing one takes its bones with it."""
        import rerun as rr

        entity = f"world/{self._hand.topic}/{style.SKELETONS[class_id][0]}"
        for rows in batches(len(part), ROWS):
            present = np.isfinite(joints[rows]).all(-1)
            columns = rr.Points3D.columns(
                positions=joints[rows][present].astype(np.float32),
                keypoint_ids=np.nonzero(present)[1],
            )
            self._send(part, entity, columns.partition(present.sum(1)), rows)

    def _rejected(self, part: Part) -> None:
        """The observed joints that were not used, where there are some or were just before."""
        import rerun as rr

        counts = part.rejected.sum(1)
        found = np.flatnonzero((counts > 0) | np.r_[self._had_rejected, counts[:-1] > 0])
        self._had_rejected = bool(counts[-1])
        entity = f"world/{self._hand.topic}/rejected"
        for some in batches(len(found), ROWS):
            at = found[some]
            positions = part.observed[at][part.rejected[at]].astype(np.float32)
            columns = rr.Points3D.columns(positions=positions)
            self._send(part, entity, columns.partition(counts[at]), at)

    def _marks(self, part: Part) -> None:
        """The joints that a limit holds, and those that are outside."""
        import rerun as rr

        topic = self._hand.topic
        marks = limit_marks(self._limits, part.angles)
        for rows in batches(len(part), ROWS):
            joints = np.zeros((len(marks[rows]), len(JOINT_NAMES)), np.uint8)
            joints[:, ANGLE_JOINT] = marks[rows]  # the two of a saddle are equal
            marked = (joints >= HELD) & np.isfinite(part.filtered_joints[rows]).all(-1)
            columns = rr.Points3D.columns(
                positions=part.filtered_joints[rows][marked].astype(np.float32),
                colors=style.MARKS[joints[marked] - HELD],
            )
            self._send(part, f"world/{topic}/limits", columns.partition(marked.sum(1)), rows)
        for finger, name in enumerate(FINGERS):
            of_finger = slice(4 * finger, 4 * finger + 4)
            outside = marks[:, of_finger] == OUTSIDE
            found = np.flatnonzero(outside.any(1))
            if found.size:
                entity = f"angles/{topic}/{name}/outside"
                self._static(
                    entity,
                    rr.SeriesPoints(
                        colors=[style.OUTSIDE] * 4, marker_sizes=[2.5] * 4, names=["outside"] * 4
                    ),
                )
                degrees = np.rad2deg(part.angles[found, of_finger])
                values = np.where(outside[found], degrees, np.nan)
                self.scalars(entity, part, values, found)

    def _angles(self, part: Part) -> None:
        """The angles of each finger [deg], as fitted and after the filter, and their limits."""
        kinds = [("angles", part.angles)]
        if part.filtered:
            kinds.append(("raw", part.angles_raw))
        ends = np.unique([0, len(part) - 1])
        for finger, name in enumerate(FINGERS):
            entity = f"angles/{self._hand.topic}/{name}"
            of_finger = slice(4 * finger, 4 * finger + 4)
            for kind, angles in kinds:
                for rows in batches(len(part), ROWS):
                    degrees = np.rad2deg(angles[rows, of_finger])
                    self._send(part, f"{entity}/{kind}", _scalars(degrees), rows)
            limits = np.r_[self._limits.lower[of_finger], self._limits.upper[of_finger]]
            bounds = np.tile(np.rad2deg(limits), (len(ends), 1))
            self._send(part, f"{entity}/limits", _scalars(bounds), ends)

    def _errors(self, part: Part) -> None:
        """Distances of the joints [mm]: fitted to observed, as far as used; filtered to true."""
        values = list(mean_and_max(np.where(part.rejected, np.nan, part.error)))
        if part.truth is not None:
            distance = np.linalg.norm(part.filtered_joints - part.truth, axis=-1)
            values.append(mean_and_max(distance)[0])
        millimetres = 1e3 * np.stack(values, 1)
        for rows in batches(len(part), ROWS):
            self._send(part, f"errors/{self._hand.topic}", _scalars(millimetres[rows]), rows)

    def _turns(self, part: Part) -> None:
        """Where the hand was no longer fitted, and where found, as points among the angles."""
        import rerun as rr

        fitted = part.status == "fitted"
        before = np.r_[self._status in ("", "fitted"), fitted[:-1]]
        turns = np.stack([before & ~fitted, (fitted & ~before) | part.restart], 1)
        found = np.flatnonzero(turns.any(1))
        if not found.size:
            return
        values = np.where(turns[found], 0.0, np.nan)
        for finger in FINGERS:
            entity = f"angles/{self._hand.topic}/{finger}/events"
            if not self._had_turns:
                points = rr.SeriesPoints(
                    colors=[style.STATUS_COLOURS["lost"], style.STATUS_COLOURS["fitted"]],
                    marker_sizes=[style.TURN_SIZE] * 2,
                    names=["gone", "found"],
                )
                self._static(entity, points)
            self.scalars(entity, part, values, found)
        self._had_turns = True

    def _states(self, part: Part) -> None:
        """Where the status changes."""
        import rerun as rr

        status = part.status
        rows = np.flatnonzero(np.r_[status[:1] != self._status, status[1:] != status[:-1]])
        self._status = str(status[-1])
        if rows.size and draws_states():
            columns = rr.StateChange.columns(state=status[rows].tolist())
            self._send(part, f"status/{self._hand.topic}", columns, rows)

    def _lines(self, part: Part) -> None:
        """The events, and changes of status, as lines of a log."""
        import rerun as rr

        lines = log_lines(part, self._before)
        self._before = (str(part.status[-1]), str(part.reason[-1]))
        if not lines:
            return
        time_ns = np.array([line.time_ns for line in lines], np.int64)
        # an event has only a time: its frame is the last one before it
        row = np.clip(np.searchsorted(part.time_ns, time_ns, "right") - 1, 0, None)
        levels = ["WARN" if line.level == "warning" else "INFO" for line in lines]
        columns = rr.TextLog.columns(text=[line.text for line in lines], level=levels)
        times = indexes(part.frame_index[row], time_ns, self._origin)
        self._recording.send_columns(f"log/{self._hand.topic}", times, columns)


def batches(frames: int, size: int) -> Iterator[slice]:
    """Slices of at most `size` that make up all frames."""
    for start in range(0, frames, size):
        yield slice(start, min(start + size, frames))


def _scalars(values: Array) -> Any:
    """Columns of rows (T, n)."""
    import rerun as rr

    columns = rr.Scalars.columns(scalars=values.ravel())
    return columns.partition(np.full(len(values), values.shape[1]))
