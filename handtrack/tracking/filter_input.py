"""What filters are given of frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import ROWS, Growing
from handtrack.hand.skeleton import N_JOINTS
from handtrack.kernels.workspace import RESULT, Records

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


class LongFrames:
    """All frames of a sequence, looked at in parts: on disk where they are many."""

    def __init__(self) -> None:
        self._times = Growing((), np.int64)
        self._columns = Growing((N_JOINTS, 3)), Growing((N_JOINTS,)), Growing((), RESULT)

    @staticmethod
    def of(frames: Frames) -> LongFrames:
        """Those frames."""
        made = LongFrames()
        made.append(frames)
        return made

    def __len__(self) -> int:
        return len(self._times)

    def append(self, frames: Frames) -> None:
        """The next frames."""
        self._times.append(frames.times_ns)
        for column, array in zip(self._columns, frames[1:], strict=True):
            column.append(array)

    @property
    def times_ns(self) -> NDArray[np.int64]:
        """(T,) of all frames [ns]."""
        return self._times.whole()

    def part(self, of: slice) -> Frames:
        """Some of the frames, as copies."""
        joints, weights, raw = (column.read(of) for column in self._columns)
        return Frames(self._times.read(of), joints, weights, raw)

    def column(self, name: str) -> Array:
        """(T,) one number of `raw`, of all frames."""
        rows = self._columns[2]
        parts = [rows.read(slice(t, t + ROWS))[name].copy() for t in range(0, len(self), ROWS)]
        return np.concatenate([*parts, np.empty(0)])
