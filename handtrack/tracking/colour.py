"""Whether the joints' noise lasts, by what the fits of a whole sequence leave of the joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.kernels import colour
from handtrack.tracking.filter_input import Frames

Array = NDArray[np.float64]

LASTS_S = 0.1
"""For how long noise lasts where nobody says it: to 1/e [s].

What a sequence shows of this is vague: longer ones are as likely, and bring no pose nearer.
"""


def lasting_share(frames: Frames, lasts_s: float) -> tuple[float, float]:
    """What share of the joints' noise lasts for `lasts_s` [s], 0 where it is white or not known;
    and what part of the residuals is not their mean.

    As `kernels.colour` follows it in a stream.
    """
    times_ns, joints, weights, raw = frames
    seen = (weights > 0) & np.isfinite(raw["noise"])[:, None]
    turn = raw["root"][:, :9].reshape(-1, 3, 3)
    there = np.where(seen[..., None], joints, 0.0)
    left = np.where(seen[..., None], there - raw["joints"], 0.0)
    left = np.where(seen[..., None], left @ turn, 0.0)
    whole = float(np.square(left).sum())
    left -= left.sum(0) / np.maximum(seen.sum(0), 1)[:, None]
    pairs = (seen[1:] & seen[:-1])[..., None]
    before, after = np.where(pairs, left[:-1], 0.0), np.where(pairs, left[1:], 0.0)
    squares = 0.5 * float(np.square(before).sum() + np.square(after).sum())
    noise = np.nanmedian(raw["noise"]) if seen.any() else 0.0
    if pairs.sum() <= colour.LEAST_PAIRS or squares == 0.0 or not noise > colour.FINE:
        return 0.0, 1.0
    correlation = float((before * after).sum()) / squares
    dt = 1e-9 * float(np.median(np.diff(times_ns)))
    share = float(colour.share_of.py_func(correlation, dt, lasts_s))
    return share, float(np.square(left).sum()) / whole
