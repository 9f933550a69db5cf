"""What the frames of a clip are worth: errors that last do not average out."""

from __future__ import annotations

import numpy as np

from handtrack.detectors.profile import Noise

# errors of an unknown detector that are not new in every frame are taken to be constant, and twice
# what is seen of them (variances): poses and bones give way to the rest
_UNSEEN = 2.0
# no hand is more rigid than this: what is left of one that is nearly found is no error [m]
_RIGID = 1e-3

MOST_STRETCHES = 4
"""Errors that fade depend on the pose too, and poses come back, with their errors: no clip is worth
more stretches than these."""


def worth_of(
    frames: int, span_s: float, deviation: float, left: float, noise: Noise | None
) -> float:
    """Information of a clip on its subject's constants, over what as many unrelated frames have.

    A mean over frames of errors with a constant part c, a fading part f and a white part w has
    the variance c^2 + f^2 / n_f + w^2 / n, with n_f = span / (2 tau) independent stretches.

    Args:
        frames: n, how many are looked at; span_s: from the first to the last [s].
        deviation: of the joints from what the hand explains, per coordinate [m].
        left: white noise among that [m].
        noise: the detector's; where it is not known, what is not white is taken to last.

    Returns:
        In 0..1; 1 where all errors are white.
    """
    n = max(frames, 1)
    if noise is None:
        constant = _UNSEEN * max(deviation**2 - left**2 - _RIGID**2, 0.0)
        fading = fades = 0.0
        white = min(left, deviation) ** 2
        total = max(deviation**2, white)
    else:
        constant, fading, white = (
            float(np.square(part).mean()) for part in (noise.constant, noise.fading, noise.white)
        )
        fades = noise.fades_s
        total = constant + fading + white
    stretches = min(max(span_s / (2.0 * fades), 1.0), n, MOST_STRETCHES) if fades > 0 else n
    together = constant + fading / stretches + white / n
    if not together > 0:
        return 1.0
    return float(min(total / n / together, 1.0))
