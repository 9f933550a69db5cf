"""Text in which each place stands behind its joint's name, as loggers print it:

0.033; Wrist:0.1,0.2,0.3; ThumbCmc:0.1,0.2,0.3; ...        a frame a line
Frame 12                                                   or a line a joint
WRIST: (0.1, 0.2, 0.3)
"""

from __future__ import annotations

import re
from itertools import pairwise

from handtrack.sequences.names import as_side
from handtrack.sequences.readers.table_places import SEPARATOR
from handtrack.sequences.short_names import spelt_out
from handtrack.sequences.titles import column, is_frame_number, time_unit

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PLACE = rf"({_NUMBER})\s*[,;\s]\s*({_NUMBER})\s*[,;\s]\s*({_NUMBER})"
_NAME = r"([A-Za-z][\w .\-/]{0,60}?)"
_CELL = re.compile(rf"{_NAME}\s*(?:[:=]\s*[(\[]?|[(\[])\s*{_PLACE}\s*[)\]]?")
_SAID = re.compile(rf"{_NAME}\s*[:=]?\s*#?({_NUMBER})")
_LABEL = re.compile(r"(?:hand|handedness|side)?\s*[:=]?\s*(left|right)(?:[ _-]?hand)?\s*:?", re.I)
_EDGE = " \t,;|\"'{}[]"
_RULE = re.compile(r"[-=*_#\s]*")
_LOOKED_AT = 5
_FEWEST = 12
"""So many names must be joints."""
_MOST_LINES = 2_000_000
Lines = tuple[list[str], list[int]]


def as_table(lines: list[str], places: list[int]) -> Lines | None:
    """Lines as those of a table with titles, and their numbers; None of other text."""
    some = lines[1 : 1 + _LOOKED_AT] or lines
    if not all("(" in line or ":" in line or "=" in line or "[" in line for line in some[:2]):
        return None
    if len(lines) > _MOST_LINES:
        return None
    if all(sum(1 for _ in _CELL.finditer(line)) >= _FEWEST for line in some):
        return _of_frames(lines, places)
    return _of_joints(lines, places) if any(map(_CELL.search, some)) else None


def _are_joints(names: list[str]) -> bool:
    return sum(column(f"{name} x") is not None for name in spelt_out(names)) >= _FEWEST


def _row(about: dict[str, str], joints: dict[str, tuple[str, ...]]) -> dict[str, str]:
    return about | {
        f"{n} {a}": v for n, at in joints.items() for a, v in zip("xyz", at, strict=True)
    }


def _written(rows: list[dict[str, str]], at: list[int]) -> Lines:
    titles = list(dict.fromkeys(title for row in rows for title in row))
    body = [SEPARATOR.join(row.get(title, "") for title in titles) for row in rows]
    return [SEPARATOR.join(titles), *body], [at[0], *at]


def _of_frames(lines: list[str], places: list[int]) -> Lines | None:
    """A frame a line; the first line may be titles of what stands before the joints."""
    titles: list[str] = []
    if not _CELL.search(lines[0]):
        titles = [t.strip() for t in re.split(r"[,;|\t]", lines[0])]
        lines, places = lines[1:], places[1:]
    names = [m[1] for m in _CELL.finditer(lines[0])]
    if len(set(names)) < len(names) or not _are_joints(names):
        return None
    rows = []
    for line in lines:
        cells = list(_CELL.finditer(line))
        joints = {m[1]: m.groups()[1:] for m in cells}
        about = _about(line[: cells[0].start()] if cells else line, titles)
        if about is None or len(joints) < len(cells) or (cells and _rest(line, cells)):
            return None
        rows.append(_row(about, joints))
    return _written(rows, places)


def _rest(line: str, cells: list[re.Match[str]]) -> str:
    """What stands between and behind the cells, other than what separates them."""
    ends = [line[a.end() : b.start()] for a, b in pairwise(cells)]
    return "".join(part.strip(_EDGE) for part in (*ends, line[cells[-1].end() :]))


def _about(text: str, titles: list[str]) -> dict[str, str] | None:
    """What stands before the joints: times, frames, hands; None where it is not understood."""
    out: dict[str, str] = {}
    for i, part in enumerate(p.strip(_EDGE) for p in re.split(r"[,;|\t]+", text.strip(_EDGE))):
        said = _SAID.fullmatch(part)
        if not part:
            continue
        if said is not None:
            out[said[1]] = said[2]
        elif i < len(titles) and titles[i]:
            out[titles[i]] = part
        elif _LABEL.fullmatch(part):
            out["hand"] = part
        elif re.fullmatch(_NUMBER, part) and i == 0:
            out["frame" if part.isdigit() else "time"] = part
        else:
            return None
    return out


def _of_joints(lines: list[str], places: list[int]) -> Lines | None:
    """A line a joint: a name that comes again, or a line that names a frame, begins the next."""
    rows: list[dict[str, str]] = []
    at: list[int] = []
    about: dict[str, str] = {}
    joints: dict[str, tuple[str, ...]] = {}
    side = ""

    def close() -> None:
        nonlocal about, joints
        if joints:
            rows.append(_row(about, joints))
        joints = {}

    for line, place in zip(lines, places, strict=True):
        text = line.strip(_EDGE)
        cell = _CELL.fullmatch(text)
        if cell is not None:
            name = f"{side} {cell[1]}".strip()
            if name in joints:
                close()
            if not joints:
                at.append(place)
            joints[name] = cell.groups()[1:]
            continue
        said = _SAID.fullmatch(text.strip("-=*#: "))
        label = _LABEL.fullmatch(text)
        if said is not None and (is_frame_number(said[1]) or time_unit(said[1]) is not None):
            close()
            if said[1] in about:
                about = {}
            about = about | {said[1]: said[2]}
        elif label is not None:
            side = as_side(label[1]) or ""
        elif not _RULE.fullmatch(text):
            return None
    close()
    names = list(dict.fromkeys(t.rpartition(" ")[0] for row in rows[:3] for t in row))
    return _written(rows, at) if rows and _are_joints([n for n in names if n]) else None
