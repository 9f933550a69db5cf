"""Markers of motion capture as joints: by their names, or by a file that says which is which.

A file of pairs (`--markers FILE`), JSON or CSV: the marker's name, and the joint's in any of the
names of `names`, with its hand where there are two ("right index_mcp", "L_thumb_tip"):

    {"RIH1": "right index mcp", ...}     RIH1,right index mcp
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable
from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.hand.skeleton import HANDS, JOINT_NAMES, N_JOINTS, Hand
from handtrack.hand.units import Unit
from handtrack.sequences.names import UNITS, UNUSED, JointName, joint_name, words
from handtrack.sequences.readers.companions import Companions
from handtrack.sequences.readers.jsontext import as_utf8, decode
from handtrack.sequences.readers.raw import NotJointsError, Raw, as_unit
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import nearest

UNITS_STATED = frozenset({*UNITS, "in"})
"""Units of length in headers; in columns' names "in" is a word."""
FEWEST = 8
"""Fewer joints do not tell a hand's pose."""
_TO_SAY = 8
_MOST = 2000


@dataclass(frozen=True)
class Markers:
    """The names of a source's markers, one for each of its raw joints.

    Attributes:
        names: of the markers, as the file has them.
        takes: the companion that says which joint each is.
    """

    names: tuple[str, ...]
    takes: str = "markers"

    def resolved(self, raw: Raw, companions: Companions) -> list[Raw]:
        """The hands that the markers make.

        Raises:
            NotJointsError: too few of the names are joints.
            InputError: the file of pairs does not fit, or two markers are one joint.
        """
        path = companions.markers
        said = {n: n for n in self.names} if path is None else pairs(path, self.names)
        found = by_hand(said, raw.path)
        best = max((len(j) for j in found.values()), default=0)
        if best < FEWEST:
            known = [name for joints in found.values() for name in joints.values()]
            raise NotJointsError(_too_few(known, self.names, path), raw.path)
        raws = []
        for hand, joints in found.items():
            if len(joints) >= FEWEST:
                raws.append(self._of_hand(raw, hand, joints))
        return raws

    def _of_hand(self, raw: Raw, hand: Hand | None, joints: dict[int, str]) -> Raw:
        at = {name: i for i, name in enumerate(self.names)}
        columns = [at[joints[j]] for j in joints]
        places = np.full((len(raw.joints), N_JOINTS, 3), np.nan)
        places[:, list(joints)] = raw.joints[:, columns]
        missing = [JOINT_NAMES[j] for j in range(N_JOINTS) if j not in joints]
        notes = list(raw.notes)
        if missing:
            notes.append(f"no marker is {', '.join(missing[:6])}{_more(len(missing) - 6)}")
        return replace(
            raw,
            joints=places,
            hand=hand or raw.hand,
            order="handtrack",
            pending=None,
            notes=tuple(notes),
            tagged=hand is not None,
        )


def told_apart(names: Items[str], of: Items[Hashable] | None = None) -> list[str]:
    """The names, with their places behind those that occur twice (`of`: what else tells them
    apart)."""
    keys = names if of is None else of
    count = Counter(keys)
    return [
        f"{name}#{i}" if count[key] > 1 else name
        for i, (name, key) in enumerate(zip(names, keys, strict=True))
    ]


def stated_unit(text: str, path: Path) -> Unit | None:
    """The unit of length that a header states; None where it is none."""
    return as_unit(text, path) if text.lower() in UNITS_STATED else None


def frames_told(told: str | int, there: int) -> list[str]:
    """A note where a header tells of other frames than there are; none where it tells nothing."""
    if (isinstance(told, str) and not told.isdigit()) or int(told) == there:
        return []
    return [f"the header tells of {told} frames, there are {there}"]


def by_hand(said: dict[str, str], path: Path) -> dict[Hand | None, dict[int, str]]:
    """Which marker each of our joints is, by hand."""
    known = {marker: _joint(text) for marker, text in said.items()}
    found: dict[Hand | None, dict[int, str]] = {}
    for hand in (*HANDS, None):
        own = [(m, s) for m, s in known.items() if s is not None and s.hand == hand]
        joints: dict[int, str] = {}
        for (marker, s), settled in zip(own, settle(s for _, s in own), strict=True):
            joint = s.number if settled is None and s.finger is None else settled
            if joint is None or joint == UNUSED or not 0 <= joint < N_JOINTS:
                continue
            if joint in joints:
                raise InputError(
                    f"markers {shown(joints[joint], 40)} and {shown(marker, 40)} are both"
                    f" {JOINT_NAMES[joint]}: --markers FILE says which is which",
                    path,
                )
            joints[joint] = marker
        if joints:
            found[hand] = joints
    return found


def _joint(text: str) -> JointName | None:
    """The joint that a name says, behind whose it is ("Subject1:RIndex3")."""
    for part in (text, text.rpartition(":")[2]):
        given = words(part)
        said = joint_name(given) if given else None
        if said is not None and not said.extra:
            return said
    return None


def _too_few(known: list[str], names: Iterable[str], path: Path | None) -> str:
    others = [shown(n, 30) for n in names if n not in known]
    text = ", ".join(shown(k, 30) for k in known[:_TO_SAY]) or "none"
    not_known = ", ".join(others[:_TO_SAY]) + _more(len(others) - _TO_SAY)
    cure = "--markers FILE says which marker is which joint" if path is None else f"as {path} says"
    return (
        f"{len(known)} markers are joints of a hand, expected at least {FEWEST}: understood are"
        f" {text}; not {not_known or 'none'} ({cure})"
    )


def _more(count: int) -> str:
    return f" and {count} more" if count > 0 else ""


def pairs(path: Path, names: Iterable[str]) -> dict[str, str]:
    """The joint that a file says each marker is; markers that it leaves out are none.

    Args:
        path: the file of pairs.
        names: of the markers.

    Raises:
        InputError: no pairs, a joint that is unknown, or none of the markers in it.
    """
    there = {name.strip().lower(): name for name in names}
    out: dict[str, str] = {}
    listed = _listed(path)
    for left, right in listed:
        marker, joint = there.get(left.strip().lower()), right
        if marker is None:
            marker, joint = there.get(right.strip().lower()), left
        if marker is None:
            continue
        if _joint(joint) is None:
            raise InputError(
                f"{shown(marker, 40)} is {shown(joint, 40)!r}, which is no joint: the nearest name"
                f" is {nearest(joint)}",
                path,
            )
        out[marker] = joint
    if not out:
        has = ", ".join(shown(n, 20) for n in list(there.values())[:_TO_SAY])
        raise InputError(f"names none of the file's markers, which are {has}", path)
    return out


def _listed(path: Path) -> list[tuple[str, str]]:
    data = as_utf8(budget.read(path, budget.TEXT)).removeprefix(b"\xef\xbb\xbf")
    if data.lstrip()[:1] == b"{":
        whole = decode(data, dict[str, Any], path)
        found = []
        for key, value in whole.items():
            if isinstance(value, dict):  # {"right": {"RIH1": "index mcp"}}
                found += [(str(m), f"{key} {j}") for m, j in value.items()]
            else:
                found.append((str(key), str(value)))
        return found[:_MOST]
    try:
        lines = data.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise InputError("not UTF-8 text: expected JSON or CSV of pairs", path) from None
    found = []
    for n, line in enumerate(lines[:_MOST], 1):
        mark = next((m for m in (",", ";", "\t", "=", ":") if m in line), None)
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if mark is None:
            raise InputError(f"line {n} is no pair: expected marker,joint", path)
        left, _, right = line.partition(mark)
        found.append((left.strip().strip('"'), right.strip().strip('"')))
    return found
