"""Which hand is which: exchanges of left and right, or of people, for a few frames, put back.

Detectors name the hands that they find frame by frame, and now and then give one hand the
name of another: for a moment both hands jump to each other's place, and back. Here the hands of
one source are looked at together and forwards and backwards in time; what remains as it is after
a second is taken as said. It is not for streams: it needs the frames after an exchange.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import HANDS, N_JOINTS
from handtrack.sequences.chirality import DECIDED, chirality, frame_chirality
from handtrack.sequences.identity_costs import STILL_M, Together, cheapest, cost_of, motion
from handtrack.sequences.picture import Picture
from handtrack.sequences.sequence import Remark, Sequence

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LONGEST_S = 1.0
"""An exchange that lasts longer is not put back [s]."""

# fewer joints say nothing of whose they are
_FEW = 3
# an exchange must explain the frames better by this
_GAIN = 1.0


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
        found = cheapest(part, free=first == 0)
        way[first : last + 1] = _worthwhile(part, found)
    return _put_back(group, together, way) if way.any() else group


def _on_one_time_line(group: list[Sequence]) -> Together:
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
    return Together(time_ns, joints, seen, bends, sign, _ways(group, joints))


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
    return not distance.size or bool(np.median(distance) > STILL_M)


def _middle(joints: Array) -> Array:
    """(T, 3) mean of the joints (T, 21, 3) that are there, or NaN."""
    count = (~np.isnan(joints[..., 0])).sum(1)[:, None]
    total = np.nansum(joints, axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _part(together: Together, first: int, last: int) -> Together:
    part = slice(first, last + 1)
    return replace(
        together,
        time_ns=together.time_ns[part],
        joints=together.joints[part],
        seen=together.seen[part],
        bends=together.bends[part],
    )


def _doubtful(together: Together) -> list[tuple[int, int]]:
    """First and last index of each stretch to be looked at: around a hand that jumps or comes."""
    time_ns, n = together.time_ns, len(together.time_ns)
    doubtful = np.zeros(n, dtype=bool)
    for k in range(together.seen.shape[1]):
        at = np.flatnonzero(together.seen[:, k])
        if not at.size:
            continue
        moved = together.joints[at[1:], k] - together.joints[at[:-1], k]
        dt = np.diff(time_ns[at]) * 1e-9
        cost = motion(moved[:, None], dt[:, None])[:, 0]
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


def _worthwhile(together: Together, way: Ints) -> Ints:
    """The way without exchanges that last too long or explain too little."""
    kept = way.copy()
    for first, last in _runs(way):
        long = (together.time_ns[last] - together.time_ns[first]) * 1e-9 > LONGEST_S
        without = kept.copy()
        without[first : last + 1] = 0
        if long or cost_of(together, without) - cost_of(together, kept) < _GAIN:
            kept = without
    return kept


def _runs(way: Ints) -> list[tuple[int, int]]:
    """First and last index of each stretch of one exchange."""
    edges = np.flatnonzero(np.diff(way)) + 1
    firsts = [0, *edges.tolist()]
    lasts = [*(edges - 1).tolist(), len(way) - 1]
    return [(a, b) for a, b in zip(firsts, lasts, strict=True) if way[a] > 0]


def _put_back(group: list[Sequence], together: Together, way: Ints) -> list[Sequence]:
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
                picture=_picture(group, together, taken, k, keep),
                remarks=(*s.remarks, *_remarks(group, together, way, own, k)),
            )
        )
    return out


def _picture(
    group: list[Sequence], together: Together, taken: Ints, k: int, keep: NDArray[np.bool_]
) -> Picture | None:
    """What a sequence's pictures show, of frames that came from another what that one's show."""
    own, n = group[k].picture, len(together.time_ns)
    if own is None:
        return None
    image, sure = np.full((n, N_JOINTS, 2), np.nan), np.zeros((n, N_JOINTS))
    for i, s in enumerate(group):
        rows = np.searchsorted(together.time_ns, s.time_ns)
        mine = taken[rows, k] == i
        if s.picture is not None:
            image[rows[mine]], sure[rows[mine]] = s.picture.image[mine], s.picture.sure[mine]
    return replace(own, image=image[keep], sure=sure[keep])


def _remarks(
    group: list[Sequence], together: Together, way: Ints, index: Ints, k: int
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
            begin, end = int(together.time_ns[first]), int(together.time_ns[last])
            found.append(Remark(begin, end, text, "exchanged"))
    return found
