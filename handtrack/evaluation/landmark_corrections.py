"""How a detector's errors go with the poses it sees: learnt from people, judged on others.

A ridge regression from the places of all joints in the detected palm's frame, and from the way the
bones of a joint's own finger point, to the shifts that bring the joints where the profile's
offsets expect them. What other fingers do is held back most. How much all is held back, and
whether it is of use at all, is decided by leaving out one person after another.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.correction import (
    N_BENDS,
    N_FINGERS,
    N_OWN,
    N_PLACES,
    Bends,
    Correction,
    Palms,
    bends,
)
from handtrack.hand.skeleton import N_JOINTS, PALM, Hand

Array = NDArray[np.float64]

LEAST_PEOPLE = 6
"""People that a correction is learnt from, at least."""
# shares of the places' variance that hold slopes back, of which one is chosen
_HELD_BACK = (2e-5, 5e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
# how much more those of the palm's joints, and of other fingers, are held back than the own one's
_PALM, _OTHERS = 10.0, 100.0
# the same of coordinates of directions, which are of order 1, and of their products
_POINTING, _PRODUCTS = 40.0, 160.0
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
    """Of features x and shifts y: their weight, and sums of x, y, x x^T, x y^T by weight.

    A clip weighs as much as the root of its frames, which are alike.
    """

    n: Array
    x: Array
    y: Array
    xx: Array
    xy: Array

    @staticmethod
    def of(example: Example) -> _Sums:
        x, y = _regressed(example)
        n = np.sqrt(len(x))
        return _Sums(np.array(n), *(part / n for part in (x.sum(0), y.sum(0), x.T @ x, x.T @ y)))


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
    """(T, 63 + 5 * 90) places and bends, and (T, 63) shifts, in the frames of the palms."""
    palms = Palms.of(example.joints, example.hand)
    x, wanted = palms.places(example.joints), palms.places(example.expected)
    n = len(x)
    own = np.nan_to_num(bends(x))
    features = np.concatenate([x.reshape(n, -1), own.reshape(n, -1)], 1)
    return features, (wanted - x).reshape(n, N_PLACES)


def _added(sums: list[_Sums]) -> _Sums:
    return _Sums(*(np.sum([s[i] for s in sums], axis=0) for i in range(len(_Sums._fields))))


def _without(everything: _Sums, some: list[_Sums]) -> _Sums:
    return _Sums(*(a - b for a, b in zip(everything, _added(some), strict=True)))


def _solved(sums: _Sums, held: float) -> Correction:
    mean, shift = sums.x / sums.n, sums.y / sums.n
    covariance = sums.xx / sums.n - np.outer(mean, mean)
    related = sums.xy / sums.n - np.outer(mean, shift)
    # in units of the places' spread, whatever that is
    unit = np.trace(covariance[:N_PLACES, :N_PLACES])
    slope, own = np.empty((N_PLACES, N_PLACES)), np.empty((N_FINGERS, N_OWN, N_BENDS))
    # the wrist is of no finger
    slope[:3] = _ridge(covariance, related, np.arange(N_PLACES), np.arange(3), held * _held(unit))
    for f in range(N_FINGERS):
        rows = 3 + N_OWN * f + np.arange(N_OWN)
        bent = N_PLACES + N_BENDS * f + np.arange(N_BENDS)
        columns = np.concatenate([np.arange(N_PLACES), bent])
        both = _ridge(covariance, related, columns, rows, held * _held(unit, rows))
        slope[rows], own[f] = both[:, :N_PLACES], both[:, N_PLACES:]
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    by_joint, by_finger = (N_JOINTS, 3), (N_FINGERS, N_BENDS)
    finger = Bends(mean[N_PLACES:].reshape(by_finger), spread[N_PLACES:].reshape(by_finger), own)
    return Correction(
        mean[:N_PLACES].reshape(by_joint),
        spread[:N_PLACES].reshape(by_joint),
        shift.reshape(by_joint),
        slope,
        finger,
    )


def _held(unit: Array, own: NDArray[np.intp] | None = None) -> Array:
    """How much the slopes of places, and of a finger's bends, are held back against each other.

    Args:
        unit: the places' variance.
        own: (12,) the places of the finger; None for the wrist.
    """
    places = np.full((N_JOINTS, 3), _OTHERS)
    places[PALM] = _PALM
    if own is None:
        return places.ravel() * unit
    places.ravel()[own] = 1.0
    pointing = np.full(N_OWN, _POINTING)
    products = np.full(N_BENDS - N_OWN, _PRODUCTS)
    return np.concatenate([places.ravel() * unit, pointing, products])


def _ridge(
    covariance: Array,
    related: Array,
    columns: NDArray[np.intp],
    rows: NDArray[np.intp],
    held: Array,
) -> Array:
    """(rows, columns) slopes."""
    among = covariance[np.ix_(columns, columns)] + np.diag(held)
    return np.asarray(np.linalg.solve(among, related[np.ix_(columns, rows)]).T)


def _distance(joints: list[Array], examples: list[Example]) -> float:
    off = [
        np.linalg.norm(a - e.expected, axis=-1).ravel()
        for a, e in zip(joints, examples, strict=True)
    ]
    return float(np.concatenate(off).mean())
