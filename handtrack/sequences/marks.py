"""Joints that were not seen though something stands for them: marks that sources write in their
place, and joints that are where another is."""

from __future__ import annotations

import math
from collections.abc import Sequence as Items
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import blocks, by_blocks, evenly
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.size import palm_length
from handtrack.sequences.skeleton_check import misfit_without

Mask = NDArray[np.bool_]

# a place is far from a hand where it is so many radii of the hand from its middle
_FAR = 3.0
# so many values and frames are looked at
_VALUES, _LOOK = 100, 200


def marked(arrays: Items[Array]) -> tuple[list[Mask], str]:
    """Which joints of a source are marks instead of places.

    A mark has one value in all three coordinates: 0, -1, infinity, or another that comes again
    or is far from the hand. The whole source is judged at once: what is a mark in one array is
    one in all. One joint that is at 0, 0, 0 in every frame, amid the others, is no mark: joints
    may be given relative to it.

    Args:
        arrays: (T, N, 3) each, joints and truths of all hands, in the source's unit, before
            anything is done to them.

    Returns:
        (T, N) of each array, and the marks that were found, for messages; "" if none.
    """
    even = [by_blocks(_even, x) for x in arrays]
    if not any(e.any() for e in even):
        return even, ""
    nowhere = [
        by_blocks(lambda x, e: e & np.isinf(x[..., 0]), x, e)
        for x, e in zip(arrays, even, strict=True)
    ]
    masks = [m.copy() for m in nowhere]
    found = ["infinity"] if any(m.any() for m in masks) else []
    for value in _values(arrays, even):
        at = [e & (x[..., 0] == value) for x, e in zip(arrays, even, strict=True)]
        if value == -1 or _is_mark(arrays, at):
            masks = [m | a for m, a in zip(masks, at, strict=True)]
            found.append(", ".join([f"{value:g}"] * 3))
    zeros = [_zeros(x, m) for x, m in zip(arrays, masks, strict=True)]
    if any(z.any() for z in zeros):
        found.insert(0, "0, 0, 0")
    return [m | z for m, z in zip(masks, zeros, strict=True)], " or ".join(found[:4])


def _even(x: Array) -> Mask:
    return np.asarray((x[..., 0] == x[..., 1]) & (x[..., 1] == x[..., 2]))


def _values(arrays: Items[Array], even: Items[Mask]) -> list[float]:
    """The values but 0 that are in all three coordinates of a joint, the most frequent ones."""
    found = [
        x[part, :, 0][e[part] & np.isfinite(x[part, :, 0])]
        for x, e in zip(arrays, even, strict=True)
        for part in blocks(len(x))
    ]
    values, counts = np.unique(np.concatenate([*found, np.zeros(0)]), return_counts=True)
    often = values[np.argsort(-counts, kind="stable")][:_VALUES]
    return [float(v) for v in often if v != 0]


def _is_mark(arrays: Items[Array], at: Items[Mask]) -> bool:
    """Whether places (T, N) of one value are a mark: far from the hand, or again and again."""
    count = sum(int(a.sum()) for a in at)
    far = sum(int(_apart(x, a).sum()) for x, a in zip(arrays, at, strict=True))
    # whole numbers are equal by chance
    whole = all((x[np.isfinite(x)] % 1 == 0).all() for x in arrays)
    return 2 * far > min(count, _LOOK) or (count > 1 and not whole)


def _apart(joints: Array, at: Mask) -> Mask:
    """Of joints at one place those that are far from the frame's other joints."""
    out = np.zeros_like(at)
    for t in np.flatnonzero(at.any(1))[:_LOOK]:
        others = joints[t][~at[t] & np.isfinite(joints[t]).all(-1)]
        out[t] = at[t] & (_radii(others, joints[t][at[t]][0]) > _FAR)
    return out


def _radii(hand: Array, place: Array) -> float:
    """How many of its radii a place is from a hand's middle; infinite where there is no hand."""
    if len(hand) < 2 or max(np.abs(hand).max(), np.abs(place).max()) > 1e100:
        return float("inf")
    middle = np.median(hand, axis=0)
    radius = float(np.linalg.norm(hand - middle, axis=-1).max())
    return float(np.linalg.norm(place - middle)) / radius if radius > 0 else float("inf")


def _of_all_axes(said: Mask) -> Mask:
    """(..., N) what is so in all three coordinates (..., N, 3)."""
    return np.asarray(said[..., 0] & said[..., 1] & said[..., 2])


def _zeros(joints: Array, missing: Mask) -> Mask:
    """(T, N) which joints at 0, 0, 0 are marks."""
    at: Mask = by_blocks(lambda part: _of_all_axes(part == 0), joints)
    if not at.any():
        return at
    there = by_blocks(lambda part: _of_all_axes(np.isfinite(part)), joints) & ~missing
    some = (there & ~at).any(1)
    always = np.flatnonzero((at | ~there)[some].all(0) & at[some].any(0))
    if not len(always) or not some.any():
        return at
    frames = np.flatnonzero(some)
    frames = evenly(frames, _LOOK)
    distances = [_radii(joints[t][there[t] & ~at[t]], np.zeros(3)) for t in frames]
    if not np.median(distances) <= _FAR:
        return at
    # of many the wrist, which is first or last, is what the others are given relative to; of two
    # at one place the hand they make tells which is there
    n = joints.shape[1]
    roots = always if len(always) < 3 else [next(j for j in (0, n - 1, *always) if j in always)]
    amid: Mask = at.copy()
    for root in roots:
        amid[some, root] = False
    return amid


_AXIS = np.array([1.0, math.pi, math.e]) / np.linalg.norm([1.0, math.pi, math.e])
_DIRECTIONS = (_AXIS, np.roll(_AXIS, 1), np.roll(_AXIS, 2))
# joints are at one place if this near, over the palm's length
_NEAR = 1e-3
# with so many others at its place none is to be believed
_MOST = 2
# a misfit that is lower by less says nothing
_CLEARLY = 0.01


def without_coincident(joints: Array) -> tuple[Array, list[str]]:
    """Joints (T, 21, 3) without those that are where another is, and what was done.

    A thumb's metacarpal of no length, a tip repeated from the joint before, a frame with all
    joints at one point: two joints of a hand are never at one place. Of a pair that is so in
    most frames the one is kept that makes a hand with the others, else the one nearer to the
    wrist; of more none.
    """
    near = _NEAR * palm_length(joints)
    if not near > 0:
        near = 0.0

    # only frames in which two may be near, seen from three sides, are looked at closely
    def may_be_near(part: Array) -> NDArray[np.bool_]:
        left = np.arange(len(part))
        for direction in _DIRECTIONS:
            with np.errstate(invalid="ignore"):
                line = np.sort((part if len(left) == len(part) else part[left]) @ direction, axis=1)
                left = left[(line[:, 1:] - line[:, :-1] <= near).any(1)]
        found = np.zeros(len(part), np.bool_)
        found[left] = True
        return found

    frames = np.flatnonzero(by_blocks(may_be_near, joints))
    if not len(frames):
        return joints, []
    x = by_blocks(lambda some: joints[some], frames)
    same = np.zeros((len(x), N_JOINTS, N_JOINTS), dtype=bool)
    for a, b in combinations(range(N_JOINTS), 2):
        apart = np.linalg.norm(x[:, a] - x[:, b], axis=-1)
        same[:, a, b] = same[:, b, a] = apart <= near
    if not same.any():
        return joints, []
    out, notes = joints.copy(), []
    crowd = same.sum(2) >= _MOST
    out[frames[:, None], np.arange(N_JOINTS)] = np.where(crowd[..., None], np.nan, x)
    if crowd.any():
        notes.append(f"{crowd.sum()} joints at the place of others were taken as missing")
    same &= ~crowd[:, :, None] & ~crowd[:, None, :]
    there = np.isfinite(joints).all(-1).sum(0)
    for a, b in combinations(range(N_JOINTS), 2):
        pair = same[:, a, b].copy()
        if not pair.any():
            continue
        gone = b
        often = 2 * pair.sum() > max(there[a], there[b])
        if often and misfit_without(out, a) < misfit_without(out, b) - _CLEARLY:
            gone = a
        out[frames[pair], gone] = np.nan
        same[pair, gone, :] = same[pair, :, gone] = False
        notes.append(
            f"{JOINT_NAMES[a]} and {JOINT_NAMES[b]} are at one place in {pair.sum()} frames:"
            f" {JOINT_NAMES[gone]} was taken as missing there"
        )
    return out, notes
