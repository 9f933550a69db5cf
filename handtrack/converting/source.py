"""What is converted: a hand as it was read, and its fit where a format needs one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.converting.complete import Whole, completed
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import Hand
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.sequence_track import track_joints
from handtrack.tracking.settings import TrackSettings
from handtrack.tracking.track import Track

Array = NDArray[np.float64]
Subject = Callable[[Sequence], tuple[HandModel | None, Any]]
"""The model for a sequence, and how to calibrate it, as `track` takes them."""


def anyone(sequence: Sequence) -> tuple[HandModel | None, Any]:
    """The hand that ships with the project, calibrated."""
    return None, "auto"


@dataclass(eq=False)
class Source:
    """One hand that is to be converted.

    Attributes:
        name: of its file or topic: "right", "person0_left".
        hand: which.
        time_ns: (T,).
        frame_index: (T,).
        joints: (T, 21, 3) [m], NaN = missing: as read, or as tracked.
        confidence: (T, 21).
        subject: who.
        title: of the sequence, for messages.
    """

    name: str
    hand: Hand
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    joints: Array
    confidence: Array
    subject: str
    title: str
    _sequence: Sequence | None = None
    _track: Track | None = None
    _models: Subject = field(default=anyone)

    @staticmethod
    def of(found: Sequence | Track, name: str, models: Subject = anyone) -> Source:
        """A sequence as it was read, or the filtered joints of a track."""
        if isinstance(found, Track):
            joints = np.where(found.measured_joints[:, None], found.filtered_joints, np.nan)
        else:
            joints = found.joints
        return Source(
            name,
            found.hand,
            found.time_ns,
            found.frame_index,
            joints,
            np.where(np.isfinite(joints).all(-1), 1.0, 0.0)
            if isinstance(found, Track)
            else found.confidence,
            found.subject,
            found.name,
            None if isinstance(found, Track) else found,
            found if isinstance(found, Track) else None,
            models,
        )

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def tracked(self) -> bool:
        """Whether it is a track's, with the joints of its filtered poses."""
        return self._sequence is None

    @property
    def present(self) -> NDArray[np.bool_]:
        """(T, 21) which joints the source has."""
        return np.asarray(np.isfinite(self.joints).all(-1))

    @property
    def track(self) -> Track:
        """Its track; a sequence is fitted without a filter, once.

        Raises:
            HandtrackError: it cannot be.
        """
        if self._track is None:
            if self._sequence is None:
                raise TypeError("a source is of a sequence or of a track")
            model, how = self._models(self._sequence)
            settings = TrackSettings.of({"calibrate": how, "filter": "none"})
            self._track = track_joints(self._sequence, model, settings)
        return self._track

    @cached_property
    def whole(self) -> Whole:
        """The hand with everything, fitted where it lacks something."""
        return completed(self.track, None if self._sequence is None else self.joints)


def time_s(source: Source) -> Array:
    """(T,) seconds from its first frame."""
    return np.asarray((source.time_ns - source.time_ns[0]) * 1e-9)
