"""Project Aria's hands from the device's frame into the world, by closed_loop_trajectory.csv.

    tracking_timestamp_us, tx_world_device, ty_..., tz_..., qx_world_device, qy_..., qz_..., qw_...

Poses stand a millisecond apart; between them places go straight and turns along the shortest way.
Hands before the first pose, after the last one or in a gap are missing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.companions import Companions
from handtrack.sequences.readers.raw import Array, Raw
from handtrack.sequences.readers.table_cells import read_cells

NAME = "closed_loop_trajectory.csv"
_TIME = "tracking_timestamp_us"
_PLACE = tuple(f"t{a}_world_device" for a in "xyz")
_TURN = tuple(f"q{a}_world_device" for a in "wxyz")
FARTHEST = 1e6
"""[m] No device is farther from where it began."""
_GAP_US = 100_000
"""Poses farther apart tell nothing of the time between them."""


@dataclass(frozen=True)
class InDevice:
    """Joints in the frame of a headset that moves."""

    takes: str = "trajectory"

    def resolved(self, raw: Raw, companions: Companions) -> list[Raw]:
        """The hand in the world, or as it is where no trajectory is given.

        Raises:
            InputError: no trajectory, or one of another session.
        """
        if companions.trajectory is None:
            near = (p for p in _near(raw.path) if p.is_file())
            found = next(near, None)
            note = f"joints are in the moving device's frame: --trajectory {found} for the world"
            notes = raw.notes if found is None else (*raw.notes, note)
            return [replace(raw, pending=None, notes=notes)]
        path = companions.trajectory
        times = None if raw.stamps is None else np.asarray(raw.stamps.values)
        if times is None or times.dtype.kind not in "iuf":
            raise InputError(f"has no {_TIME}, by which {path} goes", raw.path)
        at, turn, place = read_trajectory(path)
        rotation, move, known = between(times.astype(np.float64), at, turn, place)
        if not known.any():
            raise InputError(
                f"the trajectory is of another session: it goes from {at[0]:.0f} to {at[-1]:.0f}"
                f" us, the hands of {raw.path.name} from {times[0]:.0f} to {times[-1]:.0f}",
                path,
            )
        joints = np.einsum("tab,tjb->tja", rotation, raw.joints) + move[:, None]
        # a joint at the device's origin is one that was not seen
        joints[(raw.joints == 0).all(-1)] = np.nan
        joints[~known] = np.nan
        notes = (*raw.notes, f"brought into the world by {path.name}")
        if not known.all():
            notes = (*notes, f"{(~known).sum()} frames outside of the trajectory are missing")
        return [replace(raw, joints=joints, pending=None, notes=notes)]


def _near(path: Path) -> list[Path]:
    """Where the trajectory of a hand file usually stands."""
    folder = path.parent
    return [folder / NAME, folder.parent / "slam" / NAME, folder / "slam" / NAME]


def read_trajectory(path: Path) -> tuple[Array, Array, Array]:
    """Times (T,) [us], quaternions (T, 4) wxyz and places (T, 3) [m] of the device in the world.

    Raises:
        InputError: it is not there, or no trajectory.
    """
    table = read_cells(budget.read(path), path)
    titles = [t.strip() for t in table.titles or []]
    wanted = (_TIME, *_TURN, *_PLACE)
    missing = [t for t in wanted if t not in titles]
    if missing:
        raise InputError(f"is no {NAME}: it has no column {', '.join(missing[:3])}", path)
    if not table.lines:
        raise InputError("a header, but no poses", path)
    table.check_width()
    values = table.numbers([titles.index(t) for t in wanted], wanted)
    values = values[np.isfinite(values).all(1)]
    values = values[np.argsort(values[:, 0], kind="stable")]
    if not len(values) or np.abs(values[:, 5:8]).max() > FARTHEST:
        raise InputError("no pose in it, or one far from everything", path)
    length = (np.clip(values[:, 1:5], -2, 2) ** 2).sum(1)
    if not ((length > 0.5) & (length < 2)).all():
        raise InputError("a pose of the device is no rotation: its quaternion is not of 1", path)
    first = np.concatenate([[True], np.diff(values[:, 0]) > 0])
    values = values[first]
    return values[:, 0], values[:, 1:5], values[:, 5:8]


def between(
    times: Array, at: Array, turn: Array, place: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Poses at times between known ones.

    Args:
        times: (N,) asked for.
        at: (T,) of the known poses, increasing; turn: (T, 4) wxyz; place: (T, 3).

    Returns:
        (N, 3, 3) rotations, (N, 3) places, (N,) whether a pose is near enough.
    """
    after = np.clip(np.searchsorted(at, times), 1, max(len(at) - 1, 1))
    after = np.minimum(after, len(at) - 1)
    before = np.maximum(after - 1, 0)
    step = at[after] - at[before]
    share = np.where(step > 0, (times - at[before]) / np.where(step > 0, step, 1.0), 0.0)
    inside = (times >= at[0]) & (times <= at[-1]) & (step <= _GAP_US)
    share = np.clip(share, 0.0, 1.0)[:, None]
    a = turn[before] / np.linalg.norm(turn[before], axis=1, keepdims=True)
    b = turn[after] / np.linalg.norm(turn[after], axis=1, keepdims=True)
    dot = (a * b).sum(1, keepdims=True)
    b, dot = np.where(dot < 0, -b, b), np.abs(dot)
    angle = np.arccos(np.clip(dot, 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    left = np.where(near, 1 - share, np.sin((1 - share) * angle) / safe)
    right = np.where(near, share, np.sin(share * angle) / safe)
    move = place[before] * (1 - share) + place[after] * share
    return quaternion_to_matrix(left * a + right * b), move, inside


FORMATS = (
    Format(
        "Project Aria MPS",
        "`hand_tracking_results.csv`, versions 1 and 2; in the device's frame",
        "umetrack",
        "m",
        "both",
        "its columns",
        "`--trajectory closed_loop_trajectory.csv` for the world",
    ),
)
