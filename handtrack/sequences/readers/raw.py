"""What a reader hands over: joints as the file has them, and what the file says of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import Hand
from handtrack.hand.units import Unit
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import UNITS, as_side

if TYPE_CHECKING:
    from handtrack.sequences.readers.companions import Pending
    from handtrack.sequences.readers.mano_params import ManoValues

Array = NDArray[np.float64]


class NotJointsError(InputError):
    """The file is whole, but holds no hand joints: an error alone, skipped in a folder."""


class NoFramesError(InputError):
    """Nothing lies in the frames asked for: an error alone, skipped in a folder."""


@contextmanager
def within(where: str, path: Path) -> Iterator[None]:
    """Put the place inside the file in front of what an InputError says."""
    try:
        yield
    except InputError as error:
        text = str(error).removeprefix(f"{path}: ")
        raise InputError(f"{where}: {text}", path) from None


class Shown(NamedTuple):
    """Where one camera's picture shows joints.

    Attributes:
        points: (T, N, 2) x to the right and y down, in pixels, or as shares of the picture's width
            and height; NaN where a joint is not seen.
        size: (width, height) of the pictures [px], or None where the source does not say.
    """

    points: Array
    size: tuple[int, int] | None = None

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Shown:
        """Those of some frames."""
        return self._replace(points=self.points[rows])


@dataclass
class Raw:
    """One hand over time, in the source's unit and joint order, not yet checked.

    Attributes:
        joints: (T, N, 3) in `unit`; NaN = missing.
        path: where it was read from, for messages.
        name: short name, without the hand.
        hand: the label in the source, or None.
        unit: None where the source does not say.
        order: a name of `skeleton.ORDERS`; None: by the number of joints.
        time_ns: (T,) int64 strictly increasing, of a source that is sure of them (our own
            recordings); None: from `stamps`.
        stamps: times as the source has them, in whatever unit and order, not judged (`clock`
            does that); None: from frame numbers and `fps`.
        frame_index: (T,) int64; None where the source has no frame numbers.
        fps: frames per second, as stated, whatever it is; None where the source does not say.
        confidence: (T, N) or (T,) in 0..1, or None.
        truth: (T, N, 3) like the joints, or None.
        subject: who.
        mano: MANO parameters that the joints are still to be made from, or None.
        pending: what makes joints of a companion file, or brings them elsewhere by it, or None.
        by_number: the source tells its hands apart by numbers, and does not say which is which.
        tagged: the name gets the hand appended even where it is the only one.
        detector: name of the profile whose landmarks the joints are, where the source says.
        picture: whether these are places in a picture: "deep", with a z that says how much nearer
            than the wrist a joint is, in the unit of x, as MediaPipe has it; "flat", without (z is
            0); "": joints in space.
        shown: of one camera's joints in space where its picture shows them, or None.
        notes: for the user, one line each.
    """

    joints: Array
    path: Path
    name: str
    hand: Hand | None = None
    unit: Unit | None = None
    order: str | None = None
    time_ns: NDArray[np.int64] | None = None
    stamps: Stamps | None = None
    frame_index: NDArray[np.int64] | None = None
    fps: float | None = None
    confidence: Array | None = None
    truth: Array | None = None
    subject: str = ""
    mano: ManoValues | None = None
    pending: Pending | None = None
    by_number: bool = False
    tagged: bool = False
    detector: str = ""
    picture: Literal["", "deep", "flat"] = ""
    shown: Shown | None = None
    notes: tuple[str, ...] = ()

    @property
    def says_nothing(self) -> bool:
        """Whether neither a unit nor the source's kind says what the joints' numbers are."""
        known = self.unit, self.order, self.detector or None, self.shown, self.mano, self.pending
        return all(said is None for said in known)


def take_rows(raw: Raw, rows: NDArray[np.int64]) -> Raw:
    """Some of the frames, in that order."""
    return replace(
        raw,
        joints=raw.joints[rows],
        time_ns=None if raw.time_ns is None else raw.time_ns[rows],
        stamps=None if raw.stamps is None else raw.stamps.take(rows),
        frame_index=None if raw.frame_index is None else raw.frame_index[rows],
        confidence=None if raw.confidence is None else raw.confidence[rows],
        truth=None if raw.truth is None else raw.truth[rows],
        shown=None if raw.shown is None else raw.shown.take(rows),
    )


def usable_confidence(values: Array, joints: Array | None = None) -> Array | None:
    """Confidence as it is meant: below 0 is 0 (Aria marks a lost hand with -1), missing ones are
    sure; none at all where all are 0, as MediaPipe writes what it does not know, of the joints
    (..., 3) that are there."""
    known = np.clip(np.nan_to_num(values, nan=1.0), 0, None)
    said = known if joints is None else known[np.isfinite(joints).all(-1)]
    return known if said.any() else None


def as_hand(value: object, path: Path, where: str = "hand") -> Hand:
    """A label such as "Left" as "left".

    Raises:
        InputError: it is neither left nor right.
    """
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    side = as_side(value)
    if side is not None:
        return side
    raise InputError(f"{where} is {str(value)[:40]!r}, expected left or right", path)


def as_unit(value: object, path: Path) -> Unit:
    """A unit's name as one of m, cm, mm, in.

    Raises:
        InputError: it is another one.
    """
    name = str(value).strip()
    unit = UNITS.get(name) or UNITS.get(name.lower())
    if unit is None and name.lower() == "in":  # a word, where others stand beside it
        return "in"
    if unit is not None:
        return unit
    raise InputError(f"unit is {str(value)[:40]!r}, expected m, cm, mm or in", path)


def as_fps(value: object, path: Path) -> float:
    """A frame rate as stated: a number, a fraction ("30000/1001"); the clock judges it.

    Raises:
        InputError: it is not a number.
    """
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    try:
        if isinstance(value, str | int | float | np.number) and not isinstance(value, bool):
            above, _, below = str(value).partition("/")
            return float(above) / float(below or 1)
    except (ValueError, ZeroDivisionError, OverflowError):
        pass
    raise InputError(f"fps is {str(value)[:40]!r}, expected a number", path)


def stem(path: Path) -> str:
    """File name without its suffixes (.tar.gz, .json, ...)."""
    name = path.name
    for suffix in _SUFFIXES:
        name = name.removesuffix(suffix)
    return name or path.name


_SUFFIXES = (
    *(".gz", ".bz2", ".xz", ".zip", ".tgz", ".tar"),
    *(".json", ".jsonl", ".ndjson", ".npz", ".npy", ".csv", ".tsv", ".txt"),
    *(".mcap", ".pkl", ".pickle", ".parquet", ".hdf5", ".h5", ".trc", ".c3d", ".bvh"),
)
