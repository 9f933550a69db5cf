"""How wildly a hand is expected to move, and what a sequence says of it.

A pose number moves by dx = v dt, dv = -v DECAY dt + dw, with dw white noise of density q per
time: the velocity is an Ornstein-Uhlenbeck process. On real hands, from 30 to 115 frames per
second, this decay is far likelier than a velocity that stays, and a filter that predicts without
measurements comes to rest instead of running away.

And whether the joints' noise lasts, by what the fits of a whole sequence leave of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import ROWS
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS
from handtrack.kernels import joint_noise
from handtrack.tracking.filter_input import LongFrames

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
    evidence of `add_evidence`. At the maximum both sums of the evidence are equal; their
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


LASTS_S = 0.1
"""For how long noise lasts where nobody says it: to 1/e [s].

What a sequence shows of this is vague: longer ones are as likely, and bring no pose nearer.
"""


def lasting_share(frames: LongFrames, lasts_s: float) -> tuple[float, float]:
    """What share of the joints' noise lasts for `lasts_s` [s], 0 where it is white or not known;
    and what part of the residuals is not their mean.

    As `kernels.joint_noise` follows it in a stream.
    """
    total, seen_of, whole = np.zeros((N_JOINTS, 3)), np.zeros(N_JOINTS, np.int64), 0.0
    for left, seen in _residuals(frames):
        total += left.sum(0)
        seen_of += seen.sum(0)
        whole += float(np.square(left).sum())
    mean = total / np.maximum(seen_of, 1)[:, None]
    both, products, moved, n_pairs = 0.0, 0.0, 0.0, 0
    last: tuple[Array, NDArray[np.bool_]] | None = None
    for left, seen in _residuals(frames):
        left -= mean
        moved += float(np.square(left).sum())
        if last is not None:
            left, seen = np.concatenate([last[0], left]), np.concatenate([last[1], seen])
        last = left[-1:], seen[-1:]
        pairs = (seen[1:] & seen[:-1])[..., None]
        before, after = np.where(pairs, left[:-1], 0.0), np.where(pairs, left[1:], 0.0)
        both += 0.5 * float(np.square(before).sum() + np.square(after).sum())
        products += float((before * after).sum())
        n_pairs += int(pairs.sum())
    noise = np.nanmedian(frames.column("noise")) if seen_of.any() else 0.0
    if n_pairs <= joint_noise.LEAST_PAIRS or both == 0.0 or not noise > joint_noise.FINE:
        return 0.0, 1.0
    dt = 1e-9 * float(np.median(np.diff(frames.times_ns)))
    share = float(joint_noise.share_of.py_func(products / both, dt, lasts_s))
    return share, moved / whole


def _residuals(frames: LongFrames) -> Iterator[tuple[Array, NDArray[np.bool_]]]:
    """What the fits leave of the joints, in the hand's frame (n, 21, 3), 0 where nothing is seen,
    and where something is (n, 21): some frames at a time."""
    for t in range(0, len(frames), ROWS):
        _, joints, weights, raw = frames.part(slice(t, t + ROWS))
        seen = (weights > 0) & np.isfinite(raw["noise"])[:, None]
        turn = raw["root"][:, :9].reshape(-1, 3, 3)
        there = np.where(seen[..., None], joints, 0.0)
        left = np.where(seen[..., None], there - raw["joints"], 0.0)
        yield np.where(seen[..., None], left @ turn, 0.0), seen
