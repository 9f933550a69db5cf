"""A frame fitted without the joints that are outliers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.fitting import solver
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS
from handtrack.kernels.workspace import Records

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# more outliers in a frame than this, and it is no matter of single joints
_MOST = 5

NONE: Mask = np.zeros(N_JOINTS, dtype=np.bool_)
"""No joint of 21."""
NONE.flags.writeable = False


class Attempt(NamedTuple):
    """A way to fit a frame.

    Attributes:
        results: of the one frame.
        w: (21,) weights used.
        keep: (1,) what is kept after it (see `frame_loop.fit_frames`).
        rejected: (21,) joints that were seen and not used.
        reason: which, and why.
    """

    results: solver.Results
    model: HandModel
    w: Array
    keep: Records
    rejected: Mask = NONE
    reason: str = ""

    @property
    def objective(self) -> float:
        return float(self.results.objective[0])

    @property
    def worst(self) -> float:
        return float(self.results.worst[0])

    def distance(self, observed: Array) -> Array:
        """(21,) of the joints seen to their fitted ones [m]; 0 where missing."""
        return known_lengths(self.results.landmarks(self.model)[0] - observed)


class Weeder:
    """Fits single frames."""

    def __init__(self, program: solver.Program, model: HandModel, min_joints: int):
        """As `Results.run` has them."""
        self._program, self._model, self._min_joints = program, model, min_joints

    def fit(self, observed: Array, w: Array, keep: Records) -> Attempt:
        """The plain fit of a frame (21, 3), (21,), after what is kept."""
        results, kept = solver.Results(1, full=False), keep.copy()
        targets, weights = observed[None].copy(), w[None].copy()
        start, least = self._model.mean_angles, self._min_joints
        results.run(self._program, self._model, targets, weights, kept, start, least)
        return Attempt(results, self._model, weights[0], kept)

    def weeded(
        self, observed: Array, w: Array, keep: Records, look: float, outlier: float
    ) -> Attempt:
        """The fit without the joints that are outliers.

        Joints are taken away from the worst on, and come back where the fit without them, or
        the last one, has them near.

        Args:
            observed, w, keep: as in `fit`.
            look: distance to the fit at which a joint is looked at [m].
            outlier: distance to the fit without it at which it is an outlier [m].
        """
        used = w.copy()
        best = first = self.fit(observed, used, keep)
        cleared = w <= 0.0
        off: dict[int, float] = {}
        while True:
            distance = np.where(cleared | (used <= 0.0), 0.0, best.distance(observed))
            j = int(distance.argmax())
            if distance[j] <= look:
                break
            if len(off) == _MOST or (used > 0.0).sum() <= self._min_joints:
                # it is not a matter of single joints
                return first
            used[j] = 0.0
            without = self.fit(observed, used, keep)
            innovation = float(without.distance(observed)[j])
            if innovation > outlier:
                off[j], best = innovation, without
            else:
                used[j], cleared[j] = w[j], True
        last = best.distance(observed)
        back = [j for j in off if last[j] <= outlier]
        if back:
            used[back] = w[back]
            best = self.fit(observed, used, keep)
        rejected = np.zeros(N_JOINTS, dtype=np.bool_)
        rejected[[j for j in off if j not in back]] = True
        rejected.flags.writeable = False
        texts = [
            f"{JOINT_NAMES[j]} rejected, {1e3 * off[j]:.0f} mm off"
            for j in sorted(off)
            if rejected[j]
        ]
        return best._replace(rejected=rejected, reason=", ".join(texts))


def known_lengths(vectors: Array) -> Array:
    """(21,) lengths of (21, 3); 0 for a missing one."""
    squared = (vectors * vectors).sum(-1)
    return np.sqrt(np.where(squared >= 0.0, squared, 0.0))
