"""Tables of one row for each joint (frame, joint, x, y, z), as melted data frames are, made into
tables of one row for each frame."""

from __future__ import annotations

from dataclasses import replace

from handtrack.errors import InputError
from handtrack.sequences.names import AXES, words
from handtrack.sequences.readers.table_cells import MISSING, Table
from handtrack.sequences.titles import (
    is_confidence,
    is_frame_number,
    is_hand_label,
    is_hand_number,
    time_unit,
)

_JOINT = {"joint", "landmark", "keypoint", "kp", "bone", "bodypart", "bodyparts", "point", "marker"}
_ABOUT = {"id", "index", "idx", "name", "number", "no", "label", "type"}


def widened(table: Table) -> Table:
    """The table with one row a frame, where it has one a joint; else as it is.

    Raises:
        InputError: a joint stands twice in a frame.
    """
    titles = table.titles or []
    axes = {c: words(t) for c, t in enumerate(titles) if words(t)[:1] and words(t)[0] in AXES}
    names = [c for c, t in enumerate(titles) if _names_joints(t)]
    if len(axes) != 3 or len(names) != 1 or len({w[0] for w in axes.values()}) != 3:
        return table
    table.check_width()
    (name,) = names
    keys = [c for c, t in enumerate(titles) if c != name and _is_key(t)]
    values = [*axes, *(c for c, t in enumerate(titles) if is_confidence(t))]
    cells = [table.cells(row) for row in range(len(table.lines))]
    joints = list(dict.fromkeys(row[name] for row in cells if row[name].lower() not in MISSING))
    frames: dict[tuple[str, ...], dict[str, list[str]]] = {}
    places: list[int] = []
    count = 0
    for place, row in zip(table.places, cells, strict=True):
        key = tuple(row[c] for c in keys)
        if not keys:  # nothing counts frames: the first joint's return does
            count += bool(joints) and row[name] == joints[0]
            key = (str(count),)
        if key not in frames:
            frames[key] = {}
            places.append(place)
        if row[name] in frames[key]:
            raise InputError(
                f"line {place}: {titles[name]} {row[name][:40]} is there twice in one frame; rows"
                " of one frame need a frame number or a time",
                table.path,
            )
        if row[name].lower() not in MISSING:
            frames[key][row[name]] = [row[c] for c in values]
    wide = [titles[c] for c in keys]
    wide += [_title(joint, titles[c]) for joint in joints for c in values]
    separator = table.separator or "\t"
    blank = ["nan"] * len(values)
    lines = [
        separator.join([*(key if keys else ()), *(v for j in joints for v in seen.get(j, blank))])
        for key, seen in frames.items()
    ]
    return replace(table, lines=lines, places=places, separator=separator, titles=wide)


def _names_joints(title: str) -> bool:
    said = words(title)
    return bool(said) and said[0] in _JOINT and set(said[1:]) <= _ABOUT


def _is_key(title: str) -> bool:
    counts = time_unit(title) is not None or is_frame_number(title)
    return counts or is_hand_label(title) or is_hand_number(title)


def _title(joint: str, value: str) -> str:
    """ "wrist_x_mm" of "wrist" and "x_mm"; numbers get a word."""
    return f"{f'joint{joint}' if joint.isdigit() else joint}_{value}"
