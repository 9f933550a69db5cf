"""What it costs to read the frames of several hands so that some of them are exchanged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import N_JOINTS

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# The costs of a way to read the frames, in units of an expected motion. A joint that moves by
# STILL_M + _SPEED dt costs 1, and never more than _FAR.
STILL_M = 0.02
_SPEED = 1.0  # m/s
_FAR = 6.0
# how long a hand's last place says where it will be [s]
_MEMORY_S = 0.5
# a hand that comes from nowhere, or goes
_COMES, _GOES = 4.0, 1.0
# an exchange begins or ends, and lasts, per second
_EXCHANGE, _LASTING = 1.5, 6.0
# fingers that flex like the other hand's, per second
_CHIRALITY = 8.0


@dataclass(frozen=True, eq=False)
class Together:
    """Sequences on one time line.

    Attributes:
        time_ns: (T,); joints: (T, N, 21, 3); seen: (T, N) whether enough joints are there to tell.
        bends: (T, N) chirality of each frame; sign: (N,) that of the whole sequence, or 0.
        ways: (S, N) permutations; row s says which sequence's frame each hand takes. The
            first leaves all as it is.
    """

    time_ns: Ints
    joints: Array
    seen: NDArray[np.bool_]
    bends: Array
    sign: Array
    ways: Ints


def motion(moved: Array, dt: Array) -> Array:
    """Cost (...) of joints that moved by (..., 21, 3) [m] in dt (...) [s]; NaN if none did."""
    expected = STILL_M + _SPEED * dt
    distance = np.sqrt(np.einsum("...i,...i->...", moved, moved)) / expected[..., None]
    known = ~np.isnan(distance)
    total = np.where(known, np.minimum(np.nan_to_num(distance), _FAR), 0.0).sum(-1)
    count = known.sum(-1)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


class _Memory:
    """Where each of several readings of the frames saw each hand last."""

    def __init__(self, readings: int, hands: int):
        self.joints = np.full((readings, hands, N_JOINTS, 3), np.nan)
        self.time_ns = np.zeros((readings, hands), dtype=np.int64)
        self.there = np.zeros((readings, hands), dtype=bool)

    def costs(self, together: Together, t: int) -> Array:
        """(R, N, N) what it costs if a hand (second axis) takes a frame (third) at time t."""
        age = (together.time_ns[t] - self.time_ns) * 1e-9
        moved = together.joints[t][None, None] - self.joints[:, :, None]
        cost = motion(moved, np.broadcast_to(age[..., None], moved.shape[:3]))
        forgotten = np.isnan(cost) | (age > _MEMORY_S)[..., None]
        seen = together.seen[t]
        return np.where(
            seen, np.where(forgotten, _COMES, cost), np.where(self.there, _GOES, 0.0)[..., None]
        )

    def take(self, together: Together, t: int, before: Ints, ways: Ints) -> None:
        """Reading r goes on from reading before[r], and gives the hands the frames ways[r]."""
        seen = together.seen[t][ways]
        joints = together.joints[t][ways]
        self.joints = np.where(seen[..., None, None], joints, self.joints[before])
        self.time_ns = np.where(seen, together.time_ns[t], self.time_ns[before])
        self.there = seen


def _standing(together: Together, t: int) -> Array:
    """(S,) what each way costs at time t, whatever was before."""
    dt = 0.0 if t == 0 else (together.time_ns[t] - together.time_ns[t - 1]) * 1e-9
    dt = min(dt, _MEMORY_S)
    bends = together.bends[t][together.ways] * together.sign
    wrong = np.where(together.seen[t][together.ways], 0.5 * (np.abs(bends) - bends), 0.0).sum(1)
    lasting = np.where(np.arange(len(together.ways)) > 0, _LASTING, 0.0)
    return np.asarray(dt * (_CHIRALITY * wrong + lasting))


def cheapest(together: Together, free: bool) -> Ints:
    """(T,) the cheapest way at every time (Viterbi); free: it may begin exchanged."""
    ways, n = together.ways, len(together.time_ns)
    hands = np.arange(ways.shape[1])
    memory = _Memory(len(ways), len(hands))
    total = np.zeros(len(ways)) if free else np.where(np.arange(len(ways)) > 0, np.inf, 0.0)
    came_from = np.zeros((n, len(ways)), dtype=np.int64)
    changes = _EXCHANGE * (
        (np.arange(len(ways))[:, None] != np.arange(len(ways)))
        * ((np.arange(len(ways)) > 0)[:, None].astype(int) + (np.arange(len(ways)) > 0))
    )
    for t in range(n):
        # (from, hand, frame) -> (from, to)
        moves = memory.costs(together, t)[:, hands, ways].sum(-1)
        step = total[:, None] + moves + (changes if t else np.where(changes > 0, np.inf, 0.0))
        came_from[t] = step.argmin(0)
        total = step.min(0) + _standing(together, t)
        memory.take(together, t, came_from[t], ways)
    way = np.zeros(n, dtype=np.int64)
    way[-1] = int(total.argmin())
    for t in range(n - 1, 0, -1):
        way[t - 1] = came_from[t, way[t]]
    return way


def cost_of(together: Together, way: Ints) -> float:
    """What the frames cost if they are read in this way (T,)."""
    memory = _Memory(1, together.ways.shape[1])
    hands, here = np.arange(together.ways.shape[1]), np.zeros(1, dtype=np.int64)
    total = 0.0
    for t, s in enumerate(way):
        taken = together.ways[s]
        total += memory.costs(together, t)[0, hands, taken].sum() + _standing(together, t)[s]
        memory.take(together, t, here, taken[None])
        if t and way[t - 1] != s:
            total += _EXCHANGE * (int(s > 0) + int(way[t - 1] > 0))
    return float(total)
