"""Which hand is which: exchanges of left and right, or of people, for a few frames, put back.

Detectors name the hands that they find frame by frame, and now and then give one hand the
name of another: for a moment both hands jump to each other's place, and back. Here the hands of
one source are looked at together and forwards and backwards in time; what remains as it is after
a second is taken as said. It is not for streams: it needs the frames after an exchange.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import HANDS, N_JOINTS
from handtrack.sequences.chirality import DECIDED, chirality, frame_chirality
from handtrack.sequences.sequence import Remark, Sequence

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LONGEST_S = 1.0
"""An exchange that lasts longer is not put back [s]."""

# The costs of a way to read the frames, in units of an expected motion. A joint that moves by
# _STILL_M + _SPEED dt costs 1, and never more than _FAR.
_STILL_M = 0.02
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
# fewer joints say nothing of whose they are
_FEW = 3
# an exchange must explain the frames better by this
_GAIN = 1.0


@dataclass(frozen=True, eq=False)
class _Together:
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


def repair_identity(sequences: Many[Sequence]) -> list[Sequence]:
    """Put back hands that were exchanged for up to a second, among the sequences of a source.

    Exchanged may be left and right of one person, the same hands of two people, or both hands
    of two people; one of the two may be missing. The way through the frames that costs least
    (Viterbi) is taken, where a cost is the motion of the joints from one frame to the next, a
    hand that comes or goes, fingers that flex like the other hand's, and the exchange itself. It
    is taken only where it clearly beats the frames as they are.

    Args:
        sequences: as `handtrack.load` gives them; those with the same `source` belong together.

    Returns:
        The sequences in their order; those that had frames exchanged are new ones, with a
        remark for every exchange. Frames that came from another sequence bring their joints
        and confidence; truth and time stay.
    """
    out = list(sequences)
    sources: dict[str, list[int]] = {}
    for i, sequence in enumerate(sequences):
        sources.setdefault(sequence.source, []).append(i)
    for members in sources.values():
        if len(members) > 1:
            for i, repaired in zip(members, _repaired([out[i] for i in members]), strict=True):
                out[i] = repaired
    return out


def _repaired(group: list[Sequence]) -> list[Sequence]:
    together = _on_one_time_line(group)
    if len(together.ways) == 1:
        return group
    way = np.zeros(len(together.time_ns), dtype=np.int64)
    for first, last in _doubtful(together):
        part = _part(together, first, last)
        # only what lies at the start of the source may begin exchanged
        found = _cheapest(part, free=first == 0)
        way[first : last + 1] = _worthwhile(part, found)
    return _put_back(group, together, way) if way.any() else group


def _on_one_time_line(group: list[Sequence]) -> _Together:
    time_ns = np.unique(np.concatenate([s.time_ns for s in group]))
    joints = np.full((len(time_ns), len(group), N_JOINTS, 3), np.nan)
    for k, s in enumerate(group):
        joints[np.searchsorted(time_ns, s.time_ns), k] = s.joints
    bends = np.stack([frame_chirality(joints[:, k]) for k in range(len(group))], axis=1)
    sign = np.zeros(len(group))
    for k, s in enumerate(group):
        whole = chirality(s.joints)
        # labels may be the wrong way round all through: it counts how the sequence flexes
        sign[k] = np.sign(whole) if abs(whole) > DECIDED else 0.0
    seen = (~np.isnan(joints[..., 0])).sum(-1) >= _FEW
    return _Together(time_ns, joints, seen, bends, sign, _ways(group, joints))


def _ways(group: list[Sequence], joints: Array) -> Ints:
    """(S, N) the permutations that are thought of, the identity first."""
    places = {(s.subject, s.hand): k for k, s in enumerate(group)}
    swaps: list[list[tuple[int, int]]] = []
    for i, j in combinations(range(len(group)), 2):
        a, b = group[i], group[j]
        if (a.subject == b.subject) != (a.hand == b.hand) and _apart(joints[:, i], joints[:, j]):
            swaps.append([(i, j)])
    for p, q in combinations(dict.fromkeys(s.subject for s in group), 2):
        hands = [hand for hand in HANDS if (p, hand) in places and (q, hand) in places]
        both = [(places[p, hand], places[q, hand]) for hand in hands]
        if len(both) == 2 and all([pair] in swaps for pair in both):
            swaps.append(both)
    ways = np.tile(np.arange(len(group)), (len(swaps) + 1, 1))
    for row, pairs in zip(ways[1:], swaps, strict=True):
        for i, j in pairs:
            row[i], row[j] = j, i
    return ways


def _apart(a: Array, b: Array) -> bool:
    """Whether two hands (T, 21, 3) are at places of their own.

    Joints that are given around each hand's own middle say nothing of who is where.
    """
    distance = np.linalg.norm(_middle(a) - _middle(b), axis=-1)
    distance = distance[~np.isnan(distance)]
    return not distance.size or bool(np.median(distance) > _STILL_M)


def _middle(joints: Array) -> Array:
    """(T, 3) mean of the joints (T, 21, 3) that are there, or NaN."""
    count = (~np.isnan(joints[..., 0])).sum(1)[:, None]
    total = np.nansum(joints, axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _part(together: _Together, first: int, last: int) -> _Together:
    part = slice(first, last + 1)
    return replace(
        together,
        time_ns=together.time_ns[part],
        joints=together.joints[part],
        seen=together.seen[part],
        bends=together.bends[part],
    )


def _doubtful(together: _Together) -> list[tuple[int, int]]:
    """First and last index of each stretch to be looked at: around a hand that jumps or comes."""
    time_ns, n = together.time_ns, len(together.time_ns)
    doubtful = np.zeros(n, dtype=bool)
    for k in range(together.seen.shape[1]):
        at = np.flatnonzero(together.seen[:, k])
        if not at.size:
            continue
        moved = together.joints[at[1:], k] - together.joints[at[:-1], k]
        dt = np.diff(time_ns[at]) * 1e-9
        cost = _motion(moved[:, None], dt[:, None])[:, 0]
        doubtful[at[0]] |= at[0] > 0
        doubtful[at[1:]] |= (cost > 1.0) | (np.diff(at) > 1)
    stretches: list[tuple[int, int]] = []
    reach = int(LONGEST_S * 1e9)
    for t in np.flatnonzero(doubtful):
        first = max(int(np.searchsorted(time_ns, time_ns[t] - reach)), 0)
        last = min(int(np.searchsorted(time_ns, time_ns[t] + reach, side="right")), n) - 1
        if stretches and first <= stretches[-1][1] + 1:
            stretches[-1] = stretches[-1][0], last
        else:
            stretches.append((first, last))
    return stretches


def _motion(moved: Array, dt: Array) -> Array:
    """Cost (...) of joints that moved by (..., 21, 3) [m] in dt (...) [s]; NaN if none did."""
    expected = _STILL_M + _SPEED * dt
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

    def costs(self, together: _Together, t: int) -> Array:
        """(R, N, N) what it costs if a hand (second axis) takes a frame (third) at time t."""
        age = (together.time_ns[t] - self.time_ns) * 1e-9
        moved = together.joints[t][None, None] - self.joints[:, :, None]
        cost = _motion(moved, np.broadcast_to(age[..., None], moved.shape[:3]))
        forgotten = np.isnan(cost) | (age > _MEMORY_S)[..., None]
        seen = together.seen[t]
        return np.where(
            seen, np.where(forgotten, _COMES, cost), np.where(self.there, _GOES, 0.0)[..., None]
        )

    def take(self, together: _Together, t: int, before: Ints, ways: Ints) -> None:
        """Reading r goes on from reading before[r], and gives the hands the frames ways[r]."""
        seen = together.seen[t][ways]
        joints = together.joints[t][ways]
        self.joints = np.where(seen[..., None, None], joints, self.joints[before])
        self.time_ns = np.where(seen, together.time_ns[t], self.time_ns[before])
        self.there = seen


def _standing(together: _Together, t: int) -> Array:
    """(S,) what each way costs at time t, whatever was before."""
    dt = 0.0 if t == 0 else (together.time_ns[t] - together.time_ns[t - 1]) * 1e-9
    dt = min(dt, _MEMORY_S)
    bends = together.bends[t][together.ways] * together.sign
    wrong = np.where(together.seen[t][together.ways], 0.5 * (np.abs(bends) - bends), 0.0).sum(1)
    lasting = np.where(np.arange(len(together.ways)) > 0, _LASTING, 0.0)
    return np.asarray(dt * (_CHIRALITY * wrong + lasting))


def _cheapest(together: _Together, free: bool) -> Ints:
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


def _cost(together: _Together, way: Ints) -> float:
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


def _worthwhile(together: _Together, way: Ints) -> Ints:
    """The way without exchanges that last too long or explain too little."""
    kept = way.copy()
    for first, last in _runs(way):
        long = (together.time_ns[last] - together.time_ns[first]) * 1e-9 > LONGEST_S
        without = kept.copy()
        without[first : last + 1] = 0
        if long or _cost(together, without) - _cost(together, kept) < _GAIN:
            kept = without
    return kept


def _runs(way: Ints) -> list[tuple[int, int]]:
    """First and last index of each stretch of one exchange."""
    edges = np.flatnonzero(np.diff(way)) + 1
    firsts = [0, *edges.tolist()]
    lasts = [*(edges - 1).tolist(), len(way) - 1]
    return [(a, b) for a, b in zip(firsts, lasts, strict=True) if way[a] > 0]


def _put_back(group: list[Sequence], together: _Together, way: Ints) -> list[Sequence]:
    time_ns, taken = together.time_ns, together.ways[way]
    n = len(time_ns)
    joints = together.joints[np.arange(n)[:, None], taken]
    confidence = np.zeros((n, len(group), N_JOINTS))
    index = np.zeros((n, len(group)), dtype=np.int64)
    has = np.zeros((n, len(group)), dtype=bool)
    for k, s in enumerate(group):
        rows = np.searchsorted(time_ns, s.time_ns)
        confidence[rows, k], index[rows, k], has[rows, k] = s.confidence, s.frame_index, True
    confidence = confidence[np.arange(n)[:, None], taken]
    out = []
    for k, s in enumerate(group):
        moved = taken[:, k] != k
        if not moved.any():
            out.append(s)
            continue
        # frames of its own, and those that another sequence had
        keep = has[:, k] | (moved & ~np.isnan(joints[:, k, :, 0]).all(-1))
        own = np.where(has[:, k], index[:, k], index[np.arange(n), taken[:, k]])
        truth = None
        if s.truth is not None:
            truth = np.full((n, N_JOINTS, 3), np.nan)
            truth[has[:, k]] = s.truth
            truth = truth[keep]
        out.append(
            replace(
                s,
                time_ns=time_ns[keep],
                joints=joints[keep, k],
                confidence=confidence[keep, k],
                frame_index=own[keep],
                truth=truth,
                remarks=(*s.remarks, *_remarks(group, together, way, own, k)),
            )
        )
    return out


def _remarks(
    group: list[Sequence], together: _Together, way: Ints, index: Ints, k: int
) -> list[Remark]:
    found = []
    for first, last in _runs(way):
        other = int(together.ways[way[first], k])
        if other != k:
            count = last - first + 1
            where = f"frame {index[first]}"
            if count > 1:
                where = f"frames {index[first]} to {index[last]}"
            text = f"exchanged with {group[other].name}: {where} put back"
            found.append(Remark(int(together.time_ns[first]), int(together.time_ns[last]), text))
    return found
