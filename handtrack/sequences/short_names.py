"""Short names of joints (`t1` ... `p4`, `i_mcp`, `TIP`, `F1J2`, `finger0_3`) spelt out.

One such name alone says nothing: `t` is a time and `r` a right hand elsewhere. Where the names
beside it make whole fingers of all five, they are a hand's.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

from handtrack.hand.skeleton import FINGERS, N_JOINTS
from handtrack.sequences.names import FINGER, KEPT

_AXIS = r"(?:[_ .:-]*(?P<axis>[xyzXYZ]))?(?P<unit>[_ .(\[]*(?:mm|cm|m)[)\]]?)?"
_SIDE = r"(?:(?P<side>left|right|lh|rh)(?:[_ .-]?hand)?[_ .-]*)?"
_LETTER_SIDE = r"(?P<side>[lr])[_ .-]"
_PARTS = "|".join(("cmc", "mcp", "pip", "dip", "ip", "tip", "prox", "dist", "base"))
_LETTERS = r"thumb|thu?|t|index|ind?|i|middle|mid?|m|ring|rin?|r|pinky|pink?|pi|p|little|lit?|l|s"
_LETTER = rf"(?P<finger>{_LETTERS})[_ .-]?(?P<part>\d|{_PARTS}){_AXIS}"
_BY_LETTER = re.compile(_SIDE + _LETTER, re.IGNORECASE)
_BY_LETTERS = re.compile(_LETTER_SIDE + _LETTER, re.IGNORECASE)
_BY_NUMBER = re.compile(
    rf"{_SIDE}(?:finger|fing|digit|f|d)[_ .-]?(?P<finger>[0-5])[_ .-]?(?:joint|jnt|j|_)?[_ .-]?"
    rf"(?P<part>\d|{_PARTS}){_AXIS}",
    re.IGNORECASE,
)
_WRIST = re.compile(
    rf"(?:{_LETTER_SIDE.replace('side', 'letter')}|{_SIDE})(?:w|wr|wri|wrs){_AXIS}", re.IGNORECASE
)
_BY_AXIS = re.compile(r"([lr])[_ ]?([xyz])[_ ]?(\d{1,2})", re.IGNORECASE)
_SIDES = {"l": "left", "r": "right"}
_FINGER_OF = {"t": 0, "i": 1, "m": 2, "r": 3, "p": 4, "l": 4, "s": 4}
_SPELT = {"prox": "proximal", "dist": "distal"}
_FEWEST, _MOST = 3, 5
"""Joints of each finger."""
_LONGEST = 24


class _Short:
    """What a short name says.

    Attributes:
        side, axis, unit: as it stands; "" where it does not say so.
        finger: 0..4 of letters, the number of numbers.
        part: a number, or a part's name.
    """

    def __init__(self, match: re.Match[str]) -> None:
        self.side = (match["side"] or "").lower()
        self.axis = (match["axis"] or "").lower()
        self.unit = (match["unit"] or "").strip("_ .()[]")
        finger, part = match["finger"].lower(), match["part"].lower()
        self.finger = int(finger) if finger.isdigit() else _FINGER_OF[finger[0]]
        self.part = _SPELT.get(part, part)

    def spelt(self, first: int) -> str:
        """A name that everybody understands, `first` being the first finger's number."""
        finger = FINGERS[self.finger - first]
        said = (self.side, finger, self.part, self.axis, self.unit)
        return "_".join(word for word in said if word)


def spelt_out(names: Sequence[str]) -> list[str]:
    """Names with those spelt out that are short ones of a hand's joints; the same where they do
    not make a hand."""
    if not any(len(name) <= _LONGEST for name in names):
        return list(names)
    return list(_spelt_out(tuple(names)))


@lru_cache(KEPT // 16)
def _spelt_out(names: tuple[str, ...]) -> tuple[str, ...]:
    axes = [m for name in names if (m := _match(_BY_AXIS, name)) is not None]
    if len({m[0].lower() for m in axes}) in (3 * N_JOINTS, 6 * N_JOINTS):
        spelt = {m[0]: f"{_SIDES[m[1].lower()]}_{m[2]}{m[3]}" for m in axes}
        return tuple(spelt.get(name, name) for name in names)
    for way in (_BY_LETTER, _BY_LETTERS, _BY_NUMBER):
        matches = {name: _match(way, name) for name in dict.fromkeys(names)}
        short = {name: _Short(match) for name, match in matches.items() if match is not None}
        first = _first_finger(short.values())
        if first is None or _are_understood(short):
            continue
        return tuple(short[n].spelt(first) if n in short else _wrist(n) for n in names)
    return names


def _match(way: re.Pattern[str], name: str) -> re.Match[str] | None:
    return way.fullmatch(name) if len(name) <= _LONGEST else None


def _are_understood(short: Iterable[str]) -> bool:
    """Whether all fingers have their names already."""
    return all(any(name.lower().find(f) >= 0 for f in FINGER) for name in short)


def _first_finger(said: Iterable[_Short]) -> int | None:
    """The first finger's number, where names make five fingers of as many joints; else None."""
    parts: dict[tuple[str, int], set[str]] = {}
    for one in said:
        parts.setdefault((one.side, one.finger), set()).add(one.part)
    if not parts or not all(_FEWEST <= len(of) <= _MOST for of in parts.values()):
        return None
    for side in {side for side, _ in parts}:
        fingers = sorted(finger for of, finger in parts if of == side)
        if fingers not in ([0, 1, 2, 3, 4], [1, 2, 3, 4, 5]):
            return None
    counts = {len(of) for of in parts.values()}
    return min(finger for _, finger in parts) if max(counts) - min(counts) <= 1 else None


def _wrist(name: str) -> str:
    match = _match(_WRIST, name)
    if match is None:
        return name
    said = (match["letter"] or match["side"], "wrist", match["axis"], match["unit"])
    return "_".join(word.strip("_ .()[]") for word in said if word)
