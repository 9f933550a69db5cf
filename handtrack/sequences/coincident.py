"""Joints that a source puts at one place: one of them was not seen."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import by_blocks
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.size import palm_length
from handtrack.sequences.skeleton_check import misfit_without

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
