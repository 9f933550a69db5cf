"""How far joints are from others, frame by frame, of clips of any length."""

from __future__ import annotations

import numpy as np

from handtrack.evaluation.alignment import align
from handtrack.evaluation.arrays import Array, lengths
from handtrack.files.long_arrays import Growing, blocks, by_blocks
from handtrack.tracking.track import Track

_ALIGNED = 4000
"""Frames aligned at once."""


def used(track: Track) -> Array:
    """The joints observed; what the fit was told to ignore counts for nothing."""
    seen, weights = track.observed, track.confidence
    if any(
        (~np.isnan(seen[part, :, 0]) & ~(weights[part] > 0)).any() for part in blocks(len(seen))
    ):
        return by_blocks(lambda x, w: np.where(w[..., None] > 0, x, np.nan), seen, weights)
    return seen


def joint_errors_mm(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """(T, 21) distances [mm] after similarity alignment of each frame, without, and with the
    wrists on each other."""
    out = Growing((3, a.shape[1]))
    known = any(not np.isnan(b[part]).all() for part in blocks(len(b)))
    for part in blocks(len(a), _ALIGNED):
        errors = np.full((3, *a[part].shape[:2]), np.nan)
        if known:
            x, y = a[part] * 1e3, b[part] * 1e3
            apart = x - y
            errors[:] = lengths(align(x, y) - y), lengths(apart), lengths(apart - apart[:, :1])
        out.append(errors.swapaxes(0, 1))
    whole = out.whole()
    return whole[:, 0], whole[:, 1], whole[:, 2]
