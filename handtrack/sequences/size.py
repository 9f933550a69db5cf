"""How large a hand is, and whether a unit makes sense of it."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.files.long_arrays import by_blocks, rows_of
from handtrack.hand.skeleton import BASES, PARENTS
from handtrack.hand.units import METRES, METRIC, Unit
from handtrack.sequences.note import Note
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.some_frames import some_frames

PLAUSIBLE_PALM = (0.03, 0.2)
"""[m] Outside of it the unit is taken to be wrong; units are factors of ten apart, so that at
most one of them fits. Real palms (wrist to knuckles) are 0.05 (a child's) to 0.11; wide enough
for sources whose scale is only approximate."""
USUAL_PALM = (0.05, 0.14)
"""[m] Outside of it the user is told."""

# [mm] bone to joints 1..20 of an adult (Buryanov and Kotiuk 2010, rounded): only a yardstick
_ADULT = np.array(
    [42, 40, 32, 24, 93, 40, 23, 19, 90, 45, 26, 21, 86, 41, 26, 21, 82, 33, 18, 19], float
)
_ADULT_PALM = 0.088
_LOOK = 1000
_OTHER_UNIT = 50
"""What is so many times another hand is in another unit, and not badly measured."""


def palm_length(joints: Array) -> float:
    """Median over frames of the mean distance from the wrist to the four finger bases.

    Of a long clip some frames are looked at, evenly spread; all where these have no palm. Where
    the wrist is never there, an adult's palm scaled by the bones that are.

    Args:
        joints: (T, 21, 3), NaN = missing.

    Returns:
        In the joints' unit; NaN if no bone is ever complete.
    """
    with warnings.catch_warnings(), np.errstate(over="ignore", invalid="ignore"):
        # what is no place is refused later; means of nothing are NaN, as meant
        warnings.simplefilter("ignore", RuntimeWarning)
        some = rows_of(joints, some_frames(joints, _LOOK, 2))
        palm = float(np.nanmedian(_palms(some)))
        if np.isnan(palm) and len(some) == _LOOK:
            palm = float(np.nanmedian(by_blocks(_palms, joints)))
        if np.isnan(palm):
            joints = some
            bones = np.linalg.norm(joints[:, 1:] - joints[:, PARENTS[1:]], axis=-1)
            palm = float(np.nanmedian(np.nanmedian(bones, axis=0) / _ADULT)) * 1e3 * _ADULT_PALM
    return palm


def _palms(joints: Array) -> Array:
    """(T,) mean distance from the wrist to the finger bases."""
    lengths = np.linalg.norm(joints[:, BASES[1:]] - joints[:, :1], axis=-1)
    return np.asarray(np.nanmean(lengths, axis=1))


class WrongUnit(InputError):
    """A hand has no hand's size.

    Attributes:
        palm: its length, taken for `unit` [m].
        fits: the unit in which it would have one; None where none of them.
    """

    def __init__(self, palm: float, unit: Unit, path: str | Path | None = None):
        of_one = palm / METRES[unit]
        fitting = (u for u, metres in METRIC.items() if is_plausible(of_one * metres))
        self.palm, self.unit, self.fits = palm, unit, next(fitting, None)
        advice = (
            f"--unit {self.fits} would fit"
            if self.fits
            else "none of m, cm, mm would fit (are these 3D positions in one unit of length?)"
        )
        super().__init__(absurd(palm, f" with unit {unit}", f"; {advice}"), path)

    def __reduce__(self) -> tuple[type[WrongUnit], tuple[float, Unit, Path | None]]:
        return type(self), (self.palm, self.unit, self.path)


def check_sizes(hands: list[Array], units: list[Unit], path: Path) -> list[str | None]:
    """Check that the hands of one source, in metres if its unit was right, have a hand's size.

    Where one of them has, the unit is right, and another that has not was badly measured.

    Args:
        hands: (T, 21, 3) [m] each.
        units: the unit that was taken for each, for messages.
        path: named in errors.

    Returns:
        For each hand a note where it is unusually small or large, else None.

    Raises:
        WrongUnit: all that can be measured are absurdly large or small.
        InputError: one is in another unit.
    """
    palms = [palm_length(joints) for joints in hands]
    wrong = [is_absurd(palm) for palm in palms]
    if any(wrong) and not any(map(is_plausible, palms)):
        worst = wrong.index(True)
        raise WrongUnit(palms[worst], units[worst], path)
    known = [palm for palm in palms if is_plausible(palm)]
    for palm, unit in zip(palms, units, strict=True):
        if known and is_absurd(palm) and not 1 / _OTHER_UNIT < palm / known[0] < _OTHER_UNIT:
            other = WrongUnit(palm, unit).fits
            if other is not None:
                raise InputError(
                    f"one hand is {palm:.3g} m from wrist to knuckles, another {known[0]:.3g} m"
                    f" with unit {unit}: the first would be in {other}; write both in one unit",
                    path,
                )
    notes: list[str | None] = []
    for palm in palms:
        usual = np.isnan(palm) or USUAL_PALM[0] <= palm <= USUAL_PALM[1]
        doubt = (
            f"the palm is {palm * 1e3:.0f} mm long, an adult's is 75 to 110: is the scale right?"
        )
        notes.append(None if usual else Note(doubt, "unit"))
    return notes


def is_plausible(palm: float) -> bool:
    """Whether a palm of that length [m] can be; not where none was measured (NaN)."""
    low, high = PLAUSIBLE_PALM
    return low <= palm <= high


def is_absurd(palm: float) -> bool:
    """Whether a palm was measured and cannot be."""
    return not (np.isnan(palm) or is_plausible(palm))


def fitting_unit(joints: Array, inches: bool = False) -> Unit | None:
    """The unit in which a hand has a hand's size; None where none of them.

    Args:
        joints: (T, 21, 3) of it.
        inches: they may be, where a hand of usual size is that in no other unit.
    """
    palm = palm_length(joints)
    low, high = USUAL_PALM
    usual = [unit for unit, metres in METRES.items() if low <= palm * metres <= high]
    if inches and usual == ["in"]:
        return "in"
    return next((unit for unit, metres in METRIC.items() if is_plausible(palm * metres)), None)


def absurd(palm: float, taken: str, advice: str) -> str:
    """What is said of it: how long it would be, taken for what, and what to do."""
    return f"the hand would be {palm:.3g} m from wrist to knuckles{taken}{advice}"
