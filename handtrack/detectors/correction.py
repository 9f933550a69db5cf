"""What a detector makes of a pose: its landmarks' errors as they go with what it sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import BASES, N_JOINTS, PALM, Hand

Array = NDArray[np.float64]

N_PLACES = 3 * N_JOINTS
N_FINGERS = len(BASES)
_JOINTS = N_JOINTS // N_FINGERS
# numbers that say which way a finger's bones point: each coordinate, and their products by twos
_COORDINATES = 3 * _JOINTS
N_BENDS = _COORDINATES + _COORDINATES * (_COORDINATES + 1) // 2
N_OWN = 3 * _JOINTS
_TWO = np.triu_indices(_COORDINATES)
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


def bends(places: Array) -> Array:
    """(T, 5, 90) which way the bones of fingers point, by (T, 21, 3) places in palms' frames.

    Of each finger the coordinates of its four bones' directions, from the wrist on, and their
    products by twos; NaN where a joint of the finger is missing.
    """
    n = len(places)
    chain = np.empty((n, N_FINGERS, _JOINTS + 1, 3))
    chain[:, :, 0] = places[:, None, 0]
    chain[:, :, 1:] = places[:, 1:].reshape(n, N_FINGERS, _JOINTS, 3)
    pointing = _unit(np.diff(chain, axis=2)).reshape(n, N_FINGERS, _COORDINATES)
    products = pointing[..., _TWO[0]] * pointing[..., _TWO[1]]
    return np.concatenate([pointing, products], -1)


@dataclass(frozen=True, eq=False)
class Bends:
    """How a finger's errors go with the way its own bones point (`bends`).

    Attributes:
        mean, spread: (5, 90) of what it was learnt from; deviations.
        slope: (5, 12, 90) how the shifts of a finger's joints (rows) grow with it (columns).
    """

    mean: Array
    spread: Array
    slope: Array

    def __post_init__(self) -> None:
        by_finger = (N_FINGERS, N_BENDS)
        slope = (N_FINGERS, N_OWN, N_BENDS)
        _settle(self, "finger", {"mean": by_finger, "spread": by_finger, "slope": slope})

    def of(self, places: Array) -> Array:
        """(T, 21, 3) shifts [palm lengths] by places."""
        off = _within(bends(places) - self.mean, self.spread)
        shifts = np.zeros((len(places), N_JOINTS, 3))
        shifts[:, 1:] = (self.slope @ off[..., None]).reshape(-1, N_JOINTS - 1, 3)
        return shifts


@dataclass(frozen=True, eq=False)
class Correction:
    """From where a detector sees the joints of a hand to where its landmarks are expected.

    Linear in the places of the 21 joints in the palm's frame, in palm lengths, and in what the
    bones of the joint's own finger do.

    Attributes:
        mean, spread: (21, 3) of the places it was learnt from; deviations.
        shift: (21, 3) of a hand at the mean.
        slope: (63, 63) how shifts (rows) grow with places (columns).
        finger: how they go with the bends of the own finger; None where that is not known.
    """

    mean: Array
    spread: Array
    shift: Array
    slope: Array
    finger: Bends | None = None

    def __post_init__(self) -> None:
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(
            ("mean", "spread", "shift"), (N_JOINTS, 3)
        )
        _settle(self, "", {**shapes, "slope": (N_PLACES, N_PLACES)})

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
        places = some.places(joints[usable])
        off = _within(places - self.mean, self.spread).reshape(-1, N_PLACES, 1)
        shifts = self.shift + (self.slope @ off).reshape(-1, N_JOINTS, 3)
        if self.finger is not None:
            shifts += self.finger.of(places)
        out = joints.copy()
        out[usable] += some.steps(shifts)
        return out


def _settle(of: Correction | Bends, part: str, shapes: dict[str, tuple[int, ...]]) -> None:
    """Arrays of those shapes, not to be written to.

    Raises:
        InputError: a shape is another, or a number none.
    """
    for field, shape in shapes.items():
        value = np.array(getattr(of, field), dtype=np.float64)
        name = ".".join(["correction", *([part] if part else []), field])
        if value.shape != shape:
            raise InputError(f"{name} has shape {value.shape}, expected {shape}")
        if not np.isfinite(value).all() or (field == "spread" and (value < 0).any()):
            raise InputError(f"{name} holds a number that is negative or no number")
        value.flags.writeable = False
        object.__setattr__(of, field, value)


def _within(off: Array, spread: Array) -> Array:
    """What is off its mean, within bounds; 0 where it is not known."""
    bound = _WIDEST * spread
    return np.clip(np.nan_to_num(off, posinf=0.0, neginf=0.0), -bound, bound)


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.asarray(v / np.where(length > _TINY, length, np.nan))
