"""What other bones or axes could explain of a sequence, without finding them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import solve
from handtrack.calibration.explain import FRAMES, Look, Residual
from handtrack.calibration.freedoms import freedoms
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

# from a hand that is near, so few steps of Gauss and Newton gain nearly all that there is to gain
_STEPS = 4
# of what people differ by, a prior this weak only keeps what nothing observes
_WEAK = 1e-2


def reach(model: HandModel, sequence: Sequence, method: str, frames: int = FRAMES) -> Residual:
    """About the least that a hand of other bones ("lengths"), or axes too ("full"), would leave.

    Least squares of the frames that `explain` looks at, without limits and hardly a prior, a few
    steps from the given hand: a calibration gains about as much, at five times the cost.

    Args:
        model: the hand to start from.
        sequence: of this hand, with a frame that `explain` can use.
        method: of `calibrate`: "lengths" or "full".
        frames: how many to look at.
    """
    look = Look.at(model, sequence, frames)
    moves = freedoms(look.chains, np.full((5, 4), method != "lengths"))
    clip = look.clip(moves.basis)
    weak = _WEAK * moves.precision
    start = [look.start]
    found = solve([clip], weak, np.zeros(moves.n), start, max_steps=_STEPS, tolerance=0.0)
    return Residual.of(clip.distances(found.free, found.poses[0])[look.seen])
