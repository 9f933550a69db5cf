"""How far a track's joints are from the true ones, by all that is known of their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.lasting import pose_jacobians
from handtrack.fitting.result import N_POSE
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS

if TYPE_CHECKING:
    from handtrack.tracking.track import Track

Array = NDArray[np.float64]

_BLOCK = 128
# how much the noise of frames counts for joints after a filter, against that of the angles
_ROOT = 0.4
# curvature of what no joint shows, at weights of one [m^2/rad^2]
_TRACE = 1e-7


def joint_deviation(track: Track) -> Array:
    """(T, 21) standard deviation of the filtered joints, per coordinate [m]; see `Track`.

    The pose's covariance is that of the joints seen, at the frame's noise; without a profile at one
    between that and what the angles' variances have after the filter: a filter steadies the root,
    which moves most, less than angles. It is not below what lasts.
    """
    out = np.full((len(track), N_JOINTS), np.nan)
    lasting_mm: Any = track.settings.get("lasting_mm") or ()
    lasting = np.square(1e-3 * np.asarray(lasting_mm or np.zeros(N_JOINTS), float))
    own = track.angle_variance
    known = np.flatnonzero(np.isfinite(track.angles).all(1))
    weights = np.where(np.isfinite(track.observed[..., 0]) & ~track.rejected, track.confidence, 0)
    # of a frame that shows too little, as if all were seen
    weights[(weights > 0).sum(1) < 6] = 1.0
    for begin in range(0, len(known), _BLOCK):
        at = known[begin : begin + _BLOCK]
        landmarks, centres = pose_jacobians(track.model, track.angles[at])
        weighted = landmarks * np.repeat(weights[at], 3, axis=1)[..., None]
        normal = landmarks.swapaxes(1, 2) @ weighted
        k = np.arange(normal.shape[-1])
        normal[:, k, k] += _TRACE
        unit = np.linalg.inv(normal)
        each = unit[:, k[:N_ANGLES], k[:N_ANGLES]]
        held = np.isfinite(own[at]) & (own[at] > 0)
        ratio = np.where(held, own[at], np.nan) / each
        level = np.array(
            [np.median(r[np.isfinite(r)]) if np.isfinite(r).any() else 0.0 for r in ratio]
        )
        # what a filter leaves of it, in the root and the angles together
        shown = track.objective[at] / np.maximum(3 * (weights[at] > 0).sum(1) - N_POSE, 1)
        both = shown if lasting_mm else level ** (1 - _ROOT) * shown**_ROOT
        level = np.where(shown > level, both, level)
        spread = np.einsum("nij,njk,nik->ni", centres, unit, centres)
        joints = spread.reshape(-1, N_JOINTS, 3).mean(-1)
        out[at] = np.sqrt(np.maximum(level[:, None] * joints, lasting))
    return out
