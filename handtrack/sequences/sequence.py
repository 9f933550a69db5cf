"""Sequence: the joints of one hand over time, as everything after the readers sees them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import blocks, by_blocks, rows_of
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.hand.sketch import PALM, html_card
from handtrack.sequences.picture import Picture

if TYPE_CHECKING:
    from handtrack.detectors.profile import Profile


Array = NDArray[np.float64]
RemarkKind = Literal["exchanged", "other"]


@dataclass(frozen=True)
class Remark:
    """What was done to some frames before they became a sequence's.

    Attributes:
        first_ns, last_ns: times of the first and the last frame [ns].
        text: one line.
        kind: what was done: "exchanged" where joints were taken from another sequence's, or
            "other".
    """

    first_ns: int
    last_ns: int
    text: str
    kind: RemarkKind = "other"


@dataclass(frozen=True, eq=False)
class Sequence:
    """Joints of one hand over time; checked when made, trusted after.

    Attributes:
        time_ns: (T,) int64 nanoseconds, strictly increasing.
        joints: (T, 21, 3) [m], in the source's world frame; NaN = missing (a joint with one
            missing coordinate is missing).
        confidence: (T, 21) in 0..1; 0 where the joint is missing. Left out: 1 where present.
        hand: "left" or "right".
        frame_index: (T,) int64 frame numbers as in the source. Left out: 0..T-1.
        truth: (T, 21, 3) [m] true joints where they are known, or None.
        name: short name for tables and topics.
        source: where it was read from.
        subject: who, where the source says so.
        notes: what the reader wants the user to know, one line each.
        remarks: what was done to single frames, in order of time.
        timed: whether the source says how fast time goes; else a rate was assumed.
        numbered: whether `frame_index` is the source's; else frames were counted.
        detector: name of the profile (`handtrack.detectors`) whose landmarks the joints are, where
            the reader knows; else "".
        picture: what the one camera that saw them shows of the joints, where that is known.
        cameras: of joints that were fitted to the pictures of cameras what recordings say of that:
            how many `views`, `reprojection_px`, the `lens` where it is not calibrated.

    Raises:
        InputError: wrong shapes, no frames, no joint at all, infinite values, confidence
            outside 0..1, or time that does not increase (with the frame and both stamps).
    """

    time_ns: NDArray[np.int64]
    joints: Array
    confidence: Array = field(default=None)  # type: ignore[arg-type]
    hand: Hand = "right"
    frame_index: NDArray[np.int64] = field(default=None)  # type: ignore[arg-type]
    truth: Array | None = None
    name: str = "sequence"
    source: str = ""
    subject: str = ""
    notes: tuple[str, ...] = ()
    remarks: tuple[Remark, ...] = ()
    timed: bool = True
    numbered: bool = True
    detector: str = ""
    picture: Picture | None = None
    cameras: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        where = self.source or None
        joints = self.joints if _is_own(self.joints) else _joints(self.joints, where)
        n = len(joints)
        time_ns = np.array(self.time_ns, dtype=np.int64)
        if time_ns.shape != (n,):
            raise InputError(f"{time_ns.shape} time stamps for {n} frames", where)
        back = np.flatnonzero(np.diff(time_ns) <= 0)
        if back.size:
            i = int(back[0])
            raise InputError(
                f"time does not increase: frame {i} is at {time_ns[i] * 1e-9:.6f} s,"
                f" frame {i + 1} at {time_ns[i + 1] * 1e-9:.6f} s",
                where,
            )
        confidence: Array = self.confidence
        if not (_is_own(confidence) and joints is self.joints):
            confidence = _confidence(self.confidence, joints, where)
        index: NDArray[np.int64] | None = self.frame_index
        frame_index = np.array(np.arange(n) if index is None else index, dtype=np.int64)
        if frame_index.shape != (n,):
            raise InputError(f"{frame_index.shape} frame numbers for {n} frames", where)
        truth = self.truth
        if truth is not None and not _is_own(truth):
            truth = by_blocks(_copy, np.asarray(truth))
        if truth is not None and truth.shape != joints.shape:
            raise InputError(
                f"truth has shape {truth.shape}, expected {joints.shape} like the joints", where
            )
        if self.picture is not None and len(self.picture) != n:
            raise InputError(f"{len(self.picture)} pictures for {n} frames", where)
        if self.hand not in HANDS:
            raise InputError(f"hand is {self.hand!r}, expected left or right", where)
        for name, value in (
            ("joints", joints),
            ("time_ns", time_ns),
            ("confidence", confidence),
            ("frame_index", frame_index),
            ("truth", truth),
        ):
            if value is not None:
                value.flags.writeable = False
                _own[id(value)] = value
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def fps(self) -> float:
        """Median frame rate [1/s]; NaN for a single frame."""
        if len(self) < 2:
            return float("nan")
        return float(1e9 / np.median(np.diff(self.time_ns)))

    @property
    def present(self) -> NDArray[np.bool_]:
        """(T, 21) whether each joint was observed."""
        return ~np.isnan(self.joints[..., 0])

    def frames(self, start: int, stop: int) -> Sequence:
        """The part whose source frame numbers lie in start..stop, both included.

        Raises:
            InputError: no frame lies there.
        """
        keep = (self.frame_index >= start) & (self.frame_index <= stop)
        if not keep.any():
            raise InputError(
                f"no frame in {start}:{stop}, the sequence has"
                f" {self.frame_index[0]}:{self.frame_index[-1]}",
                self.source or None,
            )
        return self.at(keep)

    def between(self, start_s: float | None = None, end_s: float | None = None) -> Sequence:
        """The part from one time to another, both included [s from the first frame].

        Raises:
            InputError: no frame lies there.
        """
        return self.at(frames_between(self.time_ns, start_s, end_s))

    def corrected(self, profile: Profile | None) -> Sequence:
        """The sequence with its joints as the detector's profile corrects them."""
        if profile is None or profile.correction is None:
            return self
        joints = by_blocks(lambda part: profile.corrected(part, self.hand), self.joints)
        return replace(self, joints=joints)

    def at(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> Sequence:
        """Some of the frames, as a mask or by their places, increasing.

        Raises:
            InputError: they have no joint.
        """
        at = np.arange(len(self))[keep]
        return replace(
            self,
            time_ns=self.time_ns[at],
            joints=rows_of(self.joints, at),
            confidence=rows_of(self.confidence, at),
            frame_index=self.frame_index[at],
            truth=None if self.truth is None else rows_of(self.truth, at),
            picture=None if self.picture is None else self.picture.at(at),
        )

    def __repr__(self) -> str:
        seconds = (self.time_ns[-1] - self.time_ns[0]) * 1e-9
        missing = 100.0 * (1.0 - self.present.mean())
        truth = "" if self.truth is None else ", with truth"
        return (
            f"<Sequence {self.name!r}, {self.hand} hand, {len(self):,} frames in {seconds:.2f} s,"
            f" {missing:.1f} % of the joints missing{truth}>"
        )

    def _repr_html_(self) -> str:
        rows = {
            "hand": self.hand,
            "frames": f"{len(self):,}" + (f", {self.fps:.4g} a second" if len(self) > 1 else ""),
            "missing": f"{100.0 * (1.0 - self.present.mean()):.1f} % of the joints",
            "truth": "yes" if self.truth is not None else "no",
            "detector": self.detector or "not known",
            "source": self.source,
        }
        whole = np.flatnonzero(self.present[:, list(PALM)].all(axis=1))
        joints = self.joints[whole[len(whole) // 2]] if len(whole) else None
        return html_card(self.name, rows, joints, self.hand)


def frames_between(
    time_ns: NDArray[np.int64], start_s: float | None, end_s: float | None
) -> NDArray[np.bool_]:
    """(T,) which frames lie from one time to another, both included [s from the first frame].

    Raises:
        InputError: none, or a time is not a number.
    """
    for given in (start_s, end_s):
        if given is not None and not isinstance(given, int | float | np.integer | np.floating):
            raise InputError(f"{given!r} is no time: expected seconds from the first frame")
    seconds = (time_ns - time_ns[:1]) * 1e-9
    keep = seconds >= (-np.inf if start_s is None else start_s)
    keep &= seconds <= (np.inf if end_s is None else end_s)
    if not keep.any():
        last = seconds[-1] if len(seconds) else 0.0
        raise InputError(f"no frame from {start_s} to {end_s} s, there are 0 to {last:.3f} s")
    return np.asarray(keep)


_own: WeakValueDictionary[int, NDArray[Any]] = WeakValueDictionary()
"""Arrays of sequences: nobody can write to them, so they need not be copied and checked again."""


def _is_own(array: NDArray[Any] | None) -> bool:
    return array is not None and _own.get(id(array)) is array


def _copy(values: NDArray[Any]) -> Array:
    return np.array(values, dtype=np.float64, order="C")


def _joints(given: Array, where: str | None) -> Array:
    """A copy of joints, those with a coordinate missing missing as a whole.

    Raises:
        InputError: as `Sequence`.
    """
    values = np.asarray(given)
    if values.ndim != 3 or values.shape[1:] != (N_JOINTS, 3):
        raise InputError(f"joints have shape {values.shape}, expected (frames, 21, 3)", where)
    if not len(values):
        raise InputError("no frames", where)
    for part in blocks(len(values)):
        infinite = np.isinf(values[part].astype(np.float64, copy=False))
        if infinite.any():
            t = part.start + int(np.argwhere(infinite)[0, 0])
            raise InputError(f"frame {t}: a joint is infinite, expected metres or NaN", where)

    def clear(part: NDArray[Any]) -> Array:
        joints = _copy(part)
        gone = np.isnan(joints)
        if gone.any():
            joints[gone[..., 0] | gone[..., 1] | gone[..., 2]] = np.nan
        return joints

    joints = by_blocks(clear, values)
    if all(np.isnan(joints[part, :, 0]).all() for part in blocks(len(joints))):
        raise InputError("every joint is missing in every frame", where)
    return joints


def _confidence(given: Array | None, joints: Array, where: str | None) -> Array:
    """A copy of confidences, 1 by default, 0 of what is missing.

    Raises:
        InputError: as `Sequence`.
    """
    n = len(joints)
    values = np.broadcast_to(1.0, (n, N_JOINTS)) if given is None else np.asarray(given)
    if values.shape != (n, N_JOINTS):
        raise InputError(f"confidence has shape {values.shape}, expected ({n}, 21)", where)

    def clear(part: NDArray[Any], of: Array) -> Array:
        confidence = _copy(part)
        confidence[np.isnan(of[..., 0])] = 0.0
        if not ((confidence >= 0) & (confidence <= 1)).all():
            raise InputError("confidence must lie in 0..1", where)
        return confidence

    return by_blocks(clear, values, joints)


def unique_names(sequences: list[Sequence]) -> list[Sequence]:
    """The same, with the folder's name in front of names that several have, or else a number."""
    count = Counter(s.name for s in sequences)
    named = [
        replace(s, name=f"{Path(s.source).resolve().parent.name} {s.name}")
        if count[s.name] > 1
        else s
        for s in sequences
    ]
    count = Counter(s.name for s in named)
    number: Counter[str] = Counter()
    for i, sequence in enumerate(named):
        if count[sequence.name] > 1:
            number[sequence.name] += 1
            named[i] = replace(sequence, name=f"{sequence.name} {number[sequence.name]}")
    return named
