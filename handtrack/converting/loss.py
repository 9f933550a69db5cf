"""What a conversion loses: the file that was written, read back and compared."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.converting.resample import at_times
from handtrack.converting.source import Source
from handtrack.hand.skeleton import BONES

Array = NDArray[np.float64]

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
