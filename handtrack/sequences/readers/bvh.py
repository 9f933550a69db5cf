"""Reader of BVH (Biovision hierarchy) with fingers: Mixamo's, Rokoko's, Manus', MotionBuilder's.

    HIERARCHY
    ROOT Hips { OFFSET x y z  CHANNELS 6 Xposition ... Zrotation  JOINT LeftHand {...} }
    MOTION
    Frames: 69
    Frame Time: 0.0333333
    one line of channels a frame

Joints are placed by forward kinematics: each one's rotations turn in the order of its channels.
The end of a finger's last joint (End Site) is its tip, where it lies apart from it; without one
the tip is missing. BVH states no unit: the one that makes a hand is taken, and said.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import N_JOINTS, TIPS, Hand
from handtrack.sequences.names import UNUSED, JointName, joint_name, words
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.jsontext import as_utf8
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem
from handtrack.sequences.readers.table_cells import Table
from handtrack.sequences.settled import settle
from handtrack.sequences.size import fitting_unit
from handtrack.sequences.titles import few

START = b"HIERARCHY"
_FEWEST = 8
"""Fewer joints do not tell a hand's pose."""
_MOST, _DEEPEST = 5000, 200
_APART = 1e-3
"""An end site nearer to its joint than this share of the bone before is no tip."""
_AXES = {"X": 0, "Y": 1, "Z": 2}
_BLOCK = 4096
_FARTHEST = 1e9


@dataclass
class _Node:
    """A joint, or an end site.

    Attributes:
        name: its name; "" for an end site.
        parent: its index, -1 for a root.
        offset: (3,) from the parent.
        channels: (column, kind, axis) in their order.
    """

    name: str
    parent: int
    offset: Array = field(default_factory=lambda: np.zeros(3))
    channels: list[tuple[int, str, int]] = field(default_factory=list)


def read_bvh(data: bytes, path: Path) -> list[Raw]:
    """The hands of a BVH file, one sequence each.

    Raises:
        NotJointsError: a body without fingers (with the names that are there).
        InputError: a hierarchy or a motion that is cut short or malformed.
    """
    text = as_utf8(data).decode("utf-8", "replace").removeprefix("\ufeff")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    nodes, at = _hierarchy(lines, path)
    rate, rows = _motion(lines, at, path)
    hands = _hands(nodes, path)
    needed = sorted(
        {a for joints in hands.values() for i in joints.values() for a in _up(nodes, i)}
    )
    columns = sorted({c for i in needed for c, _, _ in nodes[i].channels})
    width = sum(len(n.channels) for n in nodes)
    values = _values(rows, width, columns, path)
    places = _placed(nodes, needed, values, {c: k for k, c in enumerate(columns)})
    raws = []
    for hand, joints in hands.items():
        out = np.full((len(values), N_JOINTS, 3), np.nan)
        for joint, node in joints.items():
            out[:, joint] = places[node]
        raw = Raw(out, path, stem(path), hand=hand, order="handtrack", fps=rate)
        raw.tagged = hand is not None
        raw.unit = fitting_unit(out, inches=True)
        if raw.unit is not None:
            raw.notes = (f"BVH states no unit: read as {raw.unit}, which makes a hand",)
        raws.append(raw)
    return raws


def _hierarchy(lines: list[str], path: Path) -> tuple[list[_Node], int]:
    """The joints, and the line after them."""
    building = _Building(path)
    for n, line in enumerate(lines):
        cells = line.replace("{", " { ").replace("}", " } ").split()
        if cells and cells[0].upper() == "MOTION":
            if building.open or not building.nodes:
                raise InputError(f"line {n + 1}: MOTION before the hierarchy ends", path)
            return building.nodes, n + 1
        while cells:
            cells = building.take(cells, n)
    raise InputError("the hierarchy is cut short: there is no MOTION", path)


class _Building:
    """A hierarchy while it is read."""

    def __init__(self, path: Path):
        self.path = path
        self.nodes: list[_Node] = []
        self.open: list[int] = []
        self.waiting: int | None = None
        self.columns = 0

    def take(self, cells: list[str], line: int) -> list[str]:
        """Take the first of a line's words and what belongs to it; the rest is returned.

        Raises:
            InputError: it stands where it cannot.
        """
        word, rest = cells[0], cells[1:]
        if word in ("ROOT", "JOINT", "End"):
            if len(self.nodes) >= _MOST or len(self.open) > _DEEPEST:
                raise InputError(f"line {line + 1}: more joints than any body has", self.path)
            name = "" if word == "End" else " ".join(c for c in rest if c not in "{}")
            self.nodes.append(_Node(name, self.open[-1] if self.open else -1))
            self.waiting = len(self.nodes) - 1
            return [c for c in rest if c in "{}"]
        if word == "{" and self.waiting is not None:
            self.open.append(self.waiting)
            self.waiting = None
            return rest
        if word == "}" and self.open:
            self.open.pop()
            return rest
        if word == "OFFSET" and self.open:
            self.nodes[self.open[-1]].offset = _offset(rest[:3], line, self.path)
            return rest[3:]
        if word == "CHANNELS" and self.open:
            count = int(rest[0]) if rest and rest[0].isdigit() and len(rest[0]) < 3 else -1
            given = rest[1 : 1 + count]
            node = self.nodes[self.open[-1]]
            if len(given) == count and not node.channels:
                node.channels = _channels(given, self.columns, line, self.path)
                self.columns += count
                return rest[1 + count :]
        elif word.upper() == "HIERARCHY":
            return rest
        raise InputError(
            f"line {line + 1}: {shown(' '.join(cells), 60)} is not understood, expected JOINT,"
            " OFFSET, CHANNELS or a bracket",
            self.path,
        )


def _offset(cells: list[str], line: int, path: Path) -> Array:
    try:
        offset = np.array([float(c.replace(",", ".")) for c in cells])
    except ValueError:
        offset = np.zeros(0)
    if offset.shape != (3,) or not (np.abs(offset) < _FARTHEST).all():
        raise InputError(f"line {line + 1}: an offset is no three numbers", path)
    return offset


def _channels(given: list[str], column: int, line: int, path: Path) -> list[tuple[int, str, int]]:
    out = []
    for i, name in enumerate(given):
        axis, kind = _AXES.get(name[:1].upper()), name[1:].lower()
        if axis is None or kind not in ("position", "rotation"):
            raise InputError(f"line {line + 1}: channel {shown(name, 30)} is not understood", path)
        out.append((column + i, kind, axis))
    return out


def _motion(lines: list[str], at: int, path: Path) -> tuple[float, list[tuple[int, str]]]:
    """Frames a second, and the lines of numbers with their places."""
    said: dict[str, str] = {}
    while at < len(lines) and len(said) < 2:
        key, colon, value = lines[at].partition(":")
        if colon:
            said[" ".join(key.split()).lower()] = value.strip()
        elif lines[at].strip():
            break
        at += 1
    try:
        step = float(said["frame time"].replace(",", "."))
        count = int(said["frames"])
    except (KeyError, ValueError):
        raise InputError(
            f"line {at + 1}: expected Frames: and Frame Time: after MOTION", path
        ) from None
    rows = [(n, line) for n, line in enumerate(lines[at:], at + 1) if line.strip()]
    if not step > 0 or not np.isfinite(step):
        raise InputError(f"Frame Time is {step:g}, expected seconds above 0", path)
    if not rows:
        raise InputError("a motion without frames", path)
    if len(rows) != count:
        raise InputError(f"Frames: {count}, but {len(rows)} follow: is it cut short?", path)
    return 1.0 / step, rows


def _values(rows: list[tuple[int, str]], width: int, columns: list[int], path: Path) -> Array:
    for n, line in rows:
        found = len(line.split())
        if found != width:
            raise InputError(f"line {n} has {found} numbers, the channels are {width}", path)
    lines = (
        [line.replace(",", ".") for _, line in rows]
        if "," in rows[0][1]
        else [line for _, line in rows]
    )
    names = [f"channel {c + 1}" for c in columns]
    first = rows[0][1].split()
    table = Table(lines, [n for n, _ in rows], None, None, first, path)
    values = table.numbers(columns, names)
    if not (np.abs(np.nan_to_num(values, nan=0.0)) < _FARTHEST).all():
        raise InputError("a channel holds a number that is no place and no angle", path)
    return values


def _up(nodes: list[_Node], i: int) -> list[int]:
    """A node and those above it."""
    out = []
    while i >= 0:
        out.append(i)
        i = nodes[i].parent
    return out


def _check_names(nodes: list[_Node], joints: dict[int, int], path: Path) -> None:
    """Refuse a hand below whose wrist most joints have names that are not understood."""
    known, below = set(joints.values()), {joints.get(0, -1)}
    others = []
    for i, node in enumerate(nodes):  # a joint stands behind the one that holds it
        if node.parent in below and node.parent >= 0:
            below.add(i)
            if node.name and joint_name(words(node.name.rpartition(":")[2])) is None:
                others.append(node.name)
    if len(others) >= len(known):
        raise InputError(
            f"most joints of the hand are not understood: {few(others)}; understood are"
            f" {few(nodes[i].name or 'its end' for i in sorted(known))}",
            path,
        )


def _hands(nodes: list[_Node], path: Path) -> dict[Hand | None, dict[int, int]]:
    """The node of each of our joints, by hand."""
    said: list[tuple[int, JointName]] = []
    for i, node in enumerate(nodes):
        name = node.name.rpartition(":")[2]
        one = joint_name(words(name)) if name else None
        if one is not None and not (one.finger is None and one.number is not None):
            said.append((i, one))
    found: dict[Hand | None, dict[int, int]] = {}
    for hand in dict.fromkeys(one.hand for _, one in said):
        own = [(i, one) for i, one in said if one.hand == hand]
        joints: dict[int, int] = {}
        for (i, _), joint in zip(own, settle(one for _, one in own), strict=True):
            if joint is not None and joint != UNUSED:
                joints.setdefault(joint, i)
        _add_tips(nodes, joints)
        if len(joints) >= _FEWEST:
            _check_names(nodes, joints, path)
            found[hand] = joints
    if not found:
        known = ", ".join(shown(nodes[i].name, 30) for i, _ in said[:6]) or "none"
        others = ", ".join(shown(n.name, 30) for n in nodes if n.name)[:200]
        raise NotJointsError(
            f"no hand with fingers in it: understood are {known}; there are {others}", path
        )
    return found


def _add_tips(nodes: list[_Node], joints: dict[int, int]) -> None:
    """The ends of the fingers' last joints, where these have no tips of their own."""
    for tip in map(int, TIPS):
        last = joints.get(tip - 1)
        if tip in joints or last is None:
            continue
        end = next((i for i, n in enumerate(nodes) if n.parent == last and not n.name), None)
        if end is not None:
            bone = float(np.linalg.norm(nodes[last].offset))
            if np.linalg.norm(nodes[end].offset) > _APART * bone > 0:
                joints[tip] = end


def _placed(
    nodes: list[_Node], needed: list[int], values: Array, column: dict[int, int]
) -> dict[int, Array]:
    """(T, 3) places in the world of the nodes that are needed; parents come first."""
    n = len(values)
    places = {i: np.empty((n, 3)) for i in needed}
    for start in range(0, n, _BLOCK):
        rows = values[start : start + _BLOCK]
        turns: dict[int, Array] = {}
        for i in needed:
            node = nodes[i]
            move = np.tile(node.offset, (len(rows), 1))
            local = np.tile(np.eye(3), (len(rows), 1, 1))
            moved = False
            for c, kind, axis in node.channels:
                given = rows[:, column[c]]
                if kind == "position":
                    # a position stands for the offset, as programs write it
                    if not moved:
                        move, moved = np.zeros_like(move), True
                    move[:, axis] = given
                else:
                    unit = np.broadcast_to(np.eye(3)[axis], (len(rows), 3))
                    local = local @ about_axis(unit, np.deg2rad(given))
            block = slice(start, start + len(rows))
            if node.parent < 0:
                places[i][block], turns[i] = move, local
            else:
                above = turns[node.parent]
                places[i][block] = places[node.parent][block] + np.einsum("tab,tb->ta", above, move)
                turns[i] = above @ local
    return places


FORMATS = (
    Format(
        "BVH with fingers",
        "Mixamo's, Rokoko's, Manus', MotionBuilder's joints; end sites are tips, without them the"
        " tips are missing",
        "by name",
        "as makes a hand",
        "by name",
        "`HIERARCHY`",
        kinds={"bvh": read_bvh},
        suffixes=(".bvh",),
        ways=(Way("text", lambda data, path: data.startswith(START), read_bvh),),
    ),
)
