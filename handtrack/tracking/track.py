"""Track: all that was computed of a tracked sequence, with what made it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import ANGLE_JOINT, N_JOINTS, Hand
from handtrack.mcap.hand import Event as Event
from handtrack.mcap.hand import Head
from handtrack.mcap.state import Stretch

Array = NDArray[np.float64]
STATUSES = ("fitted", "predicted", "lost")


class Skin(Protocol):
    """Skins of a sequence that were computed once.

    Attributes:
        n_vertices: V.
        faces: (F, 3) triangles.
    """

    n_vertices: int
    faces: NDArray[np.int32]

    def vertices(self, frames: slice | NDArray[np.int64]) -> Array:
        """(n, V, 3) in the world [m], NaN where none was recorded."""
        ...


class SkinOfFrames:
    """The skins of some frames of a sequence, as a `Skin`.

    Args:
        whole: the skins of all frames.
        frames: (n,) which.
    """

    def __init__(self, whole: Skin, frames: NDArray[np.int64]) -> None:
        self._whole, self._frames = whole, frames
        self.n_vertices, self.faces = whole.n_vertices, whole.faces

    def vertices(self, frames: slice | NDArray[np.int64]) -> Array:
        """(n, V, 3) in the world [m], NaN where none was recorded."""
        return self._whole.vertices(self._frames[frames])


@dataclass(frozen=True, eq=False)
class Track:
    """A tracked sequence. Recorders, replay, metrics and reports see only this.

    Shapes are for T frames; metres, radians, nanoseconds, quaternions wxyz (root to world). Its
    arrays can only be read: parts of a track share them. Where nothing was fitted (status "lost")
    poses and fitted joints are NaN.

    Attributes:
        name, hand, source, subject: as in the Sequence.
        time_ns: (T,) int64.
        frame_index: (T,) int64, frame numbers of the source.
        observed: (T, 21, 3) the joints given, NaN = missing.
        confidence: (T, 21) as given, 0 where missing.
        truth: (T, 21, 3) or None.
        angles_raw, angles: (T, 20) as fitted, and after the filter (equal without one).
        quaternion_raw, quaternion: (T, 4).
        translation_raw, translation: (T, 3).
        fitted_joints, filtered_joints: (T, 21, 3) of the raw and of the filtered pose.
        angle_variance: (T, 20) [rad^2] of the raw angles, inf where nothing observes one.
        objective: (T,) sum of weighted squared distances [m^2] of the raw fit.
        sweeps: (T,) iterations of the fitter.
        status: (T,) of "fitted", "predicted", "lost".
        reason: (T,) why, for every frame that is not plainly fitted; else "".
        rejected: (T, 21) joints that were seen, but are outliers and were not used.
        restart: (T,) frames where the hand was found anew, after it was gone for longer than a
            filter goes on, far from where it was, or in another pose: what was before says
            nothing of them.
        model: the hand that was fitted.
        settings: what made the track: plain JSON values by name.
        version: version of handtrack that made it.
        events: what happened, in order of time.
        skin: the skin as recorded, where the model cannot make it: a licensed one that was read
            from a recording.
    """

    name: str
    hand: Hand
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    observed: Array
    confidence: Array
    truth: Array | None
    angles_raw: Array
    angles: Array
    quaternion_raw: Array
    quaternion: Array
    translation_raw: Array
    translation: Array
    fitted_joints: Array
    filtered_joints: Array
    angle_variance: Array
    objective: Array
    sweeps: NDArray[np.int64]
    status: NDArray[np.str_]
    reason: NDArray[np.str_]
    model: HandModel
    settings: Mapping[str, object] = field(default_factory=dict)
    version: str = ""
    source: str = ""
    subject: str = ""
    events: tuple[Event, ...] = ()
    skin: Skin | None = None
    rejected: NDArray[np.bool_] = field(default=None)  # type: ignore[arg-type]
    restart: NDArray[np.bool_] = field(default=None)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        for name, shape in (("rejected", (len(self), N_JOINTS)), ("restart", (len(self),))):
            given = getattr(self, name)
            array = np.zeros(shape, bool) if given is None else np.asarray(given, dtype=bool)
            object.__setattr__(self, name, array)
        for of in fields(self):
            value = getattr(self, of.name)
            if isinstance(value, np.ndarray) and value.flags.writeable:
                # a view: who made the array may go on with it
                view = value.view()
                view.flags.writeable = False
                object.__setattr__(self, of.name, view)

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def head(self) -> Head:
        """All that is not of its frames."""
        return Head(
            name=self.name,
            hand=self.hand,
            model=self.model,
            settings=self.settings,
            version=self.version,
            source=self.source,
            subject=self.subject,
            has_truth=self.truth is not None,
            faces=self.faces,
            n_vertices=self.n_vertices,
        )

    @property
    def timed(self) -> bool:
        """Whether the source said how fast time goes; else a rate was assumed."""
        return "time" not in self._assumed

    @property
    def numbered(self) -> bool:
        """Whether `frame_index` is the source's; else frames were counted."""
        return "frame numbers" not in self._assumed

    @property
    def _assumed(self) -> list[object]:
        said = self.settings.get("assumed")
        return said if isinstance(said, list) else []

    @property
    def filtered(self) -> bool:
        """Whether an angle filter made `angles` differ from `angles_raw`."""
        return self.settings.get("filter", "none") != "none"

    @property
    def error(self) -> Array:
        """(T, 21) distance of each observed joint to the fitted (raw) one [m], NaN if missing."""
        return np.asarray(np.linalg.norm(self.fitted_joints - self.observed, axis=-1))

    @property
    def measured_joints(self) -> NDArray[np.bool_]:
        """(21,) which joints any frame tells of: seen, or before one that is in their finger.

        The others are where the model has them, in a pose that is only expected.
        """
        seen = np.isfinite(self.observed[..., 0]) & (self.confidence > 0) & ~self.rejected
        fingers = np.asarray(seen.any(axis=0))[1:].reshape(5, 4)
        onwards = np.logical_or.accumulate(fingers[:, ::-1], axis=1)[:, ::-1]
        return np.concatenate([[True], onwards.ravel()])

    @property
    def measured_angles(self) -> NDArray[np.bool_]:
        """(20,) which angles any frame tells of: those with a joint beyond theirs seen."""
        return np.asarray(self.measured_joints[ANGLE_JOINT + 1])

    @property
    def fps(self) -> float:
        """Median frame rate [1/s]; NaN for a single frame."""
        return float(1e9 / np.median(np.diff(self.time_ns))) if len(self) > 1 else float("nan")

    @property
    def n_vertices(self) -> int:
        """How many vertices `vertices` has; 0 where there is no skin."""
        return len(self.model.rest_vertices) if self.skin is None else self.skin.n_vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(F, 3) triangles of `vertices`, counter-clockwise from outside."""
        return self.model.faces if self.skin is None else self.skin.faces

    def vertices(self, frames: slice | NDArray[np.int64] | None = None) -> Array:
        """(n, V, 3) skin of the filtered poses in the world [m], NaN in lost frames.

        Where `skin` is there, what it holds: NaN too in frames without a recorded skin.
        """
        if self.skin is not None:
            return self.skin.vertices(slice(None) if frames is None else frames)
        pick = slice(None) if frames is None else frames
        rotation = quaternion_to_matrix(self.quaternion[pick])
        return self.model.vertices(self.angles[pick], rotation, self.translation[pick])


def track_of(stretches: Sequence[Stretch], skin: Skin | None = None) -> Track:
    """The Track that stretches of one hand make, one or more, in order of time.

    Args:
        stretches: they.
        skin: as in `Track`.
    """
    first = stretches[0]
    head, arrays = first.head, first.arrays()
    if len(stretches) > 1:
        arrays = {
            name: None if value is None else np.concatenate([getattr(s, name) for s in stretches])
            for name, value in arrays.items()
        }
    return Track(
        name=head.name,
        hand=head.hand,
        model=head.model,
        settings=head.settings,
        version=head.version,
        source=head.source,
        subject=head.subject,
        events=tuple(event for s in stretches for event in s.events),
        skin=skin,
        **arrays,
    )


def mean_and_max(distance: Array) -> tuple[Array, Array]:
    """(T,) mean and greatest of the known values in each row (T, n), NaN where there is none."""
    known = np.isfinite(distance)
    count = known.sum(1)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, distance, 0).sum(1) / count
    greatest = np.where(known, distance, -np.inf).max(1)
    return mean, np.where(count > 0, greatest, np.nan)
