"""What robots' messages say of hands, whatever encoding they come in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.rotations import quaternion_to_matrix

Array = NDArray[np.float64]


class Marker(NamedTuple):
    """A visualization_msgs/Marker.

    Attributes:
        stamp: [ns].
        frame: that its pose is in.
        space: its namespace.
        number: its id there.
        kind: its type (2: a sphere, 7: a list of spheres, 8: points ...).
        action: 0: shown, 2 and 3: taken away.
        pose: (7,) x y z, quaternion x y z w.
        points: (n, 3) in the pose's frame.
        text: what stands on it.
    """

    stamp: int
    frame: str
    space: str
    number: int
    kind: int
    action: int
    pose: Array
    points: Array
    text: str


class Poses(NamedTuple):
    """A list of places.

    Attributes:
        stamp: [ns]; None: the message has none.
        frame: that they are in.
        places: (n, 3) [m], NaN = missing.
        markers: the same as markers, with names.
    """

    stamp: int | None
    frame: str
    places: Array
    markers: tuple[Marker, ...] = ()


class Transform(NamedTuple):
    """Where a frame is in another.

    Attributes:
        stamp: [ns].
        parent, child: names of the frames.
        pose: (7,) x y z, quaternion x y z w.
    """

    stamp: int
    parent: str
    child: str
    pose: Array


class Transforms(NamedTuple):
    """Frames, as TF has them."""

    transforms: tuple[Transform, ...]


Message = Poses | Transforms


def turn_of(pose: Array) -> Array:
    """(3, 3) the rotation of a pose: x y z, then quaternion x y z w of any length; NaN where
    that is none."""
    largest = float(np.abs(pose[3:]).max())
    if not 0 < largest < np.inf:
        return np.full((3, 3), np.nan)
    return quaternion_to_matrix(np.roll(pose[3:] / largest, 1))
