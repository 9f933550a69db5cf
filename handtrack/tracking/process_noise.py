"""How wildly a hand is expected to move, and what a sequence says of it.

A pose number moves by dx = v dt, dv = -v DECAY dt + dw, with dw white noise of density q per
time: the velocity is an Ornstein-Uhlenbeck process. On real hands, from 30 to 115 frames per
second, this decay is far likelier than a velocity that stays, and a filter that predicts without
measurements comes to rest instead of running away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import N_ANGLES

Array = NDArray[np.float64]

N_POSE = N_ANGLES + 6

DECAY = 10.0
"""Rate at which a velocity is forgotten [1/s]."""
DENSITY = np.array([10.0, 3.0, 6.0, 6.0] * 5 + [20.0] * 3 + [0.15] * 3)
"""(26,) what is usual: q of the angles and of the turn [rad^2/s^3], of the shift [m^2/s^3]."""
FIRST_SPEED = np.array([5.0] * N_ANGLES + [3.0] * 3 + [0.5] * 3)
"""(26,) standard deviation of the first velocities [rad/s], [m/s]."""

MEMORY_S = 2.0
"""For how long a stream remembers how the hand moved [s]."""
# the factors on the usual densities that a stream tries, and how far from usual motion is [log]
_TRIED = 5.0 ** np.arange(-3, 4)
_WIDTH = np.log(5.0)

"""The factors on the expected accelerations that make any sense."""

# EM: rounds at most, what a round must gain [nats], the largest factor of one round
_ROUNDS = 12
_GAIN = 1.0
_FACTOR = 5.0
_RANGE = 1e4


def process(density: Array = DENSITY) -> Array:
    """(3, 26) as `filter_frames` takes it: densities, decays, variances of first velocities."""
    return np.array([density, np.full(N_POSE, DECAY), FIRST_SPEED**2])


def tried() -> Array:
    """(3, K) the factors that a stream tries, their logarithmic prior, their logarithms."""
    log = np.log(_TRIED)
    return np.array([_TRIED, -0.5 * (log / _WIDTH) ** 2, log])


def scaled(process_noise: float) -> Array:
    """(26,) densities for a factor on the usual accelerations."""
    return np.asarray(DENSITY * process_noise**2)


class Climber:
    """Maximum likelihood of the densities, by rounds of expectation and maximisation.

    Each round wants, for the densities in `density`, the likelihood of the sequence and the
    evidence of `motion_evidence`. At the maximum both sums of the evidence are equal; their
    ratio is the step (a faster fixed point than EM's), shortened when the likelihood falls.
    """

    def __init__(self) -> None:
        self.density = DENSITY.copy()
        self.best = DENSITY.copy()
        self.rounds = 0
        self._likelihood = -np.inf
        self._ratio = np.ones(N_POSE)
        self._power = 1.0

    def step(self, likelihood: float, evidence: Array) -> bool:
        """Take in a round with `density`; whether another one is wanted.

        Args:
            likelihood: of the sequence [nats].
            evidence: (2, 26).
        """
        self.rounds += 1
        if likelihood > self._likelihood:
            gain = likelihood - self._likelihood
            self._likelihood, self.best = likelihood, self.density
            known = (evidence > 0).all(0)
            ratio = np.where(known, evidence[0] / np.where(known, evidence[1], 1.0), 1.0)
            self._ratio = np.clip(ratio, 1 / _FACTOR, _FACTOR)
            if gain < _GAIN:
                return False
        else:
            self._power *= 0.5
            if self._power < 0.1:
                return False
        step = self.best * self._ratio**self._power
        self.density = np.clip(step, DENSITY / _RANGE, DENSITY * _RANGE)
        return self.rounds < _ROUNDS
