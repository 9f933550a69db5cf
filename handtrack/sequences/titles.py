"""What the title of a column or the key of an object is: a joint, a time, a hand, a confidence.

Titles are told by the words of `names`, which is where a source's names are added.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from handtrack.hand.skeleton import JOINT_NAMES, Hand
from handtrack.hand.units import Unit
from handtrack.sequences.names import (
    ABOUT_JOINTS,
    ABOUT_TIME,
    AXES,
    BODY,
    CONFIDENCES,
    FINGER,
    FRAME,
    FRAME_NUMBER,
    HAND_LABEL,
    HAND_NUMBER,
    JOINTS,
    KEPT,
    MAYBE_HAND,
    NOISE,
    OTHER,
    PART,
    SIDES,
    TIME,
    TIME_UNITS,
    TRUTH,
    UNITS,
    WRIST,
    JointName,
    TimeUnit,
    joint_name,
    without_hand,
    words,
)


@dataclass(frozen=True)
class Column:
    """What the title of a column says.

    Attributes:
        joint: whose coordinate or confidence it is.
        axis: 0..2; None: confidence.
        unit: m, cm, mm or None.
    """

    joint: JointName
    axis: int | None
    unit: Unit | None


_INCHES = re.compile(r"[(\[]\s*in\s*[)\]]\s*$", re.IGNORECASE)


def words_and_unit(title: str) -> tuple[list[str], Unit | None]:
    """A title's words without the unit of length at their end, and it; "in" only in brackets."""
    given = list(words(title))
    unit = UNITS.get(given[-1]) if given else None
    if unit is None and given and given[-1] == "in" and _INCHES.search(title):
        unit = "in"
    return (given, None) if unit is None else (given[:-1], unit)


@lru_cache(KEPT)
def column(title: str) -> Column | None:
    """A joint's coordinate or confidence, None where the title is neither."""
    given, unit = words_and_unit(title)
    axes = [i for i, w in enumerate(given) if w in AXES]
    sure = [i for i, w in enumerate(given) if w in CONFIDENCES]
    if len(axes) == 1 and not sure:
        rest = tuple(given[: axes[0]] + given[axes[0] + 1 :])
        joint = joint_name(rest) if rest else None
        return None if joint is None else Column(joint, AXES[given[axes[0]]], unit)
    if len(sure) == 1 and not axes and unit is None:
        rest = tuple(given[: sure[0]] + given[sure[0] + 1 :])
        joint = joint_name(tuple(w for w in rest if w not in ("tracking",)))
        return None if joint is None or joint.weak else Column(joint, None, None)
    return None


@lru_cache(KEPT)
def time_unit(name: str) -> TimeUnit | Literal[""] | None:
    """What a name of times says: their unit, "" where it is silent, None: it names no times."""
    given = words(name)
    units = [TIME_UNITS[w] for w in given if w in TIME_UNITS]
    others = [w for w in given if w not in TIME_UNITS]
    if len(units) > 1 or not all(w in TIME | ABOUT_TIME for w in others):
        return None
    if any(w in TIME for w in others):
        return units[0] if units else ""
    alone = not others and len(given) == 1 and given[0] not in ("s", "us")
    return units[0] if alone and units else None


@lru_cache(KEPT)
def is_frame_number(name: str) -> bool:
    """Whether a name is of frame numbers."""
    given = set(words(name))
    if not given <= FRAME | FRAME_NUMBER | {"video"}:
        return False
    return bool(given & {"frame", "frames", "fnum"}) or (
        bool(given & FRAME) and bool(given & FRAME_NUMBER)
    )


@lru_cache(KEPT)
def side_if_true(name: str) -> Hand | None:
    """The hand that a name asks for ("is_right"), None of other names."""
    given = words(name)
    return without_hand(given[1:])[0] if given[:1] == ("is",) and len(given) < 4 else None


@lru_cache(KEPT)
def is_hand_label(name: str) -> bool:
    """Whether a name is of what tells left from right."""
    given = set(words(name))
    return side_if_true(name) is not None or (
        bool(given & HAND_LABEL) and given <= HAND_LABEL | MAYBE_HAND | {"multi"}
    )


@lru_cache(KEPT)
def may_be_hand_label(name: str) -> bool:
    """Whether what tells left from right may stand under a name: a label may be of anything."""
    given = set(words(name))
    return is_hand_label(name) or (bool(given) and given <= MAYBE_HAND)


@lru_cache(KEPT)
def is_hand_number(name: str) -> bool:
    """Whether a name is of the hands' numbers (hand_id, hand_index)."""
    given = set(words(name))
    return (
        bool(given & {"hand", "person", "track"})
        and bool(given & HAND_NUMBER)
        and given <= HAND_NUMBER | {"hand", "person"}
    )


_BESIDE = {"tracking", "is", "are"}


@lru_cache(KEPT)
def is_confidence(name: str) -> bool:
    """Whether a name is of confidences, of a hand or of all its joints."""
    given = set(words(name))
    return bool(given & CONFIDENCES) and given <= CONFIDENCES | JOINTS | ABOUT_JOINTS | _BESIDE


@dataclass(frozen=True)
class JointsKey:
    """What a name of joints says: their unit, whether they are the truth, whose, and of what."""

    unit: Unit | None
    truth: bool
    hand: Hand | None
    world: bool


@lru_cache(KEPT)
def joints_key(name: str) -> JointsKey | None:
    """What a name of joints says, None where it names something else."""
    given = words(name)
    hand, rest = without_hand(given)
    unit = UNITS.get(rest[-1]) if rest else None
    if unit is not None:
        rest = rest[:-1]
    truth = bool(set(rest) & TRUTH)
    rest = [w for w in rest if w not in TRUTH]
    if not all(w in JOINTS | ABOUT_JOINTS for w in rest):
        return None
    if not (set(rest) & JOINTS or (truth and not rest) or rest == ["world"]):
        return None
    return JointsKey(unit, truth, hand, "world" in rest)


@lru_cache(KEPT)
def of_side(name: str) -> tuple[Hand | None, str]:
    """The hand that a name names, and the other words."""
    hand, rest = without_hand(words(name))
    return hand, " ".join(rest)


@lru_cache(KEPT)
def side_key(name: str) -> Hand | None:
    """The hand that a container is named after ("left", "rightHand", "hand_l"), else None."""
    hand, rest = without_hand(words(name))
    return hand if all(w in ("hand", "hands", "data", "tracked") for w in rest) else None


def looks_meant(title: str) -> str | None:
    """What a name that nothing reads looks like: "a joint", "a hand", "a time", else None."""
    given = words(title)
    found = set(given)
    known = is_hand_label(title) or is_hand_number(title) or is_frame_number(title)
    if known or found & (OTHER | BODY | CONFIDENCES):
        return None
    if column(title) or time_unit(title) is not None:
        return None
    parts = {w for w in PART if w not in ("base", "end", "null", "top", "middle", "mid", "ip")}
    fingers = {w for w in FINGER if w not in ("index", "middle", "mid", "long", "small", "little")}
    fingers -= {"pointer", "pointing", "baby", "ring"}
    axes = any(w in AXES for w in given)
    if found & (parts | fingers | WRIST) or (axes and found & {*FINGER, *NOISE}):
        return "a joint"
    if axes and any(w.isdigit() for w in given):
        return "a joint"
    if found & {"handedness", "chirality", "laterality"}:
        return "a hand"
    if found & {"time", "timestamp", "timestamps", "stamp"} or (
        len(given) == 2 and "elapsed" in found
    ):
        return "a time"
    return None


def looks_like_place(title: str) -> bool:
    """Whether a title is of no other quantity than a place."""
    return not set(words(title)) & (OTHER | BODY)


def few(names: Iterable[str]) -> str:
    """The first of some names, and how many more there are, for messages."""
    given = [name[:40] for name in names]
    more = f" and {len(given) - 3} more" if len(given) > 3 else ""
    return ", ".join(given[:3]) + more


def nearest(name: str) -> str:
    """The joint's name of ours that is most like a name."""
    given = "_".join(w for w in words(name) if w not in AXES and w not in SIDES)
    close = difflib.get_close_matches(given, JOINT_NAMES, 1, 0.0)
    return close[0] if close else JOINT_NAMES[0]
