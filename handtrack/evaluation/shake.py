"""How a hand shakes: as a whole, and its fingers by themselves.

The hand as a whole is the rigid motion of its palm (wrist and knuckles); what its fingers do is
seen from the palm's frame. A shake is what a parabola through 11 frames does not follow: a plain
mean would count the bends of a quick motion as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.evaluation.alignment import procrustes
from handtrack.evaluation.arrays import (
    Array,
    lengths,
    mean_of_frames,
    nan_mean,
    or_none,
    sequence_of_points,
)
from handtrack.evaluation.motion import gaps_between, jitter_within
from handtrack.files.long_arrays import Growing, blocks, by_blocks, rows_of
from handtrack.hand.skeleton import BASES, N_JOINTS, PALM, PARENTS

WINDOW = 11
"""Frames that a parabola is laid through."""
_REACH = 8
"""Frames on either side that a value may depend on."""
_LEAST_PALM = 4
"""Joints of the palm that tell where it is."""
_ROUNDS = 3
_SHAPED = 500
"""Frames that the palm's shape is the mean of."""
_WEIGHTS = (89 - 5 * np.arange(-5.0, 6.0) ** 2) / 429
"""Of the frames, for the parabola's value in their middle."""
_BENT = np.array([b + i for b in BASES for i in range(3)])
"""Bones after which a finger bends, by their place in the list of all but the wrist's."""
_FREE = np.setdiff1d(np.arange(N_JOINTS), PALM)


@dataclass(frozen=True)
class Shake:
    """Root mean squares over frames of what is faster than parabolas through 11 frames.

    NaN where no 11 frames follow one another without a gap.

    Attributes:
        palm_mm: of the palm's middle [mm].
        palm_deg: of the palm's turn, about any axis [degrees].
        fingers_deg: of the 15 bends between bones, as they are seen in the joints [degrees].
        fingers_mm: of the joints of the fingers in the palm's frame [mm].
        palm_jitter_m_s3: mean third derivative of the palm's middle [m/s^3].
        fingers_jitter_m_s3: the same of the fingers' joints in the palm's frame.
    """

    palm_mm: float
    palm_deg: float
    fingers_deg: float
    fingers_mm: float
    palm_jitter_m_s3: float
    fingers_jitter_m_s3: float

    @staticmethod
    def of(values: Mapping[str, Array], prefix: str = "") -> Shake:
        """From what `shake_values` gave, of one sequence or of several after one another."""
        means = {n: float(mean_of_frames(values[f"{prefix}{n}"])) for n in JITTERS}
        squares = {n: _root_mean_square_of_frames(values[f"{prefix}{n}"]) for n in SHAKES}
        return Shake(**squares, **means)

    def to_dict(self) -> dict[str, float | None]:
        """The six numbers; None for NaN."""
        return {name: or_none(getattr(self, name)) for name in self.__dataclass_fields__}


SHAKES = ("palm_mm", "palm_deg", "fingers_deg", "fingers_mm")
JITTERS = ("palm_jitter_m_s3", "fingers_jitter_m_s3")


def shake(joints: ArrayLike, time_ns: ArrayLike) -> Shake:
    """How much a hand shakes as a whole, and how much its fingers do.

    Args:
        joints: (T, 21, 3) [m] in any world frame, NaN = missing.
        time_ns: (T,) increasing stamps [ns]; nothing is taken across a gap.

    Raises:
        InputError: shapes do not fit, or time does not increase.
    """
    return Shake.of(shake_values(joints, time_ns))


def shake_values(
    joints: ArrayLike,
    time_ns: ArrayLike,
    prefix: str = "",
    palm: tuple[Array, Array] | None = None,
) -> dict[str, Array]:
    """The sizes per frame that `Shake` sums up.

    Args:
        joints, time_ns: as in `shake`.
        palm: what `palm_motion` says of the joints, where it is known already.

    Returns:
        `prefix` + a name of `Shake` -> (T,), NaN within 5 frames of an end, of a gap in time
        or of a frame in which the palm is not seen.

    Raises:
        InputError: as `shake`.
    """
    x = sequence_of_points(joints)
    if x.shape[1] != N_JOINTS:
        raise InputError(f"{x.shape[1]} joints, expected 21")
    time = np.asarray(time_ns, dtype=np.int64)
    broken = gaps_between(time, len(x))
    shape = palm_shape(x) if palm is None else None
    out: dict[str, Growing] = {}
    for part in blocks(max(len(x), 1)):
        # with the frames around it that its windows reach
        begin, end = max(part.start - _REACH, 0), min(part.stop + _REACH, len(x))
        some = x[begin:end]
        known = _palm_motion(some, shape) if palm is None else tuple(v[begin:end] for v in palm)
        found = _values(some, time[begin:end], broken[begin : end - 1], *known)
        for name, values in found.items():
            whole = out.setdefault(f"{prefix}{name}", Growing(()))
            # a copy: what a long array keeps of it is not to hold the rest
            whole.append(values[part.start - begin : part.stop - begin].copy())
    return {name: whole.whole() for name, whole in out.items()}


def _values(
    x: Array, time: NDArray[np.int64], broken: NDArray[np.bool_], middle: Array, turns: Array
) -> dict[str, Array]:
    """As `shake_values`, of frames that are looked at together."""
    inside = np.einsum("tji,tkj->tki", turns, x - middle[:, None])  # R^T (x - middle)
    fingers = inside[:, _FREE]
    high = _fast(inside[:, _FREE].reshape(len(x), -1), broken).reshape(fingers.shape)
    return {
        "palm_mm": 1e3 * lengths(_fast(middle, broken)),
        "palm_deg": np.rad2deg(_fast_turn(turns, broken)),
        "fingers_deg": np.rad2deg(_root_mean_square(_fast(bends(x), broken))),
        "fingers_mm": 1e3 * _root_mean_square(lengths(high)),
        "palm_jitter_m_s3": jitter_within(middle[:, None], time, broken),
        "fingers_jitter_m_s3": jitter_within(fingers, time, broken),
    }


def palm_motion(x: Array) -> tuple[Array, Array]:
    """Where the palm is: the rigid motion that its six joints share best.

    Returns:
        (T, 3) its middle in the unit of x, and (T, 3, 3) its turn out of the frame of a palm
        that is the mean of all; NaN where fewer than four of its joints are seen.
    """
    return _palm_motion(x, palm_shape(x))


def palm_shape(x: Array) -> Array | None:
    """(6, 3) the palm that is the mean of all, about its middle; None where none is seen."""
    enough = np.flatnonzero(by_blocks(_enough, x))
    if not enough.size:
        return None
    some = rows_of(x, enough[:: max(1, enough.size // _SHAPED)])[:, PALM]
    shape = some[int(np.argmin(np.isnan(some[..., 0]).sum(1)))]
    shape = shape - nan_mean(shape, 0)
    for _ in range(_ROUNDS):  # joints that the first frame lacks come in with the others' mean
        _, back, move = procrustes(some, np.broadcast_to(shape, some.shape), scale=False)
        shape = nan_mean(np.einsum("tij,tkj->tki", back, some) + move[:, None], 0)
        shape -= nan_mean(shape, 0)
    return np.asarray(shape)


def _enough(x: Array) -> NDArray[np.bool_]:
    """(T,) in which frames enough of the palm is seen."""
    return np.asarray((~np.isnan(x[:, PALM, 0])).sum(1) >= _LEAST_PALM)


def _palm_motion(x: Array, shape: Array | None) -> tuple[Array, Array]:
    if shape is None:
        return np.full((len(x), 3), np.nan), np.full((len(x), 3, 3), np.nan)
    palm, enough = x[:, PALM], _enough(x)
    _, turns, middle = procrustes(np.broadcast_to(shape, palm.shape), palm, scale=False)
    turns[~enough], middle[~enough] = np.nan, np.nan
    return middle, turns


def bends(x: Array) -> Array:
    """(T, 15) angles between the bones that meet at MCP, PIP and DIP of each finger [rad]."""
    bones = x[:, 1:] - x[:, PARENTS[1:]]
    bones /= np.where((size := lengths(bones)) > 0, size, np.nan)[..., None]
    cosine = np.einsum("tij,tij->ti", bones[:, _BENT - 1], bones[:, _BENT])
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _fast(x: Array, broken: NDArray[np.bool_]) -> Array:
    """(T, n) less the parabola through the window about each frame; NaN where that is not whole."""
    return x - followed(x, broken)


def followed(x: Array, broken: NDArray[np.bool_]) -> Array:
    """(T, n) of (T, n) the values in the middle of parabolas through 11 frames; NaN where one of
    these is missing or steps (T-1,) between them are `broken`."""
    out = np.full(x.shape, np.nan)
    if len(x) < WINDOW:
        return out
    half = WINDOW // 2
    # scipy.ndimage does the same, and takes a quarter of a second to be imported
    out[half : len(x) - half] = np.lib.stride_tricks.sliding_window_view(x, WINDOW, 0) @ _WEIGHTS
    cut = np.lib.stride_tricks.sliding_window_view(broken, WINDOW - 1).any(1)
    out[half : len(x) - half][cut] = np.nan
    return out


def _fast_turn(turns: Array, broken: NDArray[np.bool_]) -> Array:
    """(T,) angle between each turn and what those about it say of it [rad].

    The parabola is that of the matrices, and what it gives is no more a turn than their mean
    is: the angle is that of the nearest one, to third order in the turns within a window.
    """
    smooth = followed(turns.reshape(len(turns), 9), broken).reshape(turns.shape)
    apart = np.swapaxes(turns, -1, -2) @ smooth
    axis = np.stack([apart[:, k - 1, k - 2] - apart[:, k - 2, k - 1] for k in range(3)], 1) / 2
    return np.asarray(np.arctan2(lengths(axis), (np.trace(apart, axis1=1, axis2=2) - 1) / 2))


def _root_mean_square_of_frames(values: Array) -> float:
    return float(np.sqrt(mean_of_frames(by_blocks(np.square, values))))


def _root_mean_square(values: Array) -> Array:
    return np.asarray(np.sqrt(nan_mean(values**2)))
