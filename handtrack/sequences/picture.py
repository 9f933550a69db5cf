"""What one camera's pictures show of the joints of a sequence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera

Array = NDArray[np.float64]

SHARES = 4.0
"""Landmarks nearer to 0 than this are shares of the picture's sides, not pixels."""


@dataclass(frozen=True, eq=False)
class Picture:
    """The joints of a sequence's T frames, as the camera that saw them shows them.

    The sequence's own joints stand in the camera's axes (x to the right, y down, z ahead), around
    any point: the detector's, of one picture.

    Attributes:
        image: (T, 21, 2) [px], NaN where a joint is not seen.
        sure: (T, 21) 0..1, 0 where it is not seen.
        size: (width, height) of the pictures [px].
        camera: that took them; None: nobody says, and it is assumed.
        lens: what is known of its focal length: "assumed", "60 degrees", "" where it is calibrated.
    """

    image: Array
    sure: Array
    size: tuple[int, int]
    camera: Camera | None = None
    lens: str = "assumed"

    def __len__(self) -> int:
        return len(self.image)

    def at(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Picture:
        """Those of some frames."""
        return replace(self, image=self.image[rows], sure=self.sure[rows])


def is_share(points: Array) -> bool:
    """Whether places (..., 2) in pictures are shares of the pictures' sides, not pixels."""
    reach = np.abs(points)
    there = np.isfinite(reach)
    return bool(there.any() and reach.max(where=there, initial=0.0) < SHARES)
