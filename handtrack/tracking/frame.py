"""TrackedFrame: what the tracker says of one frame; and the stretch that frames make."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.deprecated import renamed
from handtrack.mcap.hand import Event, Head
from handtrack.mcap.state import Stretch

Array = NDArray[np.float64]


@renamed(sweeps="iterations")
@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """What the tracker says of one frame; fields as in Track, for a single frame.

    Its arrays can only be read.
    """

    time_ns: int
    observed: Array
    confidence: Array
    angles_raw: Array
    angles: Array
    quaternion_raw: Array
    quaternion: Array
    translation_raw: Array
    translation: Array
    fitted_joints: Array
    filtered_joints: Array
    angle_variance: Array
    objective: float
    iterations: int
    status: str
    reason: str
    rejected: NDArray[np.bool_]
    restart: bool

    @classmethod
    def of(cls, **fields: Any) -> TrackedFrame:
        """With all of its fields at once: one by one, a frozen object costs a step 2 us."""
        frame = object.__new__(cls)
        frame.__dict__.update(fields)
        return frame


def stretch_of_frames(
    frames: list[TrackedFrame],
    head: Head,
    frame_index: ArrayLike,
    truth: Array | None = None,
    events: Iterable[Event] = (),
) -> Stretch:
    """The stretch that frames make, one or more, in order of time.

    Args:
        frames: as `Tracker.step` returns them.
        head: what does not change of the hand.
        frame_index, truth, events: as in `Track`.
    """
    arrays: dict[str, Any] = {
        f.name: np.array([getattr(frame, f.name) for frame in frames]) for f in fields(TrackedFrame)
    }
    return Stretch(
        frame_index=np.array(frame_index, np.int64),
        truth=truth,
        head=head,
        events=tuple(events),
        **arrays,
    )
