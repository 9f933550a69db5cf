"""What a detector makes of a pose: its landmarks' errors as they go with what it sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, PALM, Hand

Array = NDArray[np.float64]

N_PLACES = 3 * N_JOINTS
_KNUCKLES = PALM[2:]
_INDEX, _LITTLE = 5, 17
# beyond so many deviations a place tells no more than there
_WIDEST = 3.0
# with more joints missing a frame stays as it is
_MISSING = 4
_TINY = 1e-9


class Palms(NamedTuple):
    """Frames of palms as detected: what they are does not depend on where a hand is.

    Attributes:
        origin: (T, 3) mean of wrist and finger bases [m].
        axes: (T, 3, 3), columns: wrist to finger bases, towards the thumb's side, out of the
            back; of left hands mirror images.
        size: (T,) mean distance from the wrist to the finger bases [m].
    """

    origin: Array
    axes: Array
    size: Array

    @staticmethod
    def of(joints: Array, hand: Hand) -> Palms:
        """Of (T, 21, 3) joints; NaN where a joint of the palm is missing or there is no palm."""
        wrist, bases = joints[:, 0], joints[:, _KNUCKLES]
        along, across = bases.mean(1) - wrist, joints[:, _INDEX] - joints[:, _LITTLE]
        x = _unit(along)
        y = _unit(across - (across * x).sum(-1, keepdims=True) * x)
        z = np.cross(x, y) * (1.0 if hand == "right" else -1.0)
        size = np.linalg.norm(bases - wrist[:, None], axis=-1).mean(1)
        return Palms((wrist + bases.sum(1)) / 5.0, np.stack([x, y, z], -1), size)

    def places(self, joints: Array) -> Array:
        """(T, 21, 3) of joints in these frames [palm lengths]."""
        about = joints - self.origin[:, None]
        # products of stacks, so that a frame comes out the same whatever is beside it
        return np.asarray(about @ self.axes / self._sizes)

    def steps(self, shifts: Array) -> Array:
        """(T, 21, 3) shifts in these frames [palm lengths], in the world [m]."""
        return np.asarray(shifts @ self.axes.swapaxes(-1, -2) * self._sizes)

    @property
    def _sizes(self) -> Array:
        return self.size[:, None, None]


@dataclass(frozen=True, eq=False)
class Correction:
    """From where a detector sees the joints of a hand to where its landmarks are expected.

    Linear in the places of the 21 joints in the palm's frame, in palm lengths.

    Attributes:
        mean, spread: (21, 3) of the places it was learnt from; deviations.
        shift: (21, 3) of a hand at the mean.
        slope: (63, 63) how shifts (rows) grow with places (columns).
    """

    mean: Array
    spread: Array
    shift: Array
    slope: Array

    def __post_init__(self) -> None:
        for name in ("mean", "spread", "shift", "slope"):
            value = np.array(getattr(self, name), dtype=np.float64)
            shape = (N_PLACES, N_PLACES) if name == "slope" else (N_JOINTS, 3)
            if value.shape != shape:
                raise InputError(f"correction.{name} has shape {value.shape}, expected {shape}")
            if not np.isfinite(value).all() or (name == "spread" and (value < 0).any()):
                raise InputError(f"correction.{name} holds a number that is negative or no number")
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def of(self, joints: Array, hand: Hand) -> Array:
        """(T, 21, 3) joints as detected, corrected [m].

        A joint that is missing counts as at its mean. Frames without a whole palm, or with more
        than four joints missing, stay as they are.
        """
        palms = Palms.of(joints, hand)
        known = np.isfinite(joints).all(-1)
        usable = np.isfinite(palms.axes).all((1, 2)) & (known.sum(1) >= N_JOINTS - _MISSING)
        if not usable.any():
            return joints
        some = Palms(*(x[usable] for x in palms))
        off = np.nan_to_num(some.places(joints[usable]) - self.mean, posinf=0.0, neginf=0.0)
        bound = _WIDEST * self.spread
        off = np.clip(off, -bound, bound).reshape(-1, N_PLACES, 1)
        shifts = self.shift + (self.slope @ off).reshape(-1, N_JOINTS, 3)
        out = joints.copy()
        out[usable] += some.steps(shifts)
        return out


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.asarray(v / np.where(length > _TINY, length, np.nan))
