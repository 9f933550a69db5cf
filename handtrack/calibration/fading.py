"""How long an unknown detector's errors last, as far as residuals show it.

Errors that fade within a tenth of a second or so are new many times in a clip, so that it tells of
the subject's bones in spite of them. Errors that stay, or come back with poses, are taken for
bones, and only the prior hand stands against them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FADES_S = 0.1
"""How long errors last that are not there any more after `_LATER_S` [s]."""
_LATER_S = 0.2
# correlation after that time of errors that fade, and of those that are taken to stay: what fades
# has .0 to .15, a real detector's landmarks have .3 to .8
_FADED, _STAYS = 0.15, 0.3
# a clip of less than this has no correlations to speak of; neither have fewer pairs of frames
_LEAST_S, _LEAST_PAIRS = 2.0, 40
# what shows of landmarks that lie aside is this part of it (variances): bones and poses give way
_SHOWN = 1.0 / 60.0


@dataclass(frozen=True)
class Lasts:
    """What a clip's residuals show.

    Attributes:
        share: of the errors that are not white, those that do not fade, in 0..1.
        aside: variance of what landmarks are seen to lie aside in their bones' frames [m^2].
    """

    share: float
    aside: float

    def constant_of(self, variance: float) -> float:
        """The part of errors of that variance that stays."""
        return max(self.share * variance, min(self.aside / _SHOWN, variance))


ALL_LASTS = Lasts(1.0, 0.0)
"""Where nothing is known."""


def lasts(off: Array, time_ns: NDArray[np.int64]) -> Lasts:
    """What residuals of a clip show.

    Args:
        off: (T, 21, 3) in the bones' frames [m], NaN where missing.
        time_ns: (T,) increasing.
    """
    span_s = 1e-9 * float(time_ns[-1] - time_ns[0]) if len(time_ns) > 1 else 0.0
    if span_s < _LEAST_S:
        return ALL_LASTS
    later = max(round(_LATER_S / (1e-9 * float(np.median(np.diff(time_ns))))), 1)
    apart = 1e-9 * (time_ns[later:] - time_ns[:-later])
    pairs = np.flatnonzero(np.abs(apart - _LATER_S) < 0.25 * _LATER_S)
    if len(pairs) < _LEAST_PAIRS:
        return ALL_LASTS
    known = np.isfinite(off)
    count = np.maximum(known.sum(0), 1)
    mean = np.where(known, off, 0.0).sum(0) / count
    away = np.where(known, off - mean, 0.0)
    variance = float(np.square(away).sum()) / max(int(known.sum()), 1)
    both = known[pairs] & known[pairs + later]
    product = float((away[pairs] * away[pairs + later]).sum()) / max(int(both.sum()), 1)
    if not variance > 0:
        return ALL_LASTS
    share = np.clip((product / variance - _FADED) / (_STAYS - _FADED), 0.0, 1.0)
    # a mean of errors that fade is not naught either
    by_chance = variance * 2.0 * FADES_S / span_s
    return Lasts(float(share), max(float(np.square(mean).mean()) - by_chance, 0.0))
