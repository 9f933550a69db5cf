"""Whether coordinates are places in space: told by what the bones do in them.

Pictures have coordinates too, and arrays do not say which they hold. Bones of a hand in space
keep their lengths whichever way they point and whenever they are seen; in a plane, in pixels or
with a scale that drifts they do not.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import by_blocks, rows_of
from handtrack.hand.skeleton import BONES
from handtrack.sequences.readers.pictures import FIT_IN_2D
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.size import palm_length
from handtrack.sequences.skeleton_check import median
from handtrack.sequences.some_frames import some_frames

_LOOK, _LEAST = 200, 12
"""Frames that are enough to see it, and joints that a frame needs."""
_FEW = 10
"""With fewer frames lengths have not shown whether they are constant."""
_SURE, _CALM, _NOISY = 60, 0.03, 0.08
"""With fewer frames they must show it without noise: a few noisy frames look like anything."""
# least over greatest extent of a hand: of real ones 0.05 in single frames, 0.1 in the median
_FLAT = 0.01
# the wrist's depth is nothing, and its place changes, over the palm's length
_NOTHING, _MOVES = 1e-4, 0.05
# another scale of an axis is believed if lengths change this much, and then so much less
_UNEVEN, _EVENED, _OTHER_SCALE = 0.04, 0.7, 0.85
# a drift is a trend of the logarithm of the scale, and most of its change; a jump is no drift
_DRIFT, _TREND, _JUMP = 0.12, 0.8, 1.1
# detections of one camera breathe by 0.08, and their bones by as much on their own
_BREATHES = 0.12


def world_doubts(joints: Array, path: Path) -> list[str]:
    """What speaks against joints being places in space, one line each.

    Args:
        joints: (T, 21, 3) in one unit of length, NaN = missing.
        path: named in errors.

    Raises:
        InputError: all joints are in one plane in most frames, or the unit changes on the way.
    """
    frames = some_frames(joints, _LOOK, _LEAST)
    if not len(frames):
        return []
    x = rows_of(joints, frames)
    palm = palm_length(x)
    if not palm > 0:
        return []
    x = x / palm
    flat = np.median([_flatness(hand) for hand in x])
    if flat < _FLAT:
        text = "all joints lie in one plane: two-dimensional image coordinates? A hand is fitted to"
        if len(frames) >= 3:
            raise InputError(f"{text} joints in space; {FIT_IN_2D}", path)
        return [f"{text} joints in space"]
    lengths = _Lengths.of(x)
    return [d for d in (_picture(x), _axes(lengths), _scale(lengths, path)) if d]


class _Lengths(NamedTuple):
    """Squares of bones along each axis (F, 20, 3), 0 where missing, and which are there."""

    squares: Array
    there: NDArray[np.bool_]

    @staticmethod
    def of(joints: Array) -> _Lengths:
        parent, child = np.array(BONES).T
        squares = np.square(joints[:, child] - joints[:, parent])
        there = np.isfinite(squares).all(-1) & (squares.sum(-1) > 0)
        # a bone that is nothing everywhere has no length to keep
        return _Lengths(np.where(there[..., None], squares, 0.0), there)

    def change(self, scales: Array) -> float:
        """How much lengths change with other scales (3,) of the squares of the axes."""
        q = np.where(self.there, self.squares @ scales, np.nan)
        off = np.abs(q / median(q, 0) - 1)
        typical = median(off, 0)
        return 0.5 * float(np.sqrt(np.mean(np.square(typical[np.isfinite(typical)]))))


def _flatness(hand: Array) -> float:
    """Least over greatest extent of the joints (21, 3) of a frame."""
    there = hand[np.isfinite(hand).all(-1)]
    extent = np.linalg.svd(there - there.mean(0), compute_uv=False)
    return float(extent[2] / extent[0]) if extent[0] > 0 else 1.0


def _picture(x: Array) -> str | None:
    wrist = x[np.isfinite(x[:, 0]).all(-1), 0]
    if len(wrist) < 3 or np.abs(wrist[:, 2]).max() > _NOTHING:
        return None
    if np.ptp(wrist[:, :2], axis=0).max() < _MOVES:
        return None
    return (
        "the wrist's z is always 0 while x and y change: image coordinates (such as MediaPipe's"
        " normalised landmarks)? Joints in space are needed (its world landmarks)"
    )


def about_the_wrist(joints: Array) -> str | None:
    """What is to be said of joints (T, 21, 3) about the wrist, whose unit nobody states."""
    wrist = by_blocks(lambda part: part[:, 0].copy(), joints)
    there = wrist[np.isfinite(wrist).all(-1)]
    if not len(there) or there.any():
        return None
    return (
        "the wrist is always at 0, 0, 0 and no unit is stated: taken as metres about the wrist"
        " (--unit m, where they are). Landmarks of a picture less the wrist's, as MediaPipe's"
        " scripts write, are no metres: take its world landmarks, or the landmarks as they were"
        " with --image-size WxH and --fov DEGREES"
    )


def _axes(lengths: _Lengths) -> str | None:
    """Whether another scale of one axis keeps lengths far better."""
    if len(lengths.there) < _FEW:
        return None
    scales = np.ones(3)
    before = lengths.change(scales)
    if not before > _UNEVEN:
        return None
    for _ in range(20):
        q = np.where(lengths.there, lengths.squares @ scales, np.nan)
        rows = (lengths.squares / median(q, 0)[:, None])[lengths.there]
        off = rows @ scales - 1
        # strays count little
        trust = 1 / (1 + np.square(off / (1.5 * np.median(np.abs(off)) + 1e-9)))
        found = np.linalg.lstsq(rows * trust[:, None], trust, rcond=None)[0]
        scales = np.maximum(found, 1e-4)
        scales /= scales.mean()
    after = lengths.change(scales)
    relative = np.sqrt(scales / scales.max())
    if after > (_CALM if len(lengths.there) < _SURE else _NOISY):
        return None
    if after > _EVENED * before or relative.min() > _OTHER_SCALE:
        return None
    wrong = ", ".join(f"{a} {r:.2f}" for a, r in zip("xyz", relative, strict=True))
    return (
        f"bones keep their lengths only if the axes are scaled ({wrong}): image coordinates, or"
        " axes in different units?"
    )


def _scale(lengths: _Lengths, path: Path) -> str | None:
    """Whether all bones grow or shrink together on the way.

    Raises:
        InputError: by more than a factor of three.
    """
    squares = lengths.squares.sum(-1)
    logs = np.full(squares.shape, np.nan)
    np.log(squares, out=logs, where=squares > 0)
    logs = (logs - median(logs, 0)) / 2
    scale = median(logs, 1)
    alone = np.abs(logs - scale[:, None])
    scale = scale[np.isfinite(scale)]
    if len(scale) < _FEW:
        return None
    low, high = np.percentile(scale, [2, 98])
    if high - low > _JUMP:
        raise InputError(
            f"the hand is {np.exp(high - low):.3g} times as large in some frames as in others:"
            " does its unit change?",
            path,
        )
    if len(scale) < _SURE and np.median(alone[np.isfinite(alone)]) > _CALM:
        return None
    t = np.linspace(-0.5, 0.5, len(scale))
    slope = float(t @ (scale - scale.mean()) / (t @ t))
    left = scale - scale.mean() - slope * t
    trend = left.var() <= (1 - _TREND) * scale.var()
    if abs(slope) >= _DRIFT and len(scale) >= 2 * _FEW and trend:
        return (
            f"the hand's size drifts by {100 * abs(np.expm1(slope)):.0f} % from the first frame"
            " to the last: its bones are not constant"
        )
    own = np.median(np.abs(scale - np.median(scale)))
    if own > _BREATHES and np.median(alone[np.isfinite(alone)]) < _CALM:
        return (
            f"the hand's size goes up and down by {100 * np.expm1(own):.0f} % and its bones keep"
            " their proportions: is each frame in a scale of its own?"
        )
    return None
