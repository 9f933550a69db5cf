"""What a conversion loses: the file that was written, read back and compared between its frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.converting.source import Source
from handtrack.hand.rotations import matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import BONES

Array = NDArray[np.float64]
Times = NDArray[np.int64]

_LONGEST_NS = 250_000_000
"""Between frames farther apart nothing is made up."""
_NEAR_NS = 1_000_000
"""A frame this near is taken as it is."""


def _between(times: Times, given: Times) -> tuple[NDArray[np.int64], Array, NDArray[np.bool_]]:
    """The frame before each time, how far it is to the next, and whether the time is between
    two frames of one stretch."""
    if len(given) == 1:
        return np.zeros(len(times), int), np.zeros(len(times)), np.abs(times - given) <= _NEAR_NS
    before = np.clip(np.searchsorted(given, times, "right") - 1, 0, len(given) - 2)
    step = given[before + 1] - given[before]
    share = (times - given[before]) / step
    near = np.abs(share - np.round(share)) * step <= _NEAR_NS
    share = np.where(near, np.round(share), share)
    inside = (share >= 0) & (share <= 1) & (near | (step <= _LONGEST_NS))
    return before, np.clip(share, 0, 1), inside


def at_times(times: Times, given: Times, values: Array) -> Array:
    """Values (T, ...) at `given` times, brought to others (n, ...); NaN where there are none."""
    before, share, inside = _between(times, given)
    after = np.minimum(before + 1, len(given) - 1)
    part = share.reshape(-1, *(1,) * (values.ndim - 1))
    mixed = values[before] + part * (values[after] - values[before])
    # a frame that is met exactly does not need its neighbour
    mixed = np.where(part == 0, values[before], np.where(part == 1, values[after], mixed))
    mixed[~inside] = np.nan
    return np.asarray(mixed)


def turned_at(times: Times, given: Times, rotations: Array) -> Array:
    """Rotations (T, ..., 3, 3) likewise, the short way round."""
    before, share, inside = _between(times, given)
    after = np.minimum(before + 1, len(given) - 1)
    first, second = rotations[before], rotations[after]
    turn = matrix_to_vector(np.nan_to_num(first.swapaxes(-1, -2) @ second))
    part = share.reshape(-1, *(1,) * (turn.ndim - 1))
    mixed = first @ vector_to_matrix(part * turn)
    edge = part[..., None]
    mixed = np.where(edge == 0, first, np.where(edge == 1, second, mixed))
    mixed[~inside] = np.nan
    return np.asarray(mixed)


_FIRST, _LAST = np.array(BONES).T


class Loss(NamedTuple):
    """How far what was read back is from what was converted.

    Attributes:
        mean_mm, max_mm: distance of joints that both have.
        mean_deg, max_deg: angle between bones that both have.
        joints: joints, over all frames, that the source has and the file has not.
        of: how many the source has.
    """

    mean_mm: float
    max_mm: float
    mean_deg: float
    max_deg: float
    joints: int
    of: int

    def __str__(self) -> str:
        text = (
            f"read back: {self.mean_mm:.3g} mm off (at most {self.max_mm:.3g}),"
            f" bones {self.mean_deg:.2g}° (at most {self.max_deg:.2g})"
        )
        if self.joints:
            text += f", without {100 * self.joints / self.of:.1f} % of the joints"
        return text


def loss(source: Source, time_ns: NDArray[np.int64], back: Array) -> Loss:
    """What a source lost.

    Args:
        source: what was converted.
        time_ns: (n,) of what was read back, on the source's clock.
        back: (n, 21, 3) its joints [m].
    """
    there = at_times(source.time_ns, time_ns, back)
    wanted = source.present
    both = wanted & np.isfinite(there).all(-1)
    off = np.linalg.norm(there - source.joints, axis=-1)[both] * 1e3
    bones = both[:, _FIRST] & both[:, _LAST]
    before, after = (x[:, _LAST] - x[:, _FIRST] for x in (source.joints, there))
    across = np.linalg.norm(np.cross(before, after), axis=-1)
    # atan2 tells small angles too
    angle = np.rad2deg(np.arctan2(across, (before * after).sum(-1)))[bones]
    return Loss(
        *_mean_and_max(off),
        *_mean_and_max(angle),
        int((wanted & ~both).sum()),
        int(wanted.sum()),
    )


def _mean_and_max(values: Array) -> tuple[float, float]:
    if not values.size:
        return float("nan"), float("nan")
    return float(values.mean()), float(values.max())
