"""How a detector's errors go with the poses it sees: learnt from people, judged on others.

A ridge regression from the places of all joints in the detected palm's frame to the shifts that
bring them where the profile's offsets expect them. How much it is held back, and whether it is of
use at all, is decided by leaving out one person after another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.correction import N_PLACES, Correction, Palms
from handtrack.hand.skeleton import N_JOINTS, Hand

Array = NDArray[np.float64]

LEAST_PEOPLE = 6
"""People that a correction is learnt from, at least."""
_HELD_BACK = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
# an unknown person's landmarks are to come so much nearer
_PAYS = 0.995


@dataclass(frozen=True, eq=False)
class Example:
    """One clip: detected (T, 21, 3) joints, where they are expected, and whose they are."""

    joints: Array
    expected: Array
    hand: Hand
    person: str


class Learnt(NamedTuple):
    """A correction, and the clips' joints as corrections of the other people bring them."""

    correction: Correction
    unknown: list[Array]


class _Sums(NamedTuple):
    """Of places x and shifts y: how many, and sums of x, y, x x^T, x y^T, x^2."""

    n: Array
    x: Array
    y: Array
    xx: Array
    xy: Array

    @staticmethod
    def of(example: Example) -> _Sums:
        x, y = _regressed(example)
        return _Sums(np.array(float(len(x))), x.sum(0), y.sum(0), x.T @ x, x.T @ y)


def learn(examples: list[Example]) -> Learnt | None:
    """The correction that clips show; None where it brings unknown people's no nearer."""
    people = sorted({e.person for e in examples})
    if len(people) < LEAST_PEOPLE:
        return None
    sums = [_Sums.of(e) for e in examples]
    everything = _added(sums)
    others = {
        person: _without(
            everything, [s for s, e in zip(sums, examples, strict=True) if e.person == person]
        )
        for person in people
    }
    tried = []
    for held in _HELD_BACK:
        made = {person: _solved(rest, held) for person, rest in others.items()}
        unknown = [made[e.person].of(e.joints, e.hand) for e in examples]
        tried.append((_distance(unknown, examples), held, unknown))
    best, held, unknown = min(tried, key=lambda one: one[0])
    if best > _PAYS * _distance([e.joints for e in examples], examples):
        return None
    return Learnt(_solved(everything, held), unknown)


def _regressed(example: Example) -> tuple[Array, Array]:
    """(T, 63) places and shifts in the frames of the palms."""
    palms = Palms.of(example.joints, example.hand)
    x, wanted = palms.places(example.joints), palms.places(example.expected)
    return x.reshape(-1, N_PLACES), (wanted - x).reshape(-1, N_PLACES)


def _added(sums: list[_Sums]) -> _Sums:
    return _Sums(*(np.sum([s[i] for s in sums], axis=0) for i in range(len(_Sums._fields))))


def _without(everything: _Sums, some: list[_Sums]) -> _Sums:
    return _Sums(*(a - b for a, b in zip(everything, _added(some), strict=True)))


def _solved(sums: _Sums, held: float) -> Correction:
    mean, shift = sums.x / sums.n, sums.y / sums.n
    covariance = sums.xx - sums.n * np.outer(mean, mean)
    related = sums.xy - sums.n * np.outer(mean, shift)
    # in units of the places' spread, whatever that is
    unit = np.trace(covariance) / sums.n
    slope = np.linalg.solve(covariance + held * unit * np.eye(N_PLACES), related).T
    spread = np.sqrt(np.maximum(np.diag(covariance) / sums.n, 0.0))
    by_joint = (N_JOINTS, 3)
    return Correction(
        mean.reshape(by_joint), spread.reshape(by_joint), shift.reshape(by_joint), slope
    )


def _distance(joints: list[Array], examples: list[Example]) -> float:
    off = [
        np.linalg.norm(a - e.expected, axis=-1).ravel()
        for a, e in zip(joints, examples, strict=True)
    ]
    return float(np.concatenate(off).mean())
