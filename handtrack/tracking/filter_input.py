"""What filters are given of frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.kernels.workspace import Records

Array = NDArray[np.float64]


class Frames(NamedTuple):
    """Frames and their raw fits.

    Attributes:
        times_ns: (T,) increasing [ns].
        joints: (T, 21, 3) [m]; weights: (T, 21), 0 where a joint is missing.
        raw: (T,) RESULT of `kernels.workspace`, as `solver.Results` has them.
    """

    times_ns: NDArray[np.int64]
    joints: Array
    weights: Array
    raw: Records

    def part(self, of: slice) -> Frames:
        """Some of the frames."""
        return Frames(self.times_ns[of], self.joints[of], self.weights[of], self.raw[of])
