"""Left or right, from which way the fingers bend."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError
from handtrack.files.long_arrays import by_blocks, rows_of
from handtrack.hand.skeleton import BASES, N_JOINTS
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.some_frames import some_frames

DECIDED = 0.25
"""|chirality| above this is enough to name the hand where nobody said which it is."""
STRONG = 0.5
"""|chirality| above this contradicts a label."""

# frames and joints that are looked at, and how far from a bound they must be to be believed
_LOOK, _LEAST, _SURE = 1000, 12, 0.1
# a vote's evidence must beat this mean bend (its sine) to count for more than half
_STRAIGHT = 0.05
# little finger to thumb's side of the palm, widest pair first; the first one present is used
_ACROSS = ((17, 5), (17, 9), (13, 5), (13, 9), (9, 5), (17, 13))


def chirality(joints: ArrayLike) -> float:
    """Which hand the joints belong to, from which way the fingers flex.

    Fingers bend towards the palm. Seen along a finger, the axis of the bend at its middle and
    end joints (the cross product of consecutive bones) then points to the thumb's side in a
    right hand and away from it in a left one. Joints vote with the sine of their bend; a
    frame's votes count for as much as they agree, so that straight and noisy fingers decide
    nothing. Li et al. 2021 do not treat this; a hand fitted with the other hand's model is off
    by 15 mm and more.

    Args:
        joints: (T, 21, 3) or (21, 3) in any unit, this project's order; NaN = missing.

    Returns:
        -1..1: positive for a right hand, negative for a left one, near 0 undecided.

    Raises:
        InputError: wrong shape.
    """
    points = np.asarray(joints, dtype=np.float64)
    if points.ndim == 2:
        points = points[None]
    if points.ndim != 3 or points.shape[1:] != (N_JOINTS, 3):
        raise InputError(f"joints have shape {points.shape}, expected (frames, 21, 3)")
    votes = by_blocks(_votes, points)
    evidence = np.nansum(np.abs(votes), axis=1)
    total = evidence.sum()
    return float((evidence * _agreement(votes)).sum() / total) if total > 0 else 0.0


def bending(joints: Array) -> float:
    """The `chirality` of joints (T, 21, 3): of some frames of a long clip where these are sure."""
    some = some_frames(joints, _LOOK, _LEAST)
    if len(some) == _LOOK:
        found = chirality(rows_of(joints, some))
        if all(abs(abs(found) - bound) > _SURE for bound in (0.0, DECIDED, STRONG)):
            return found
    return chirality(joints)


def frame_chirality(joints: Array) -> Array:
    """(T,) the chirality of every single frame of joints (T, 21, 3), as in `chirality`."""
    return _agreement(_votes(joints))


def _agreement(votes: Array) -> Array:
    """(T,) how far the votes (T, 8) of a frame agree, -1..1; few and small ones decide little."""
    evidence = np.nansum(np.abs(votes), axis=1)
    counted = (~np.isnan(votes)).sum(1)
    return np.asarray(np.nansum(votes, axis=1) / (evidence + _STRAIGHT * counted + 1e-300))


def _votes(points: Array) -> Array:
    """(T, 8) sine of the bend at PIP and DIP of four fingers, positive as in a right hand."""
    across = np.full((len(points), 3), np.nan)
    for little, thumb_side in _ACROSS:
        unset = np.isnan(across[:, 0])
        across[unset] = points[unset, thumb_side] - points[unset, little]
    across = _unit(across)
    votes = []
    for base in BASES[1:]:
        bones = _unit(np.diff(points[:, base : base + 4], axis=1))
        axis = np.cross(bones[:, :2], bones[:, 1:])
        votes.append(np.einsum("tji,ti->tj", axis, across))
    return np.concatenate(votes, axis=1)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    out = np.full_like(vectors, np.nan)
    np.divide(vectors, length, out=out, where=length > 0)
    return out
