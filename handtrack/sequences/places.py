"""Two hands that a file does not name, in lists whose order changes from frame to frame: MediaPipe
lists the hand that it is surer of first, and the only one first where the other is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handtrack.sequences.readers.raw import Array, Raw

_CLEAR = 0.5
"""So much nearer two hands must be where they are exchanged."""
_JUMP = 0.3
"""Of a hand's size it must jump otherwise, at least."""


def put_in_place(raws: list[Raw]) -> list[Raw]:
    """The same, two hands without names exchanged in the frames in which each is where the other
    was; a note says in how many."""
    if len(raws) != 2 or any(raw.hand is not None or raw.picture for raw in raws):
        return raws
    first, second = raws
    beside = [part for raw in raws for part in (raw.mano, raw.pending, raw.truth, raw.shown)]
    plain = all(part is None for part in beside)
    if not plain or first.joints.ndim != 3 or first.joints.shape != second.joints.shape:
        return raws
    swapped = _swapped(first.joints, second.joints)
    if swapped is None:
        return raws
    one, other = first.confidence, second.confidence
    ours = _exchanged(first.joints, second.joints, swapped)
    out = [replace(raw, joints=joints) for raw, joints in zip(raws, ours, strict=True)]
    if one is not None and other is not None:
        for raw, sure in zip(out, _exchanged(one, other, swapped), strict=True):
            raw.confidence = sure
    note = f"hands without names change places in {int(swapped.sum())} of {len(swapped)} frames:"
    for raw in out:
        raw.notes = (*raw.notes, f"{note} put back by where they were")
    return out


def _exchanged(a: Array, b: Array, swapped: NDArray[np.bool_]) -> tuple[Array, Array]:
    which = swapped.reshape(-1, *(1,) * (a.ndim - 1))
    return np.where(which, b, a), np.where(which, a, b)


def _size(joints: Array) -> float:
    """How far joints (T, N, 3) that are there reach, typically; 0 where none is."""
    there = np.isfinite(joints)
    high = np.max(joints, axis=1, where=there, initial=-np.inf)
    low = np.min(joints, axis=1, where=there, initial=np.inf)
    seen = there.any(1)
    return float(np.median((high - low)[seen])) if seen.any() else 0.0


def _swapped(a: Array, b: Array) -> NDArray[np.bool_] | None:
    """In which frames two hands (T, N, 3) are exchanged; None where in none."""
    with np.errstate(over="ignore", invalid="ignore"):
        size = _size(a)
        if not size > 0 or not _may_be(a, b, size):
            return None
        out = np.zeros(len(a), bool)
        last: list[Array | None] = [None, None]
        for t in range(len(a)):
            now = [one if np.isfinite(one).all(-1).any() else None for one in (a[t], b[t])]
            keep, swap = _cost(now, last), _cost(now, last[::-1])
            jumps = keep > _JUMP * size * sum(one is not None for one in now)
            if last[0] is not None and last[1] is not None and jumps and swap < _CLEAR * keep:
                out[t], now = True, now[::-1]
            last = [new if new is not None else old for new, old in zip(now, last, strict=True)]
    return out if out.any() else None


def _may_be(a: Array, b: Array, size: float) -> bool:
    """Whether a hand ever jumps, or is lost: else nothing is to be looked at frame by frame."""
    for one in (a, b):
        steps = np.linalg.norm(np.diff(one, axis=0), axis=-1)
        if (steps > _JUMP * size).any() or not np.isfinite(one).all(-1).any(-1).all():
            return True
    return False


def _cost(now: list[Array | None], last: list[Array | None]) -> float:
    """How far hands are from where they were, on the mean over joints that both have."""
    total = 0.0
    for one, before in zip(now, last, strict=True):
        if one is None or before is None:
            continue
        off = np.linalg.norm(one - before, axis=-1)
        total += float(off[np.isfinite(off)].mean()) if np.isfinite(off).any() else 0.0
    return total
