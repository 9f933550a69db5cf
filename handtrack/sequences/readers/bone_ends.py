"""Tables with a row for each bone and both its ends, as scripts write Leap Motion's hands:

    frame, timestamp, hand, finger, bone, prev_x, prev_y, prev_z, next_x, next_y, next_z

Fingers and bones are told by names or numbers, thumb and metacarpal first. The thumb's metacarpal
has no length in Leap's hand: its end is the joint at the wrist, ours 1. Blender's scripts name the
bone alone, with `head_x ... tail_z`: its head is its joint, the tail of a finger's last the tip.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handtrack.hand.skeleton import FINGERS, Hand
from handtrack.sequences.names import AXES, FINGER, PART, joint_name, words
from handtrack.sequences.readers.table_cells import Table
from handtrack.sequences.readers.table_places import SEPARATOR
from handtrack.sequences.titles import words_and_unit

_BEGIN, _END = {"prev", "previous", "start", "begin", "head"}, {"next", "end", "tail"}
_ABOUT = {"joint", "bone", "position", "pos", "point"}
_FEWEST_TIPS = 4
_COUNTED = {"name", "type", "id", "index", "idx", "number", "no"}
_BONES = ("metacarpal", "proximal", "intermediate", "distal")
_ENDS = ("proximal", "intermediate", "distal", "tip")
_THUMB_ENDS = ("cmc", "mcp", "ip", "tip")


def ends_as_joints(table: Table) -> tuple[Table, str] | None:
    """The table with a row for each joint instead, and a note on its unit; None of other tables."""
    titles = table.titles or []
    begin, unit = _end_columns(titles, _BEGIN)
    end, _ = _end_columns(titles, _END)
    finger, bone = (_counted(titles, name) for name in ("finger", "bone"))
    if len(begin) < 3 or len(end) < 3 or bone is None or not table.lines:
        return None
    table.check_width()
    if finger is None:
        return _of_named_bones(table, begin, end, bone, unit)
    fingers = _fingers(table.texts(finger))
    bones = _bones(table.texts(bone))
    if fingers is None or bones is None:
        return None
    note = ""
    if not unit:
        unit, note = _measured(table, titles, begin, end)
    wrist = [next((c for c, t in enumerate(titles) if words(t) == ("wrist", a)), -1) for a in "xyz"]
    taken = {*begin, *end, finger, bone, *wrist}
    others = [c for c in range(len(titles)) if c not in taken]
    whole = {f for f, b in zip(fingers, bones, strict=True) if b == 0}
    first = (fingers[0], bones[0])
    lines, places = [], []
    for row, (f, b) in enumerate(zip(fingers, bones, strict=True)):
        cells = table.cells(row)
        about = [cells[c] for c in others]
        ends = _THUMB_ENDS if f == 0 else _ENDS
        joints = [(f"{FINGERS[f]} {ends[b]}", end)]
        if b == 1 and f not in whole:
            joints.append((f"{FINGERS[f]} {ends[0]}", begin))
        if (f, b) == first and -1 not in wrist:
            joints.append(("wrist", wrist))
        for name, columns in joints:
            lines.append(SEPARATOR.join([*about, name, *(cells[c] for c in columns)]))
            places.append(table.places[row])
    named = [*(titles[c] for c in others), "joint", *(f"{axis} {unit}".strip() for axis in "xyz")]
    return replace(table, lines=lines, places=places, separator=SEPARATOR, titles=named), note


def _of_named_bones(
    table: Table, begin: list[int], end: list[int], bone: int, unit: str
) -> tuple[Table, str] | None:
    """The same of bones that their names tell apart; None where these are none of fingers."""
    titles = table.titles or []
    texts = table.texts(bone)
    said = {text: joint_name(words(text)) for text in dict.fromkeys(texts)}
    last: dict[tuple[Hand | None, int], tuple[int, str]] = {}
    for text, joint in said.items():
        place = None if joint is None else joint.number if joint.part is None else joint.part
        if joint is not None and joint.finger is not None and place is not None:
            key = (joint.hand, joint.finger)
            last[key] = max(last.get(key, (-1, "")), (place, text))
    tips = {
        text: " ".join((hand or "", FINGERS[finger], "tip")).strip()
        for (hand, finger), (_, text) in last.items()
    }
    if len(tips) < _FEWEST_TIPS:
        return None
    others = [c for c in range(len(titles)) if c not in {*begin, *end, bone}]
    lines, places = [], []
    for row, text in enumerate(texts):
        cells = table.cells(row)
        joints = [(text, begin)] + ([(tips[text], end)] if text in tips else [])
        for name, columns in joints:
            about = [cells[c] for c in others]
            lines.append(SEPARATOR.join([*about, name, *(cells[c] for c in columns)]))
            places.append(table.places[row])
    named = [*(titles[c] for c in others), "joint", *(f"{axis} {unit}".strip() for axis in "xyz")]
    return replace(table, lines=lines, places=places, separator=SEPARATOR, titles=named), ""


def _end_columns(titles: list[str], which: set[str]) -> tuple[list[int], str]:
    """The columns of x, y and z of the bones' beginnings or ends, and their unit."""
    found: dict[int, int] = {}
    unit = ""
    for c, title in enumerate(titles):
        given, own = words_and_unit(title)
        unit = own or unit
        axes = [w for w in given if w in AXES]
        rest = {w for w in given if w not in AXES}
        if len(axes) == 1 and rest & which and rest <= which | _ABOUT:
            found.setdefault(AXES[axes[0]], c)
    return [found[axis] for axis in sorted(found)], unit if found else ""


def _counted(titles: list[str], name: str) -> int | None:
    """The column that tells the finger, or the bone."""
    found = (
        c for c, t in enumerate(titles) if name in words(t) and {*words(t)} <= {name} | _COUNTED
    )
    return next(found, None)


def _fingers(texts: list[str]) -> list[int] | None:
    """Which finger each row is of; None where they are none."""
    numbers = _numbers(texts)
    if numbers is not None:
        return numbers if max(numbers) < len(FINGERS) else None
    said: dict[str, int | None] = {
        t: next((FINGER[w] for w in words(t) if w in FINGER), None) for t in dict.fromkeys(texts)
    }
    fingers = [f for t in texts if (f := said[t]) is not None]
    return fingers if len(fingers) == len(texts) else None


def _bones(texts: list[str]) -> list[int] | None:
    """Which bone each row is of, the metacarpal 0; None where they are none."""
    numbers = _numbers(texts)
    if numbers is not None:
        return numbers if max(numbers) < len(_BONES) else None
    known = {t: [PART[w] for w in words(t) if w in PART] for t in dict.fromkeys(texts)}
    if any(len(parts) != 1 or parts[0] >= len(_BONES) for parts in known.values()):
        return None
    return [known[t][0] for t in texts]


def _numbers(texts: list[str]) -> list[int] | None:
    """Whole numbers, counted from 0; None where one is none."""
    if not all(t.isdecimal() and len(t) < 3 for t in texts):
        return None
    numbers = [int(t) for t in texts]
    counted_from_one = min(numbers) == 1 and max(numbers) in (4, 5)
    return [n - counted_from_one for n in numbers]


def _measured(table: Table, titles: list[str], begin: list[int], end: list[int]) -> tuple[str, str]:
    """The unit that bones of this length are in, and a note that says so."""
    columns = [*begin, *end]
    places = table.numbers(columns, [titles[c] for c in columns])
    lengths = np.linalg.norm(places[:, 3:] - places[:, :3], axis=1)
    lengths = lengths[lengths > 0]
    if not lengths.size or not np.isfinite(lengths).any():
        return "", ""
    middle = float(np.nanmedian(lengths))
    unit = "m" if middle < 0.2 else "cm" if middle < 8 else "mm"
    return unit, f"bones of {middle:.3g} in the middle: read as {unit}"
