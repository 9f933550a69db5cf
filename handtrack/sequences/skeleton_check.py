"""Which joint order makes a hand of joints: told by bone lengths and by how constant they are.

Nothing but distances between joints is looked at, so that place, side and unit do not matter.
Bones and the palm keep their lengths from frame to frame, and these are in a hand's proportions;
in a wrong order they are neither.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import rows_of
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import BASES, BONES, N_JOINTS, ORDER_JOINTS, ORDERS, PALM
from handtrack.sequences.some_frames import HUGE, some_frames

Array = NDArray[np.float64]
Picks = tuple[int, ...]

GOOD = 0.6
"""A misfit below this is a hand's; noisy detections of one camera reach 0.8 in their own order."""

_LOOK = 60
"""Frames that are enough to tell an order."""
_LEAST = 12
"""A frame with fewer joints says little."""
# the length of a bone that has none, over the hand's size
_NOTHING = 1e-3
# proportions differ from the adult hand's by so much (in logarithms), more about the thumb's
# base, which sources place differently
_PROPORTION, _THUMB = 0.2, 0.3
# lengths of noisy detections change by so much from frame to frame
_CONSTANT = 0.15
_RANDOM = 200
# orders that are judged at a time, so that their numbers stay in the processor's cache
_AT_ONCE = 16
_FOLDED = float(np.cos(np.deg2rad(135.0)))
_PAIRS = np.array(list(combinations(range(N_JOINTS), 2)))
# our joints with the fingers in every other order
_FINGERS = [
    (0, *(int(BASES[f]) + i for f in order for i in range(4))) for order in permutations(range(5))
]

# and with one finger, or all of them, from the tip on
_REVERSED = [
    tuple(
        [0]
        + [
            int(b) + i
            for f, b in enumerate(BASES)
            for i in ((3, 2, 1, 0) if f in turned else range(4))
        ]
    )
    for turned in ((0,), (1,), (2,), (3,), (4,), (1, 2, 3, 4), (0, 1, 2, 3, 4))
]


class OrderFit(NamedTuple):
    """How well joints make a hand when read in one order.

    Attributes:
        name: of `skeleton.ORDERS`; "" for one that has no name.
        picks: our joint i is the source's picks[i], -1 where it has none.
        misfit: about 0.1 for clean joints of any hand, below `GOOD` for most real ones, 1 to 2 in
            a wrong order; NaN where too little is seen to tell.
    """

    name: str
    picks: Picks
    misfit: float


def best_order(joints: ArrayLike) -> list[OrderFit]:
    """The known orders with as many joints as these have, the best fitting first.

    The best is to be believed where it is clearly ahead: see `clearly_better`. With one frame
    proportions alone speak, which tell most orders apart too.

    Args:
        joints: (T, N, 3) in any unit and any order, NaN = missing.

    Returns:
        One for each different order of N joints, by the first of its names; none where N has
        no order. Misfits are NaN, and the names in the order of `ORDERS`, where no frame has
        12 joints.

    Raises:
        InputError: wrong shape.
    """
    points = np.asarray(joints, dtype=np.float64)
    if points.ndim != 3 or points.shape[2] != 3:
        raise InputError(f"joints have shape {points.shape}, expected (frames, joints, 3)")
    known = orders_of(points.shape[1])
    if not known:
        return []
    logs = _log_distances(points)
    values = _misfits(logs, np.array(list(known.values())))
    fits = [OrderFit(n, p, float(v)) for (n, p), v in zip(known.items(), values, strict=True)]
    return sorted(fits, key=lambda fit: fit.misfit) if np.isfinite(values).all() else fits


def orders_of(n: int) -> dict[str, Picks]:
    """The different orders of n joints, by the first of their names."""
    out: dict[str, Picks] = {}
    for name, picks in ORDERS.items():
        if ORDER_JOINTS[name] == n and picks not in out.values():
            out[name] = picks
    return out


def misfit(joints: Array, picks: Picks = ORDERS["handtrack"]) -> float:
    """The misfit of joints (T, N, 3) read in an order, as in `OrderFit`."""
    return float(_misfits(_log_distances(joints), np.array([picks]))[0])


def misfit_without(joints: Array, joint: int) -> float:
    """The misfit of joints (T, 21, 3) without one, told by bones and the palm alone.

    How near a thumb comes to other fingers is its motion's, and would be told by one joint only.
    """
    known, logs = _lengths(), _log_distances(joints)
    a, b = known.pairs[~known.rigid].T
    logs[:, a, b] = logs[:, b, a] = np.nan
    picks = [-1 if j == joint else j for j in range(N_JOINTS)]
    return float(_misfits(logs, np.array([picks]))[0])


def clearly_better(other: float, own: float, frames: int) -> bool:
    """Whether an order with the misfit `other` is to be believed against one with `own`.

    With few frames lengths have not shown whether they are constant: then the lead must be
    larger.
    """
    lead = 0.06 if frames >= 10 else 0.25
    return other < GOOD and own - other > max(lead, 0.15 * own)


def better_order(joints: Array, picks: Picks, frames: int) -> OrderFit | None:
    """The order that makes a clearly better hand of joints (T, N, 3) than `picks`, if one does.

    Looked at are the named orders of N joints, and `picks` with the fingers exchanged or turned
    round.
    """
    logs = _log_distances(joints)
    named = orders_of(joints.shape[1])
    exchanged = [tuple(picks[k] for k in fingers) for fingers in _FINGERS + _REVERSED]
    tries = [p for p in (*named.values(), *exchanged) if p != picks]
    values = _fair_misfits(logs, np.array([picks, *tries]))
    if not np.isfinite(values).any():
        return None
    pair = _exchanged_pair(logs, picks) if frames >= 10 else None
    k = int(np.nanargmin(values))
    if k == 0 or not clearly_better(float(values[k]), float(values[0]), frames):
        return pair
    if pair is not None and pair.misfit < values[k]:
        return pair
    name = next((n for n, p in named.items() if p == tries[k - 1]), "")
    return OrderFit(name, tries[k - 1], float(values[k]))


def _exchanged_pair(logs: Array, picks: Picks) -> OrderFit | None:
    """The order with two joints exchanged, where that explains most of a misfit.

    One pair changes a misfit little, so that only joints that are clean otherwise show it.
    """
    # joints at one place are another fault
    size = median(logs.reshape(len(logs), -1), 1)[:, None, None]
    logs = np.where(logs < size + np.log(2 * _NOTHING), np.nan, logs)
    tries = np.repeat(np.array([picks]), 1 + len(_PAIRS), axis=0)
    row, (a, b) = np.arange(1, 1 + len(_PAIRS)), _PAIRS.T
    tries[row, a], tries[row, b] = tries[row, b], tries[row, a]
    values = _fair_misfits(logs, tries)
    own = float(values[0])
    k = int(np.nanargmin(values)) if np.isfinite(values).any() else 0
    if not (own - values[k] > 0.04 and values[k] < 0.5 * own):
        return None
    return OrderFit("", tuple(map(int, tries[k])), float(values[k]))


def folded_back(joints: Array, picks: Picks) -> list[int]:
    """Our joints at which the bones of joints (T, N, 3) fold back on each other in most frames.

    No joint of a finger bends by 135 degrees for long.
    """
    places = np.array(picks)
    some = rows_of(joints, np.arange(0, len(joints), max(1, len(joints) // _LOOK)))
    x = np.where((places < 0)[:, None], np.nan, some[:, places])
    x = np.where(np.abs(x) < HUGE, x, np.nan)
    out = []
    for base in BASES:
        for j in range(base, base + 3):
            before, after = x[:, j] - x[:, 0 if j == base else j - 1], x[:, j + 1] - x[:, j]
            size = np.linalg.norm(before, axis=-1) * np.linalg.norm(after, axis=-1)
            cosine = np.full(len(x), np.nan)
            np.divide((before * after).sum(-1), size, out=cosine, where=size > 0)
            if median(cosine, 0) < _FOLDED:
                out.append(int(j))
    return out


def beyond_chance(joints: Array, picks: Picks) -> float:
    """How much better joints (T, N, 3) fit a hand so than in a random order.

    Returns:
        In standard deviations of random orders: 5 to 9 for hands, 3 for the noisiest, up to 3
        for what is none; NaN where too little is seen to tell.
    """
    random = np.random.default_rng(0)
    tries = [picks, *(tuple(random.permutation(picks)) for _ in range(_RANDOM))]
    values = _misfits(_log_distances(joints), np.array(tries))
    others = values[1:][np.isfinite(values[1:])]
    if len(others) < _RANDOM // 2 or not others.std() > 0:
        return float("nan")
    return float((others.mean() - values[0]) / others.std())


class _Lengths(NamedTuple):
    """Pairs of joints (P, 2) with the adult hand's log length, its tolerance, and which are
    rigid: bones, and all of the palm. The rest only tell fingers apart."""

    pairs: NDArray[np.int64]
    log_length: Array
    tolerance: Array
    rigid: NDArray[np.bool_]


@cache
def _lengths() -> _Lengths:
    rigid = [*BONES, *(p for p in combinations(map(int, PALM), 2) if p[0] != 0)]
    loose = [(2, int(b)) for b in BASES[1:]] + [(3, 5), (3, 17), (6, 10), (10, 14), (14, 18)]
    pairs = np.array(rigid + loose)
    rest = HandModel.default("right").rest_joints
    length = np.linalg.norm(rest[pairs[:, 0]] - rest[pairs[:, 1]], axis=-1)
    is_rigid = np.arange(len(pairs)) < len(rigid)
    wide = ~is_rigid | (pairs == 1).any(1)
    return _Lengths(pairs, np.log(length), np.where(wide, _THUMB, _PROPORTION), is_rigid)


def _log_distances(joints: Array) -> Array:
    """(F, N, N) logarithms of the distances in some frames; NaN where one is missing."""
    enough = min(_LEAST, joints.shape[1])
    frames = some_frames(joints, _LOOK, enough)
    if not len(frames):
        return np.zeros((0, joints.shape[1], joints.shape[1]))
    x = rows_of(joints, frames)
    x = np.where(np.abs(x) < HUGE, x, np.nan)
    # an array for each axis: sums over a last axis of three take many times as long
    square = [np.square(one[:, :, None] - one[:, None]) for one in np.moveaxis(x, 2, 0).copy()]
    apart = np.sqrt(square[0] + square[1] + square[2])
    size = median(apart.reshape(len(x), -1), 1)[:, None, None]
    # joints at one place are no bone, but no reason to leave it out either
    apart = np.where((apart == 0) & (size > 0), _NOTHING * size, apart)
    out = np.full(apart.shape, np.nan)
    np.log(apart, out=out, where=apart > 0)
    return out


def _misfits(logs: Array, orders: NDArray[np.int64], worth: float = np.inf) -> Array:
    """(K,) misfits of orders (K, 21): means of heavy-tailed costs, so that strays count little.

    A frame's scale is its own: the bones of one camera's detections breathe together. Infinite
    where proportions alone make one of at least `worth`.
    """
    if not len(logs):
        return np.full(len(orders), np.nan)
    by_pair = np.ascontiguousarray(logs.transpose(1, 2, 0))
    parts = [orders[k : k + _AT_ONCE] for k in range(0, len(orders), _AT_ONCE)]
    return np.concatenate([_misfits_of_few(by_pair, part, worth) for part in parts])


def _misfits_of_few(logs: Array, orders: NDArray[np.int64], worth: float) -> Array:
    """(K,) as `_misfits`, from logs (N, N, F)."""
    known = _lengths()
    a, b = orders[:, known.pairs[:, 0]], orders[:, known.pairs[:, 1]]
    x = logs[a, b]
    x -= known.log_length[:, None]
    x[(a < 0) | (b < 0)] = np.nan
    rigid = slice(int(known.rigid.sum()))  # the first ones
    x -= median(x[:, rigid], 1)[:, None]
    typical = median(x, 2)
    cost = np.log1p(np.square(typical / known.tolerance) / 2)
    found = _mean_cost(cost)
    # what only changes makes it worse
    left = ~(found >= worth)
    found[~left] = np.inf
    x, typical, cost = x[left][:, rigid], typical[left][:, rigid], cost[left]
    spread = 1.4826 * median(np.abs(x - typical[..., None]), 2)
    cost[:, rigid] += np.log1p(np.square(spread / _CONSTANT) / 2)
    found[left] = _mean_cost(cost)
    return found


def _fair_misfits(logs: Array, orders: NDArray[np.int64]) -> Array:
    """(K,) misfits of orders (K, 21), NaN for one that sets more bones to joints never seen than
    the first: what is not seen fits anything. Infinite for one that is clearly worse than it."""
    known = _lengths()
    a, b = orders[:, known.pairs[:, 0]], orders[:, known.pairs[:, 1]]
    seen = np.asarray(np.isfinite(logs).any(axis=0))
    unseen = ((a >= 0) & (b >= 0) & ~seen[a, b]).sum(1)
    own = _misfits(logs, orders[:1])
    others = _misfits(logs, orders[1:], float(own[0])) if len(orders) > 1 else own[1:]
    return np.where(unseen <= unseen[0], np.concatenate([own, others]), np.nan)


def _mean_cost(cost: Array) -> Array:
    """(K,) means of the costs (K, P) of pairs; NaN where too few of bones and palm are seen."""
    seen = np.isfinite(cost)
    count = (seen & _lengths().rigid).sum(1)
    total = np.where(seen, cost, 0.0).sum(1)
    return np.where(count >= 8, total / np.maximum(count, 1), np.nan)


def median(x: Array, axis: int) -> Array:
    """Median of what is not NaN; NaN of nothing, without NumPy's warning."""
    ordered = np.sort(x, axis=axis)  # NaN goes to the end
    size = x.shape[axis]
    if size and np.isfinite(ordered.take([0, -1], axis)).all():
        low, high = ordered.take((size - 1) // 2, axis), ordered.take(size // 2, axis)
        return np.asarray((low + high) / 2)
    n = np.isfinite(ordered).sum(axis, keepdims=True)
    low = np.take_along_axis(ordered, np.maximum((n - 1) // 2, 0), axis)
    high = np.take_along_axis(ordered, np.minimum(n // 2, size - 1), axis)
    middle = np.where(n > 0, (low + high) / 2, np.nan)
    return np.asarray(middle.squeeze(axis))
