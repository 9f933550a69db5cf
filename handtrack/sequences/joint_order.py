"""In which order a source's joints are: what the caller says, the source, or the bones."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from handtrack.errors import InputError, SettingsError
from handtrack.files.long_arrays import rows_of
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS, ORDER_JOINTS, ORDERS
from handtrack.sequences.note import Note
from handtrack.sequences.readers.raw import Array, Raw
from handtrack.sequences.skeleton_check import (
    Picks,
    best_order,
    better_order,
    beyond_chance,
    clearly_better,
    folded_back,
    misfit,
)
from handtrack.sequences.some_frames import some_frames

BY_COUNT = {21: "handtrack", 25: "webxr", 26: "openxr", 27: "arkit"}
"""What joints are taken for where nobody says, by their number."""
AXIS_MAJOR = "axis-major"
"""The order of files with all x first, then all y, then all z; joints as in "handtrack"."""

# no hand: no better than chance by so many standard deviations, and this far off a hand
_CHANCE, _NO_HAND = 2.5, 1.65
_HOPELESS, _ABSURD = 1.5, 1.8
# so few frames may be a strange pose
_FEW = 3
# frames that are looked at, and the joints that those have which say something
_LOOK, _LEAST = 500, 12


class Reading(NamedTuple):
    """How a source's joints are read.

    Attributes:
        picks: our joint i is the source's picks[i], -1 where it has none.
        name: of the order, for messages.
        stated: the caller or the source says so.
        notes: for the user, one line each.
    """

    picks: Picks
    name: str
    stated: bool
    notes: tuple[str, ...] = ()


class OtherOrder(InputError):
    """Joints are clearly in another order than was taken.

    Attributes:
        order: the one that they are in, as `load` takes it.
    """

    def __init__(self, message: str, order: str, path: str | Path | None = None):
        super().__init__(message, path)
        self.order = order

    def __reduce__(self) -> tuple[type[OtherOrder], tuple[str, str], dict[str, object]]:
        return type(self), (str(self), self.order), {"path": self.path}


def check_order(order: str | None) -> None:
    """Refuse what is no order.

    Raises:
        SettingsError: neither a name nor 21 places, with the names that are known.
    """
    if order is None or order in ORDERS or order == AXIS_MAJOR:
        return
    if _places(order) is None:
        known = ", ".join((*ORDERS, AXIS_MAJOR))
        raise SettingsError(
            f"unknown joint order {order!r}, expected one of {known}, or the places of our 21"
            " joints in the source, as in 0,1,2,...,20 (-1: it has none)"
        )


def read_order(raw: Raw, order: str | None, judge: bool = True) -> Reading:
    """The order of a source's joints, checked against what a hand can be.

    Args:
        raw: the source, with NaN where joints are missing.
        order: what the caller says: a name, or places; None: as the source says.
        judge: check it.

    Raises:
        InputError: an order that is unknown or of another number of joints; joints that clearly
            are in another order than was taken without anyone saying so; joints that are no
            hand's in any order.
    """
    given = _given(raw, order or raw.order)
    reading = given or _by_count(raw)
    if not judge:
        return reading
    return reading._replace(notes=(*reading.notes, *_doubts(raw, reading, order)))


def stated_order(raw: Raw, order: str | None) -> Picks:
    """The order that is said, or goes with the number of joints, not checked against a hand: of
    places in a picture bones say little.

    Raises:
        InputError: an order that is unknown or of another number of joints.
    """
    given = _given(raw, order or raw.order)
    if given is not None:
        return given.picks
    name = BY_COUNT.get(raw.joints.shape[1])
    if name is None:
        n = raw.joints.shape[1]
        raise InputError(f"a frame has {n} joints{with_as_many(n)}", raw.path)
    return ORDERS[name]


def ordered_by_axis(joints: Array) -> Array:
    """Joints (T, N, 3) from frames that hold all x first, then all y, then all z."""
    return np.ascontiguousarray(joints.reshape(len(joints), 3, -1).transpose(0, 2, 1))


def _places(order: str) -> Picks | None:
    """The places of our joints as text, or None if it is none."""
    try:
        picks = tuple(int(part) for part in order.split(",", N_JOINTS))
    except ValueError:
        return None
    known = [p for p in picks if p >= 0]
    right = len(picks) == N_JOINTS and min(picks) >= -1 and len(set(known)) == len(known) > 0
    return picks if right and max(picks) < 1000 else None


def _given(raw: Raw, name: str | None) -> Reading | None:
    n = int(raw.joints.shape[1])
    if name is None:
        return None
    if name == AXIS_MAJOR:
        name = BY_COUNT.get(n, "")
    picks = ORDERS.get(name) or _places(name)
    if picks is None:
        known = ", ".join((*ORDERS, AXIS_MAJOR))
        raise InputError(f"joint order {name[:40]!r} is unknown, known are {known}", raw.path)
    expected: int = ORDER_JOINTS.get(name, n)
    if expected != n or max(picks) >= n:
        raise InputError(
            f"a frame has {n} joints, the order {name} has {max(expected, max(picks) + 1)}"
            f"{with_as_many(n)}",
            raw.path,
        )
    return Reading(picks, name, True)


def _by_count(raw: Raw) -> Reading:
    """The order that joints of this number have, or of several the one that makes a hand."""
    n = raw.joints.shape[1]
    name = BY_COUNT.get(n)
    if name is None:
        raise InputError(f"a frame has {n} joints{with_as_many(n)}", raw.path)
    reading = Reading(ORDERS[name], name, False)
    if n == N_JOINTS:
        return reading
    joints = _enough(raw)
    ranked = [f for f in best_order(joints) if np.isfinite(f.misfit)]
    own = misfit(joints, reading.picks)
    best = ranked[0] if ranked else None
    if best is None or best.name == name or not clearly_better(best.misfit, own, len(raw.joints)):
        return reading
    note = f"{n} joints taken in the order {best.name}, as its bones are a hand's (--order {name})"
    return Reading(best.picks, best.name, False, (note,))


def _enough(raw: Raw) -> Array:
    """Joints (F, N, 3) of frames that say something, and of no more than tell an order."""
    least = min(_LEAST, raw.joints.shape[1])
    return rows_of(raw.joints, some_frames(raw.joints, _LOOK, least))


def with_as_many(n: int) -> str:
    """The end of an error about frames of n joints: which orders have so many."""
    fitting = [name for name, count in ORDER_JOINTS.items() if count == n]
    if fitting:
        return f"; orders with {n} are {', '.join(fitting)}: pass --order {fitting[0]}"
    if n in (42, 50, 52):
        return ", as two hands have: give each hand its own array, left_joints and right_joints"
    counts = ", ".join(str(c) for c in sorted(set(ORDER_JOINTS.values())))
    tips = ": fingertips alone do not tell a hand's pose" if n == 5 else ""
    return f"; orders are known for {counts} joints{tips}"


def _doubts(raw: Raw, reading: Reading, order: str | None) -> list[str]:
    """What is doubtful of a reading, one line each.

    Raises:
        InputError: nobody stated it and another is clearly right, or it is no hand's.
    """
    joints = _enough(raw)
    frames = len(joints)
    own = misfit(joints, reading.picks)
    if not np.isfinite(own):
        return []
    if order != AXIS_MAJOR:
        turned = misfit(ordered_by_axis(joints), reading.picks)
        if clearly_better(turned, own, 1):
            raise OtherOrder(
                "the numbers of a frame seem to be all x, then all y, then all z: pass --order"
                f" {AXIS_MAJOR}",
                AXIS_MAJOR,
                raw.path,
            )
    better = better_order(joints, reading.picks, frames)
    if better is not None:
        cure = better.name or ",".join(map(str, better.picks))
        text = f"the bones are a hand's in the joint order {cure}, not in {reading.name}"
        if not reading.stated:
            raise OtherOrder(
                f"{text}: pass --order {cure} (or --order {reading.name} to insist)",
                cure,
                raw.path,
            )
        return [Note(f"{text}: is it --order {cure}?", "order")]
    chance = beyond_chance(joints, reading.picks)
    none = f"joints in the order {reading.name} are no hand's: their bones"
    if chance < _HOPELESS and own > _ABSURD and frames >= _FEW:
        raise InputError(
            f"{none} fit no better than those of a random order. Is the joint order another"
            " (--order NAME, or the places of our joints), or are these no joints?",
            raw.path,
        )
    folded = [JOINT_NAMES[j] for j in folded_back(joints, reading.picks)]
    if folded:
        return [f"the bones fold back at {', '.join(folded)}: is --order {reading.name} right?"]
    if chance < _CHANCE or own > _NO_HAND:
        text = f"{none} hardly fit better than those of a random order: is --order right?"
        return [Note(text, "order")]
    return []
