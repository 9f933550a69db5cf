"""Track: all that was computed of a tracked sequence, with what made it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from handtrack.deprecated import old_arguments, renamed
from handtrack.errors import InputError
from handtrack.files.long_arrays import Growing, GrowingTexts, blocks
from handtrack.hand.skeleton import ANGLE_JOINT, N_JOINTS
from handtrack.mcap.hand import About, Head
from handtrack.mcap.hand import Event as Event
from handtrack.mcap.state import States, Stretch
from handtrack.sequences.sequence import frames_between

if TYPE_CHECKING:
    import pandas
    import xarray

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


@renamed(sweeps="iterations")
@old_arguments(sweeps="iterations")
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Track(States, About):
    """A tracked sequence. Recorders, replay, metrics and reports see only this.

    Its arrays are those of `States`, with T frames; they can only be read. What is not of its
    frames is as in `About`.

    Attributes:
        events: what happened, in order of time.
        skin: the skin as recorded, where the model cannot make it: a licensed one that was read
            from a recording.
    """

    events: tuple[Event, ...] = ()
    skin: Skin | None = None

    @property
    def head(self) -> Head:
        """All that is not of its frames."""
        return Head(
            **self.about(),
            has_truth=self.truth is not None,
            faces=self.faces,
            n_vertices=self.n_vertices,
        )

    def between(self, start_s: float | None = None, end_s: float | None = None) -> Track:
        """The part from one time to another, both included [s from the first frame]; events too.

        Raises:
            InputError: no frame lies there.
        """
        keep = frames_between(self.time_ns, start_s, end_s)
        arrays: dict[str, Any] = {
            name: None if a is None else a[keep] for name, a in self.arrays().items()
        }
        a, b = self.time_ns[keep][0], self.time_ns[keep][-1]
        events = tuple(event for event in self.events if a <= event.time_ns <= b)
        return replace(self, **arrays, events=events)

    def joint_deviation(self) -> Array:
        """(T, 21) standard deviation of the filtered joints, per coordinate [m].

        It holds what frames show of the noise, after the filter, and where a detector's profile
        is known what lasts too: the landmarks' own errors, and the hand's shape. In the world;
        of one camera about the hand's middle, its turn and size left out. NaN where there is no
        pose.
        """
        from handtrack.tracking.deviation import joint_deviation

        return joint_deviation(self)

    def to_dataframe(self) -> pandas.DataFrame:
        """A pandas table: a row for each frame, by `time_s` from the first; units in the names of
        columns (`index_mcp_flexion_deg`, `wrist_x_mm`), as `handtrack export` writes .csv.

        Raises:
            SettingsError: pandas is not installed (extra `data`).
        """
        from handtrack.tracking.labelled import dataframe

        return dataframe(self)

    def to_xarray(self) -> xarray.Dataset:
        """All arrays with named dimensions (time [s], joint, space, angle); units in `attrs`.

        Raises:
            SettingsError: xarray is not installed (extra `data`).
        """
        from handtrack.tracking.labelled import dataset

        return dataset(self)

    def __repr__(self) -> str:
        from handtrack.tracking.labelled import short

        return short(self)

    def _repr_html_(self) -> str:
        from handtrack.tracking.labelled import as_html

        return as_html(self)

    @property
    def error(self) -> Array:
        """(T, 21) of each observed joint to the fitted (raw) landmark [m], NaN if missing."""
        return self.error_of(self.model)

    @property
    def landmarks(self) -> Array:
        """(T, 21, 3) the detector's landmarks of the filtered poses [m]; the joints where the model
        has none beside them."""
        return self.landmarks_of(self.model, filtered=True)

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
        return self.head.filtered

    @property
    def measured_joints(self) -> NDArray[np.bool_]:
        """(21,) which joints any frame tells of: seen, or before one that is in their finger.

        The others are where the model has them, in a pose that is only expected.
        """
        seen = np.zeros(N_JOINTS, np.bool_)
        for part in blocks(len(self)):
            given = np.isfinite(self.observed[part, :, 0]) & (self.confidence[part] > 0)
            seen |= (given & ~self.rejected[part]).any(axis=0)
        fingers = seen[1:].reshape(5, 4)
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
        return self.skin_of(self.model, slice(None) if frames is None else frames)


Part = Track | Stretch
"""Some frames of a hand, one after another, with what does not change of it."""


def track_of(stretches: Sequence[Stretch], skin: Skin | None = None) -> Track:
    """The Track that stretches of one hand make, one or more, in order of time.

    Args:
        stretches: they.
        skin: as in `Track`.
    """
    if len(stretches) == 1:
        (only,) = stretches
        return _track(only.head, only.events, skin, only.arrays())
    made = LongTrack()
    for stretch in stretches:
        made.append(stretch)
    return made.track(skin)


def _track(
    head: Head, events: Iterable[Event], skin: Skin | None, arrays: Mapping[str, Any]
) -> Track:
    return Track(**head.about(), events=tuple(events), skin=skin, **arrays)


class LongTrack:
    """A track that grows by stretches of one hand; its arrays are on disk where they are long."""

    def __init__(self) -> None:
        self._head: Head | None = None
        self._arrays: dict[str, Growing | GrowingTexts | None] = {}
        self._events: list[Event] = []

    def append(self, stretch: Stretch) -> None:
        """The next frames."""
        arrays = stretch.arrays()
        if self._head is None:
            self._head = stretch.head
            self._arrays = {
                name: None
                if array is None
                else GrowingTexts()
                if array.dtype.kind == "U"
                else Growing(array.shape[1:], array.dtype)
                for name, array in arrays.items()
            }
        self._events += stretch.events
        for name, kept in self._arrays.items():
            if isinstance(kept, GrowingTexts):
                kept.append(arrays[name].tolist())
            elif kept is not None:
                kept.append(arrays[name])

    def track(self, skin: Skin | None = None) -> Track:
        """The track so far, of one stretch or more."""
        head = self._head
        if head is None:
            raise InputError("a track needs frames")
        arrays = {n: None if kept is None else kept.whole() for n, kept in self._arrays.items()}
        return _track(head, self._events, skin, arrays)


def tracks_of(given: object) -> list[Track]:
    """One track or several, as a list.

    Raises:
        InputError: something of it is no track.
    """
    many = isinstance(given, Iterable) and not isinstance(given, Track | str | bytes)
    tracks = list(cast("Iterable[object]", given)) if many else [given]
    for one in tracks:
        if not isinstance(one, Track):
            raise InputError(
                f"a {type(one).__name__} is no track: handtrack.track makes one of joints,"
                " handtrack.read_mcap reads those of a recording"
            )
    return cast("list[Track]", tracks)


def mean_and_max(distance: Array) -> tuple[Array, Array]:
    """(T,) mean and greatest of the known values in each row (T, n), NaN where there is none."""
    known = np.isfinite(distance)
    count = known.sum(1)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, distance, 0).sum(1) / count
    greatest = np.where(known, distance, -np.inf).max(1)
    return mean, np.where(count > 0, greatest, np.nan)


def log_lines(track: Part, before: tuple[str, str] = ("fitted", "")) -> list[Event]:
    """The lines of a log: events, and the changes of status that none of them tells, in order.

    Args:
        track: a track, or a stretch of one.
        before: status and reason of the frame before its first.
    """
    lines = list(track.events)
    told = {line.time_ns for line in lines}
    columns = (track.frame_index, track.time_ns, track.status, track.reason)
    rows = (
        row
        for part in blocks(len(track))
        for row in zip(*(column[part].tolist() for column in columns), strict=True)
    )
    for frame, time, status, reason in rows:
        now = (status, reason)
        # a reason that only its numbers tell from the last one is no news, nor is none any more
        new_reason = bool(reason) and _words(reason) != _words(before[1])
        if (status != before[0] or new_reason) and time not in told:
            level = "warning" if status == "lost" else "info"
            text = f"frame {frame}: {status}{f': {reason}' if reason else ''}"
            lines.append(Event(time, level, text))
        before = now
    return sorted(lines, key=lambda line: line.time_ns)


def _words(reason: str) -> str:
    return re.sub(r"\d+", "", reason)
