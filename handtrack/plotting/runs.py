"""What is plotted: tracks by the names they are called, on one clock, as series of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.evaluation.metrics import pa_mpjpe
from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS
from handtrack.recording.parts import between
from handtrack.tracking.track import Track, mean_and_max, tracks_of

Array = NDArray[np.float64]

_GAP = 5.0
"""Lines are broken where so many frames are missing."""


@dataclass(frozen=True, eq=False)
class Run:
    """A track to be plotted.

    Attributes:
        name: what it is called.
        track: it, or the part of it that is wanted.
        seconds: (T,) its frames' times [s].
    """

    name: str
    track: Track
    seconds: Array

    @property
    def with_breaks(self) -> NDArray[np.int64]:
        """Its frames in order, with -1 where frames are missing between two."""
        index = np.arange(len(self.seconds))
        step = np.diff(self.seconds)
        if not len(step):
            return index
        return np.insert(index, np.flatnonzero(step > _GAP * np.median(step)) + 1, -1)

    def broken(self, values: Array) -> tuple[Array, Array]:
        """Times and values (T, ...) to draw lines through: NaN where frames are missing."""
        index = self.with_breaks
        gone = index < 0
        seconds, values = self.seconds[index], np.asarray(values)[index].astype(np.float64)
        seconds[gone], values[gone] = np.nan, np.nan
        return seconds, values

    @property
    def errors_mm(self) -> dict[str, Array]:
        """(T,) errors by what they are of: with a truth PA-MPJPE of input and output, else the
        mean distance of fit and output to the input."""
        track = self.track
        if track.truth is not None and np.isfinite(track.truth).any():
            output = np.where(track.measured_joints[:, None], track.filtered_joints, np.nan)
            return {
                "input": 1e3 * pa_mpjpe(track.observed, track.truth),
                "output": 1e3 * pa_mpjpe(output, track.truth),
            }
        found = {"fit": mean_and_max(1e3 * track.error)[0]}
        if track.filtered:
            apart = np.linalg.norm(track.landmarks - track.observed, axis=-1)
            found["output"] = mean_and_max(1e3 * apart)[0]
        return found

    @property
    def error_label(self) -> str:
        """What `errors_mm` are, with their unit."""
        has_truth = self.track.truth is not None and np.isfinite(self.track.truth).any()
        return "PA-MPJPE (mm)" if has_truth else "from input (mm)"


def runs_of(
    tracks: Track | Iterable[Track] | Mapping[str, Track],
    start_s: float | None = None,
    end_s: float | None = None,
) -> list[Run]:
    """Tracks by name, on one clock where they overlap, else each from its own first frame.

    Args:
        tracks: one, several, or by the names they are to be called.
        start_s, end_s: first and last time wanted [s].

    Raises:
        SettingsError: there is no track, the part is empty, or no frame lies in it.
    """
    named = _named(tracks)
    if not named:
        raise SettingsError("there is no track to plot")
    if start_s is not None and end_s is not None and not start_s < end_s:
        raise SettingsError(f"the part from {start_s:g} s to {end_s:g} s is empty")
    spans = [(int(t.time_ns[0]), int(t.time_ns[-1])) for _, t in named if len(t)]
    if not spans:
        raise SettingsError("there are no frames in the tracks to plot")
    together = max(first for first, _ in spans) <= min(last for _, last in spans)
    origin, found = min(first for first, _ in spans), []
    for name, track in named:
        if not len(track):
            continue
        zero = origin if together else int(track.time_ns[0])
        first = -np.inf if start_s is None else zero + start_s * 1e9
        last = np.inf if end_s is None else zero + end_s * 1e9
        part = between(track, first, last)
        if len(part):
            seconds: Array = (part.time_ns - zero) * np.float64(1e-9)
            found.append(Run(name, part, seconds))
    if not found:
        raise SettingsError(
            "there are no frames in that part: the longest recording is"
            f" {max(last - first for first, last in spans) * 1e-9:.3f} s long"
        )
    return found


def _named(tracks: Track | Iterable[Track] | Mapping[str, Track]) -> list[tuple[str, Track]]:
    """Tracks with names that tell them apart, by what differs."""
    if isinstance(tracks, Mapping):
        named = tracks_of(tracks.values())
        return [(str(name), track) for name, track in zip(tracks, named, strict=True)]
    given = tracks_of(tracks)
    parts = [(t.name, f"{t.hand} hand", str(t.settings.get("filter", ""))) for t in given]
    different = [len({part[i] for part in parts}) > 1 for i in range(3)]
    names = [
        " ".join(word for word, tells in zip(part, different, strict=True) if tells and word)
        or part[0]
        for part in parts
    ]
    return [
        (name if names.count(name) == 1 else f"{name} ({names[: i + 1].count(name)})", track)
        for i, (name, track) in enumerate(zip(names, given, strict=True))
    ]


def chosen_angles(fingers: Iterable[str] = (), joints: Iterable[str] = ()) -> list[int]:
    """The angles of some fingers and joints in our order; all where none are named.

    Args:
        fingers: of `FINGERS`.
        joints: names of joints ("index_pip"), kinds ("pip") or angles ("index_pip_flexion");
            with fingers, only theirs.

    Raises:
        SettingsError: a name is none of them, or the two leave no angle.
    """
    wanted, named = list(fingers), list(joints)
    for finger in wanted:
        if finger not in FINGERS:
            raise SettingsError(f"finger {finger!r} is unknown, expected {', '.join(FINGERS)}")
    of_fingers = {i for i, n in enumerate(ANGLE_NAMES) if not wanted or n.split("_")[0] in wanted}
    of_joints: set[int] = set()
    for joint in named:
        found = {i for i, name in enumerate(ANGLE_NAMES) if f"_{joint}_" in f"_{name}_"}
        if not found:
            raise SettingsError(
                f"joint {joint!r} has no angle, expected a joint as in index_pip, pip or"
                f" index_pip_flexion; angles are {', '.join(ANGLE_NAMES)}"
            )
        of_joints |= found
    chosen = sorted(of_fingers & of_joints if named else of_fingers)
    if not chosen:
        raise SettingsError(f"{', '.join(wanted)} has no {', '.join(named)}")
    return chosen
