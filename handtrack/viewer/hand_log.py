"""One hand in Rerun, sent as a whole or part by part: skin, skeletons, marks and its plots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import ANGLE_JOINT, BONES, JOINT_NAMES
from handtrack.hand.skinning import VertexNormals
from handtrack.tracking.track import Part
from handtrack.viewer import style
from handtrack.viewer.eye import GRID_M, Eye, middles
from handtrack.viewer.hand_plots import HELD, HandPlots, limit_marks, rings
from handtrack.viewer.sending import ROWS, Sender, batches
from handtrack.viewer.shown import Shown
from handtrack.viewer.style import Look

if TYPE_CHECKING:
    import rerun as rr

_DOWN = 0.9  # of the way to the lower edge of what is seen: labels are below, and stay inside
_WIDE_M = 0.25  # half of a picture whose bar is the longer one


def log_scale(recording: rr.RecordingStream, entity: str, view: Eye, light: bool) -> None:
    """The axes at the lower left of what is seen, the bar at the lower right, in the plane of
    what the eye looks at.

    Args:
        recording: where to.
        entity: under which; its origin is the eye's target where the eye goes along.
        view: the eye.
        light: on a light ground.
    """
    import rerun as rr

    width, height = view.extent
    corner = -_DOWN * height * view.upward + view.looked_at
    length = 0.1 if width > _WIDE_M else 0.05
    left, right = corner - width * view.right, corner + width * view.right
    vectors = 0.5 * length * np.eye(3)
    axes = rr.Arrows3D(
        origins=[left] * 3,
        vectors=vectors,
        radii=0.015 * length,
        colors=[style.toned(colour, light) for colour in style.AXES],
    )
    recording.log(f"{entity}/axes", axes, static=True)
    bar = rr.LineStrips3D(
        [[right - length * view.right, right]],
        radii=0.02 * length,
        colors=style.ground(light).text,
    )
    recording.log(f"{entity}/bar", bar, static=True)
    # names stand on boxes of the viewer's, which are grey on any ground: light on them
    names = rr.Points3D(
        [*(left + 1.2 * vectors), right - 0.5 * length * view.right],
        radii=1e-5,
        colors=[*([style.DARK.text] * 3 if light else style.AXES), style.DARK.text],
        labels=["x", "y", "z", f"{100 * length:.0f} cm"],
        show_labels=True,
    )
    recording.log(f"{entity}/names", names, static=True)


def log_ground(recording: rr.RecordingStream, entity: str, view: Eye, light: bool) -> None:
    """Lines `GRID_M` apart below the hand, as far as it comes: what stays while the eye goes."""
    import rerun as rr

    up = view.up / np.linalg.norm(view.up)
    deep = np.cross(view.right, up)
    middle = view.target + (view.floor - view.target @ up) * up
    steps = GRID_M * np.arange(-round(view.reach / GRID_M), round(view.reach / GRID_M) + 1)
    ends = np.array([-1, 1])[:, None] * view.reach
    lines = [
        middle + step * across + ends * other
        for across, other in ((view.right, deep), (deep, view.right))
        for step in steps
    ]
    colour = style.ground(light).grid
    recording.log(entity, rr.LineStrips3D(lines, radii=-0.3, colors=colour), static=True)


Array = NDArray[np.float64]

BATCH = 256
"""Frames whose skin is computed and sent at a time."""


class HandLog:
    """Sends a hand to a recording: `begin` once, then `add` for every stretch of its frames.

    Entities are as `log_rerun` says.

    Args:
        recording: where to.
        hand: where in the recording, and in which colours; of its track only what does not
            change over time is looked at.
        origin: zero of the clock [ns]; None for dates.
        look: how it is shown.
        view: the eye, for the hand beside which axes and scale are drawn, and with which the
            eye goes along.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        hand: Shown,
        origin: int | None,
        look: Look | None = None,
        view: Eye | None = None,
    ) -> None:
        self.sender = Sender(recording, origin)
        self._hand, self._look, self._view = hand, look or Look(), view
        self._limits = self._look.limits or hand.track.model.limits
        self._plots = HandPlots(self.sender, hand, self._limits, self._look.light)
        self._skeletons = [
            (style.OBSERVED, "observed"),
            (style.FITTED, "fitted_joints"),
            *([(style.FILTERED, "filtered_joints")] if hand.track.filtered else []),
            *([(style.TRUTH, "truth")] if hand.track.truth is not None else []),
        ]
        self._normals: VertexNormals | None = None
        if self._look.mesh and hand.track.n_vertices:
            self._normals = VertexNormals(hand.track.faces, hand.track.n_vertices)
        self._had_rejected = self._began = False

    def begin(self) -> None:
        """Send what stays: triangles, colours, names."""
        import rerun as rr

        hand, track, world = self._hand, self._hand.track, f"world/{self._hand.topic}"
        static = self.sender.static
        static(world, rr.AnnotationContext(self._descriptions()))
        if any(hand.offset):
            static(world, rr.Transform3D(translation=hand.offset))
        for class_id, _ in self._skeletons:
            name, _, radius = style.SKELETONS[class_id]
            points = rr.Points3D.from_fields(class_ids=class_id, radii=radius, show_labels=False)
            static(f"{world}/{name}", points)
        static(f"{world}/limits", rr.LineStrips3D.from_fields(radii=style.RING_WIDTH))
        rejected = rr.Points3D.from_fields(
            radii=style.REJECTED_RADIUS, colors=style.REJECTED, show_labels=False
        )
        static(f"{world}/rejected", rejected)
        if self._normals is not None:
            colour = style.skin_colour(hand.number, hand.pale)
            mesh = rr.Mesh3D.from_fields(triangle_indices=track.faces, albedo_factor=colour)
            static(f"{world}/skin", mesh)
        if self._view is not None:
            along = self._view.goes_along
            if along:
                log_ground(self.sender.recording, f"{world}/ground", self._view, self._look.light)
            entity = f"{world}/middle/scale" if along else f"{world}/scale"
            log_scale(self.sender.recording, entity, self._view, self._look.light)
        self._plots.begin()

    def add(self, part: Part) -> None:
        """Send the next frames."""
        if not len(part):
            return
        for class_id, attribute in self._skeletons:
            self._skeleton(part, class_id, getattr(part, attribute))
        self._rejected(part)
        marks = limit_marks(self._limits, part.angles)
        self._marks(part, marks)
        self._plots.add(part, marks)
        if self._view is not None and self._view.goes_along:
            self._middle(part)
        if self._normals is not None:
            self._skin(part, self._normals)

    def _descriptions(self) -> list[Any]:
        """What the skeletons are called, their colours and bones."""
        import rerun as rr

        # in views of its own a run needs no colours of its own: the key tells them
        run = 0 if self._look.apart else self._hand.run
        return [
            rr.ClassDescription(
                info=rr.AnnotationInfo(id=id_, label=label, color=colour),
                keypoint_annotations=[
                    rr.AnnotationInfo(id=j, label=name, color=colour)
                    for j, name in enumerate(JOINT_NAMES)
                ],
                keypoint_connections=BONES,
            )
            for id_, (label, colour, _) in style.skeletons(run, self._look.light).items()
        ]

    def _middle(self, part: Part) -> None:
        """Where the hand is, for the eye that goes along; it waits while the hand is lost."""
        import rerun as rr

        places = middles(part.filtered_joints)
        if not self._began and not np.isfinite(places[0]).all():
            places[0] = self._view.target if self._view else 0.0  # until the hand is there
        self._began = True
        found = np.flatnonzero(np.isfinite(places).all(1))
        for some in batches(len(found), ROWS):
            columns = rr.Transform3D.columns(translation=places[found[some]].astype(np.float32))
            self.sender.send(part, f"world/{self._hand.topic}/middle", columns, found[some])

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
            self.sender.send(
                part, f"world/{self._hand.topic}/skin", columns.partition(counts), rows
            )

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
            self.sender.send(part, entity, columns.partition(present.sum(1)), rows)

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
            self.sender.send(part, entity, columns.partition(counts[at]), at)

    def _marks(self, part: Part, marks: NDArray[np.uint8]) -> None:
        """Rings about the joints that a limit holds, and about those that are outside."""
        import rerun as rr

        entity = f"world/{self._hand.topic}/limits"
        for rows in batches(len(part), ROWS):
            joints = np.zeros((len(marks[rows]), len(JOINT_NAMES)), np.uint8)
            joints[:, ANGLE_JOINT] = marks[rows]  # the two of a saddle are equal
            marked = (joints >= HELD) & np.isfinite(part.filtered_joints[rows]).all(-1)
            frame, joint = np.nonzero(marked)
            strips = rings(part.filtered_joints[rows][frame], joint).astype(np.float32)
            columns = rr.LineStrips3D.columns(
                strips=strips, colors=style.MARKS[joints[marked] - HELD]
            )
            self.sender.send(part, entity, columns.partition(marked.sum(1)), rows)
