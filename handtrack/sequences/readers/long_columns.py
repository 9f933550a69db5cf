"""Which columns of a table make a row for each joint: its name or number, and x, y, z."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.hand.units import Unit
from handtrack.sequences.names import (
    ABOUT_JOINTS,
    AXES,
    FRAME_NUMBER,
    JOINTS,
    NOISE,
    UNUSED,
    JointName,
    as_side,
    joint_name,
    words,
)
from handtrack.sequences.readers.columns_at_once import MISSING
from handtrack.sequences.readers.table_cells import Table
from handtrack.sequences.readers.table_columns import first_number
from handtrack.sequences.settled import settle
from handtrack.sequences.short_names import spelt_out
from handtrack.sequences.titles import (
    Column,
    column,
    is_confidence,
    may_be_hand_label,
    nearest,
    words_and_unit,
)

_OF_JOINTS = {
    *("joint", "joints", "landmark", "landmarks", "keypoint", "keypoints", "kp", "kpt", "lm"),
    *("marker", "markers", "point", "points", "node", "bone", "bodypart", "bodyparts", "part"),
}
_NAMING = {"name", "names", "label", "key", "type", "hand", "code", "enum"}
_MAYBE = {"id", "index", "idx", "name", "label", "number", "no", "n", "type", "key", "i", "j"}
_PATH = {"path", "hierarchy", "object", "transform", "gameobject", "full"}
_VARIABLE = {"variable", "column", "feature", "measure", "field", "name", "key", "channel"}
_AXIS = {"axis", "coord", "coordinate", "dim", "dimension", "component", "xyz"}
_VALUE = {"value", "values", "val", "position", "pos"}
_NOT_HANDS = {"face", "pose", "body", "head"}
_FEWEST = 4
_MOST = 2000
"""A table of more different names of joints is of something else."""


@dataclass
class LongColumns:
    """The columns that tell a joint and where it is.

    Attributes:
        table: whose columns they are, without rows of faces and bodies.
        names: columns that together name the joint.
        axes: columns of x, y and z; or of the one value, whose axis the names tell too.
        sure: column of the joint's confidence.
        unit: in the titles.
        codes: (rows,) which of `slots` each row is.
        slots: (hand, joint, axis) of each name; axis None: all three, -1: confidence. Joint
            None: the row names none.
        n_joints: in a frame.
        order: the joints' order, where names say it.
    """

    table: Table
    names: list[int]
    axes: list[int]
    sure: int | None
    unit: Unit | None
    codes: NDArray[np.int64]
    slots: list[tuple[Hand | None, int | None, int | None]]
    n_joints: int
    order: str | None

    @property
    def all(self) -> list[int]:
        """All of them."""
        return [*self.names, *self.axes, *([] if self.sure is None else [self.sure])]


def long_columns(table: Table, titles: list[str], path: Path) -> LongColumns | None:
    """The columns of a table of one row a joint; None where it is another kind of table.

    Raises:
        InputError: a joint that is not known.
    """
    axes, unit = _axes(titles)
    melted = not axes
    if melted:
        value = _first(titles, _VALUE)
        if value is None:
            return None
        axes = [value]
    ways = _names(titles, melted, axes)
    if not ways or not table.lines:
        return None
    table.check_width()
    table = _hands_only(table, titles)
    error: InputError | None = None
    for names, sure_of_it in ways:
        try:
            found = _slots(table, titles, names, melted, path)
        except InputError as wrong:
            error = error or (wrong if sure_of_it else None)
            continue
        if found is not None:
            codes, slots, n, order = found
            others = [c for c, t in enumerate(titles) if c not in names and is_confidence(t)]
            sure = min(others, key=lambda c: "presence" in words(titles[c]), default=None)
            return LongColumns(table, names, axes, sure, unit, codes, slots, n, order)
    if error is not None:
        raise error
    return None


def _hands_only(table: Table, titles: list[str]) -> Table:
    """Without the rows that say to be of a face or a body."""
    for c, title in enumerate(titles):
        if not may_be_hand_label(title):
            continue
        said = table.coded(c)
        sides = {t: as_side(t) for t in said.texts}
        others = {t for t, side in sides.items() if side is None and t.lower() not in MISSING}
        if not any(sides.values()) or not others or not others <= _NOT_HANDS:
            continue
        kept = np.array([t not in others for t in said.texts])
        rows = np.flatnonzero(kept[said.codes]).tolist()
        lines, places = [table.lines[i] for i in rows], [table.places[i] for i in rows]
        return replace(table, lines=lines, places=places)
    return table


def _axes(titles: list[str]) -> tuple[list[int], Unit | None]:
    """The columns of bare x, y and z, and their unit; of several those in the world."""
    sets: dict[tuple[str, ...], dict[int, int]] = {}
    units: dict[tuple[str, ...], Unit | None] = {}
    for c, title in enumerate(titles):
        given, unit = words_and_unit(title)
        axis = [w for w in given if w in AXES]
        rest = tuple(w for w in given if w not in AXES)
        if len(axis) == 1 and set(rest) <= NOISE | JOINTS | ABOUT_JOINTS | _VALUE:
            sets.setdefault(rest, {}).setdefault(AXES[axis[0]], c)
            units[rest] = unit
    whole = [rest for rest, of in sets.items() if len(of) == 3]
    best = min(whole, key=lambda rest: ("world" not in rest, len(rest)), default=None)
    if best is None:
        flat = next((rest for rest, of in sets.items() if set(of) == {0, 1}), None)
        return ([] if flat is None else [sets[flat][0], sets[flat][1]]), None
    return [sets[best][axis] for axis in range(3)], units[best]


def _first(titles: list[str], known: set[str]) -> int | None:
    return next((c for c, t in enumerate(titles) if words(t) and set(words(t)) <= known), None)


def _names(titles: list[str], melted: bool, taken: list[int]) -> list[tuple[list[int], bool]]:
    """Columns that may name joints, the most telling first; whether they say that they do."""
    free = {c: set(words(t)) for c, t in enumerate(titles) if c not in taken and words(t)}
    finger = next((c for c, given in free.items() if given == {"finger"}), None)
    named = [
        c
        for c, given in free.items()
        if given & _OF_JOINTS and given <= _OF_JOINTS | FRAME_NUMBER | _NAMING
    ]
    named.sort(key=lambda c: not free[c] & {"name", "names"})
    ways: list[tuple[list[int], bool]] = []
    if melted:
        axis = next((c for c, given in free.items() if given <= _AXIS), None)
        variable = [c for c, given in free.items() if given <= _VARIABLE]
        if axis is not None:
            ways += [([c, axis], True) for c in named]
        return ways + [([c], False) for c in variable]
    if finger is not None:
        ways += [([finger, c], True) for c in named] or [
            ([finger, c], False) for c, given in free.items() if given <= _MAYBE
        ]
    ways += [([c], True) for c in named]
    return ways + [([c], False) for c, given in free.items() if given <= _MAYBE or given <= _PATH]


_Slots = tuple[NDArray[np.int64], list[tuple[Hand | None, int | None, int | None]], int, str | None]


def _slots(
    table: Table, titles: list[str], names: list[int], melted: bool, path: Path
) -> _Slots | None:
    """Which joint each row is of; None where the texts are no joints."""
    given = table.coded(names[0])
    if len(names) > 1:
        given = given.with_other(table.coded(names[1]))
    texts = given.texts
    if len(texts) > _MOST:
        return None
    spelt = zip(texts, spelt_out(texts), strict=True)
    said = [None if t.lower() in MISSING else _said(name, melted) for t, name in spelt]
    known = [s for s in said if s is not None]
    if len({(s.joint.hand, s.joint.finger, s.joint.part, s.joint.number) for s in known}) < _FEWEST:
        return None
    for row, (text, one) in enumerate(zip(texts, said, strict=True)):
        if one is None and text.lower() not in MISSING and not melted:
            line = table.places[int(np.argmax(given.codes == row))]
            raise InputError(
                f"line {line}: {titles[names[0]]} {text[:40]!r} is"
                f" unknown, the nearest name is {nearest(text)}",
                path,
            )
    joints, n, order = _settled([s.joint for s in known], titles[names[0]], path)
    slots: list[tuple[Hand | None, int | None, int | None]] = []
    for one in said:
        joint = None if one is None else joints[one.joint]
        if one is None or joint is None:
            slots.append((None, None, None))
        else:
            alone = -1 if one.axis is None else one.axis
            slots.append((one.joint.hand, joint, alone if melted else None))
    return given.codes, slots, n, order


def _said(text: str, melted: bool) -> Column | None:
    """What a row's name says: a joint, and its axis where a row is of one number."""
    if melted:
        return column(text)
    if text.endswith(".0") and text[:-2].isdigit():  # pandas writes whole numbers so
        text = text[:-2]
    given = words(text)
    joint = joint_name(given) or (joint_name(given[1:]) if given and given[0].isdigit() else None)
    return None if joint is None else Column(joint, None, None)


def _settled(
    names: Iterable[JointName], title: str, path: Path
) -> tuple[dict[JointName, int | None], int, str | None]:
    """Which joint of a frame each name is, how many there are, and their order."""
    given = list(dict.fromkeys(names))
    numbers = {s.number for s in given if s.finger is None and s.number is not None}
    if numbers and len(numbers) + sum(s.extra for s in given) >= len({*given}) / 2:
        begin, n = first_number(numbers, title, path)
        order = "no-wrist" if n == N_JOINTS - 1 else None
        return {s: None if s.number is None else s.number - begin for s in given}, n, order
    joints: dict[JointName, int | None] = {}
    for hand in {s.hand for s in given}:
        own = [s for s in given if s.hand == hand]
        for name, joint in zip(own, settle(own), strict=True):
            joints[name] = None if joint in (None, UNUSED) else joint
    return joints, N_JOINTS, "handtrack"
