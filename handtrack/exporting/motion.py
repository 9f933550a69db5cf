"""A track as the animation of a skeleton: what BVH and glTF hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.exporting.settings import UPS
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_PARTS, PARENTS
from handtrack.tracking.track import Track

Array = NDArray[np.float64]


# rows: where the new x, y and z lie in the input's frame
_TURNS: dict[str, list[list[int]]] = {
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
}


def up_to_y(up: str) -> Array:
    """(3, 3) that turns vectors of the input's frame into one with y up.

    Raises:
        SettingsError: `up` is no axis.
    """
    if up not in _TURNS:
        raise SettingsError(f"up is {up!r}, expected one of {', '.join(UPS)}")
    return np.array(_TURNS[up], np.float64)


class Motion(NamedTuple):
    """The 16 moving parts of a hand over time.

    Part p turns about joint `PART_JOINT[p]`; its parent is `PARENTS` of that joint's part.

    Attributes:
        time_s: (T,) from the first frame of the recording [s].
        wrist: (T, 3) where the wrist is in the world [m].
        rotations: (T, 16, 3, 3) of each part within its parent, the palm's in the world.
        held: (T,) frames without a pose of their own: they repeat the last one, or at the
            start the first one.
    """

    time_s: Array
    wrist: Array
    rotations: Array
    held: NDArray[np.bool_]


def motion(track: Track, origin_ns: int, *, raw: bool = False, up: str = "y") -> Motion:
    """How the hand of a track moves.

    Args:
        track: at least one of its frames must have a pose.
        origin_ns: what becomes time zero [ns].
        raw: take the poses as fitted, not as filtered.
        up: the axis of the input that points up, one of `UPS`; it becomes y.

    Raises:
        InputError: no frame has a pose.
        SettingsError: `up` is no axis.
    """
    turn = up_to_y(up)
    angles = track.angles_raw if raw else track.angles
    quaternion = track.quaternion_raw if raw else track.quaternion
    translation = track.translation_raw if raw else track.translation
    known = np.isfinite(np.concatenate([angles, quaternion, translation], 1)).all(1)
    if not known.any():
        raise InputError(f"{track.name}: no frame has a pose: there is nothing to animate")
    row = np.maximum.accumulate(np.where(known, np.arange(len(track)), -1))
    row[row < 0] = np.flatnonzero(known)[0]
    root = turn @ quaternion_to_matrix(quaternion[row])
    wrist = root @ track.model.rest_joints[0] + translation[row] @ turn.T
    rotations = local_rotations(track.model, angles[row])
    rotations[:, 0] = root @ rotations[:, 0]
    time_s = (track.time_ns - origin_ns).astype(np.float64) * 1e-9
    return Motion(time_s, wrist, rotations, ~known)


def local_rotations(model: HandModel, angles: Array) -> Array:
    """(T, 16, 3, 3) rotation of each part within its parent, of angles (T, 20) [rad]."""
    whole = model.rotations(angles)
    out = whole.copy()
    for part in range(1, N_PARTS):
        if part % 3 != 1:  # the others are in the palm, which is the root frame
            out[:, part] = whole[:, part - 1].swapaxes(-1, -2) @ whole[:, part]
    return out


def offsets(model: HandModel) -> Array:
    """(21, 3) where each joint rests in its parent's frame [m]; zero for the wrist."""
    rest = model.rest_joints
    out = rest - rest[np.maximum(PARENTS, 0)]
    out[0] = 0
    return np.asarray(out)
