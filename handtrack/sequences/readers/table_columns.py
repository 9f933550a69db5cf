"""What the columns of a table with titles are: joints of each hand, times, frames, hands."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS, ORDER_JOINTS, Hand
from handtrack.hand.units import METRES, Unit
from handtrack.sequences.names import AXES, ROW_TITLES, UNUSED, JointName, words
from handtrack.sequences.readers.raw import NotJointsError
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import (
    Column,
    column,
    few,
    is_confidence,
    is_frame_number,
    is_hand_label,
    is_hand_number,
    looks_like_place,
    looks_meant,
    may_be_hand_label,
    nearest,
    of_side,
    time_unit,
)

_TO_SAY = 6
_ARIA = re.compile(r"t[xyz]_(?:left|right)_landmark_\d+_device")
_FEWEST = 4
"""A table of fewer joints is of something else: poses of wrists."""


@dataclass
class HandColumns:
    """The columns of one hand.

    Attributes:
        n_joints: in a frame, in the source's order where the columns are numbered.
        named: whether the joints are ours, by name.
        joints: column of each (joint, axis).
        confidence: column of each joint's confidence; of the whole hand's under -1.
        flat: whether there are x and y alone: places in a picture.
    """

    n_joints: int = N_JOINTS
    named: bool = True
    joints: dict[tuple[int, int], int] = field(default_factory=dict)
    confidence: dict[int, int] = field(default_factory=dict)
    flat: bool = False

    @property
    def axes(self) -> int:
        """How many coordinates a joint has."""
        return 2 if self.flat else 3


@dataclass
class Columns:
    """What the columns of a table are.

    Attributes:
        hands: columns of each hand; None: of a hand that is not named.
        unit: the unit in the joints' titles.
        order: the joints' order, where the titles are a format's.
        times: titles of times.
        frame, label, number: columns of frame numbers, of hands' names and numbers, or None.
        maybe_label: columns that may hold hands' names.
        unused: titles that nothing reads.
    """

    hands: dict[Hand | None, HandColumns] = field(default_factory=dict)
    unit: Unit | None = None
    order: str | None = None
    times: list[str] = field(default_factory=list)
    frame: int | None = None
    label: int | None = None
    number: int | None = None
    maybe_label: list[int] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)


def read_columns(titles: list[str], path: Path) -> Columns:
    """What a table's titles say.

    Raises:
        NotJointsError: no joints among them.
        InputError: joints that cannot be told, or lack an axis; titles that look like a joint, a
            hand or a time and are not understood.
    """
    found, joints, sure = _classified(titles)
    _refuse_meant(found, joints, titles, path)
    if None in joints and len(joints) > 1:
        _share_unsided(joints)
    for hand in sorted(joints, key=lambda h: h or ""):
        places = _of_hand(joints[hand], titles, path)
        _check_axes(places, found.unused, path)
        if places.joints:
            found.hands[hand] = places
    if not any(len(places.joints) >= places.axes * _FEWEST for places in found.hands.values()):
        there = ", ".join(titles[:_TO_SAY])[:60]
        raise NotJointsError(
            f"no joints in it: expected columns such as wrist_x, found {there}", path
        )
    _refuse_triples(found, path)
    found.unit = _unit([s for said_of in joints.values() for _, s in said_of], path)
    if any(_ARIA.fullmatch(title.strip()) for title in titles):
        found.order = "umetrack"
    elif all(places.n_joints == ORDER_JOINTS["no-wrist"] for places in found.hands.values()):
        found.order = "no-wrist"
    elif all(places.named for places in found.hands.values()):
        found.order = "handtrack"
    for c, hand in sure:
        for at in [hand] if hand in found.hands else list(found.hands):
            found.hands[at].confidence.setdefault(-1, c)
    return found


_Said = dict[Hand | None, list[tuple[int, Column]]]


def _classified(titles: list[str]) -> tuple[Columns, _Said, list[tuple[int, Hand | None]]]:
    """What each title is: what goes with joints, joints' columns by hand, confidences."""
    found = Columns()
    joints: _Said = {}
    sure: list[tuple[int, Hand | None]] = []
    for c, title in enumerate(titles):
        said = column(title)
        if said is not None:
            joints.setdefault(said.joint.hand, []).append((c, said))
        elif title.strip().lower() in ROW_TITLES:
            continue
        elif time_unit(title) is not None:
            found.times.append(title)
        elif found.frame is None and is_frame_number(title):
            found.frame = c
        elif found.label is None and is_hand_label(title):
            found.label = c
        elif found.number is None and is_hand_number(title):
            found.number = c
        elif is_confidence(of_side(title)[1]):
            sure.append((c, of_side(title)[0]))
        elif may_be_hand_label(title):
            found.maybe_label.append(c)
        else:
            found.unused.append(title)
    return found, joints, sure


def other_columns(titles: list[str], taken: Iterable[int], path: Path) -> Columns:
    """What the columns are that hold no joints, where some are known already.

    Raises:
        InputError: a title that looks like a hand or a time and is not understood.
    """
    known = set(taken)
    found, joints, _ = _classified(["" if c in known else t for c, t in enumerate(titles)])
    found.unused += [titles[c] for said in joints.values() for c, _ in said]
    for title in found.unused:
        if looks_meant(title) not in (None, "a joint"):
            _refuse_meant(found, {}, titles, path)
    return found


def _share_unsided(joints: dict[Hand | None, list[tuple[int, Column]]]) -> None:
    """Columns without a hand beside others with one are only known extras, or of another hand."""
    extras = [s for _, s in joints[None] if not s.joint.extra]
    if not extras:
        del joints[None]


def _refuse_meant(
    found: Columns,
    joints: dict[Hand | None, list[tuple[int, Column]]],
    titles: list[str],
    path: Path,
) -> None:
    """Refuse titles that look like what is read, and are not understood."""
    for title in found.unused:
        kind = looks_meant(title)
        if kind is None:
            continue
        if kind != "a joint":
            raise InputError(
                f"column {title[:40]!r} looks like {kind} and is not understood:"
                f" name it {'time_s' if kind == 'a time' else 'hand'}, or leave it out",
                path,
            )
        others = [t for t in found.unused if looks_meant(t) == "a joint"]
        if not joints and not any(c.isdigit() for t in others for c in t) and len(others) < 4:
            return  # another kind of table
        known = [titles[c] for said in joints.values() for c, _ in said]
        raise InputError(
            f"column {few(others)} looks like a joint and is not understood, the nearest name is"
            f" {nearest(title)}; understood are {few(known) or 'none'}",
            path,
        )


def _refuse_triples(found: Columns, path: Path) -> None:
    """Where joints are missing, a place in space that is not understood may be one of them."""
    if all(len(places.joints) >= places.axes * N_JOINTS for places in found.hands.values()):
        return
    rests: dict[tuple[str, ...], list[str]] = {}
    for title in found.unused:
        given = words(title)
        if sum(w in AXES for w in given) == 1 and looks_like_place(title):
            rests.setdefault(tuple(w for w in given if w not in AXES), []).append(title)
    for same in rests.values():
        if len(same) == 3:
            n = min(len(places.joints) for places in found.hands.values()) // 3
            raise InputError(
                f"columns {', '.join(t[:40] for t in same)} are not understood, and only {n} of"
                f" {N_JOINTS} joints are: is it {nearest(same[0])}?",
                path,
            )


def _unit(said: list[Column], path: Path) -> Unit | None:
    units = {s.unit for s in said if s.axis is not None and not s.joint.extra}
    if len(units) > 1:
        raise InputError("columns of different units", path)
    unit = units.pop() if units else None
    return next((u for u in METRES if u == unit), None)


def _of_hand(said: list[tuple[int, Column]], titles: list[str], path: Path) -> HandColumns:
    numbered = [s for _, s in said if _is_numbered(s.joint)]
    named = [c for c, s in said if not _is_numbered(s.joint) and not s.joint.extra]
    if numbered and named:
        if len({s.joint.number for s in numbered}) < N_JOINTS or len(named) > 6:
            first = next(c for c, s in said if _is_numbered(s.joint))
            raise InputError(
                f"joints with numbers ({titles[first]}) and with names ({titles[named[0]]})", path
            )
        # all joints are there by number; the wrist's pose stands beside them
        said = [(c, s) for c, s in said if _is_numbered(s.joint)]
    places = HandColumns(named=not numbered)
    if numbered:
        numbers = {s.joint.number for s in numbered if s.joint.number is not None}
        begin, places.n_joints = first_number(numbers, titles[said[0][0]], path)
        joint_of = [UNUSED if s.joint.number is None else s.joint.number - begin for _, s in said]
    else:
        settled = settle(s.joint for _, s in said)
        for (c, _), joint in zip(said, settled, strict=True):
            if joint is None:
                raise InputError(f"column {titles[c]!r}: which joint it is cannot be told", path)
        joint_of = [UNUSED if joint is None else joint for joint in settled]
    for (c, s), joint in zip(said, joint_of, strict=True):
        if joint == UNUSED:
            continue
        if s.axis is None:
            places.confidence[joint] = c
        elif (joint, s.axis) in places.joints:
            name = JOINT_NAMES[joint] if places.named else titles[c]
            raise InputError(f"two columns for {name} {'xyz'[s.axis]}", path)
        else:
            places.joints[joint, s.axis] = c
    return places


def _is_numbered(joint: JointName) -> bool:
    return joint.finger is None and joint.number is not None


def first_number(numbers: set[int], title: str, path: Path) -> tuple[int, int]:
    """The first joint's number, 0 or 1, and how many joints there are."""
    last = max(numbers)
    counts = sorted(set(ORDER_JOINTS.values()))
    begin = 0 if 0 in numbers else 1
    n: int | None = last + 1 - begin
    if n not in counts:
        n = N_JOINTS if begin == 0 and last < N_JOINTS else None
    if n is None:
        raise InputError(
            f"joints are numbered {min(numbers)} to {last} ({title}): expected 0 to 20 or 1 to 21,"
            f" or another order's {', '.join(map(str, counts))} joints",
            path,
        )
    return begin, n


def _check_axes(places: HandColumns, unused: list[str], path: Path) -> None:
    there = {joint for joint, _ in places.joints}
    axes = {axis for _, axis in places.joints}
    places.flat = axes == {0, 1}
    for joint in sorted(there):
        for axis in range(2 if places.flat else 3):
            if (joint, axis) not in places.joints:
                name = JOINT_NAMES[joint] if places.named else f"joint {joint}"
                other = f"; not understood: {few(unused)}" if unused else ""
                raise InputError(f"no column for {name} {'xyz'[axis]}{other}", path)
