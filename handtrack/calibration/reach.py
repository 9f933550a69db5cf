"""What other bones or axes could explain of a sequence, without finding them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import Clip, solve
from handtrack.calibration.centres import centred
from handtrack.calibration.chains import SIZE, Chains
from handtrack.calibration.explain import FRAMES, Residual
from handtrack.calibration.frames import Material, excerpt, poses_of, sound
from handtrack.calibration.freedoms import freedoms
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import without_landmarks
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

# from a hand that is near, so few steps of Gauss and Newton gain nearly all that there is to gain
_STEPS = 4
# of what people differ by, a prior this weak only keeps what nothing observes
_WEAK = 1e-2
# noise of the joints [m]
_NOISE = 1e-3
# no pose is expected, and no limit holds
_ANY = np.full(4, 1e3)


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
    given = excerpt(sequence)
    if model.has_landmarks:
        given, model = centred(model, given), without_landmarks(model)
    material = Material.of(given, smooth=False)
    fits = material.fitted(model)
    index = sound(fits, material.weights)
    if len(index) > frames:
        index = index[np.linspace(0, len(index) - 1, frames).astype(np.int64)]
    joints = material.joints[index]
    seen = np.isfinite(joints[..., 0])
    chains = Chains.of(model, _ANY, np.inf)
    moves = freedoms(chains, np.full((5, 4), method != "lengths"))
    clip = Clip(
        chains,
        np.nan_to_num(joints),
        seen.astype(np.float64),
        np.zeros((5, SIZE)),
        moves.basis,
        _NOISE,
    )
    weak = _WEAK * moves.precision
    start = [poses_of(model, fits, index)]
    found = solve([clip], weak, np.zeros(moves.n), start, max_steps=_STEPS, tolerance=0.0)
    return Residual.of(clip.distances(found.free, found.poses[0])[seen])
