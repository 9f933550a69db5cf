"""Reader of tables with a row for each joint: frame, hand, joint, x, y, z, in any order; and of
the same with a row for each number, as pandas melts them."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import Hand
from handtrack.sequences.clips import runs
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.columns_at_once import Coded
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.long_columns import LongColumns
from handtrack.sequences.readers.pictures import flat, seen_in_picture
from handtrack.sequences.readers.raw import Array, Raw, stem, usable_confidence
from handtrack.sequences.readers.table_cells import Table
from handtrack.sequences.readers.table_columns import Columns, other_columns
from handtrack.sequences.readers.table_rows import between, by_hand, filled, label_column, stamps_in
from handtrack.sequences.titles import is_frame_number

_NEAR = 200
"""Two rows of one joint are of two hands where they stand so few lines apart."""
_NUMBER = re.compile(r"\d{1,18}")


@dataclass
class _Groups:
    """Rows that make one hand at one moment.

    Attributes:
        of_row: (rows,) each row's group.
        first: each group's first row.
        frame: each group's frame, as an index in time's order.
        hand: the hand in the joint's name; `second` where a frame has two without a name.
        second: 0 or 1.
        begins: the first row of each frame.
        numbers: (frames,) the frames' numbers, where there are any.
    """

    of_row: NDArray[np.int64]
    first: list[int]
    frame: list[int]
    hand: list[Hand | None]
    second: list[int]
    begins: list[int]
    numbers: NDArray[np.int64] | None


def read_long(titles: list[str], long: LongColumns) -> list[Raw]:
    """The sequences of a table of one row for each joint (or each number), one per hand.

    A joint without a row is missing, a frame number without rows a frame in which nothing was
    seen.

    Raises:
        InputError: a joint twice in a frame, a cell that is no number, or joints in a picture.
    """
    table, path = long.table, long.table.path
    columns = other_columns(titles, long.all, path)
    label = label_column(table, columns)
    keys = _frame_keys(table, titles, columns, long)
    at = _frame_of(keys)
    labels = None if label is None else table.coded(label)
    tracks = None if columns.number is None else table.coded(columns.number)
    groups = _grouped_at_once(long, at, labels, tracks)
    clips = runs(at) if groups is None else []
    if clips:
        return _of_clips(titles, long, clips)
    if groups is None:
        groups = _grouped(table, titles, long, at, labels, tracks)
    groups.numbers = None if keys[1] is None else np.unique(keys[1])
    joints, confidence = _placed(table, titles, long, groups)
    small = replace(
        table,
        lines=[table.lines[i] for i in groups.first],
        places=[table.places[i] for i in groups.first],
    )
    frames = replace(
        table,
        lines=[table.lines[i] for i in groups.begins],
        places=[table.places[i] for i in groups.begins],
    )
    stamps, note = stamps_in(frames, titles, columns)
    notes = [note] if note else []
    unused = [*columns.unused, *(titles[c] for c in columns.maybe_label if c != label)]
    if unused:
        notes.append(f"columns not used: {', '.join(unused[:8])}")
    raw = Raw(joints, path, stem(path), confidence=confidence, unit=long.unit, order=long.order)
    raw.frame_index = np.array(groups.frame, dtype=np.int64)
    raw = flat(raw) if len(long.axes) == 2 else raw
    parts: list[Raw] = []
    for hand in dict.fromkeys(groups.hand):
        for second in sorted(set(groups.second)):
            rows = [
                i
                for i, k in enumerate(zip(groups.hand, groups.second, strict=True))
                if k == (hand, second)
            ]
            if rows:
                some = _taken(raw, rows, hand)
                if max(groups.second):
                    some.name = f"{raw.name} hand {second}"
                of = replace(
                    small,
                    lines=[small.lines[i] for i in rows],
                    places=[small.places[i] for i in rows],
                )
                parts += by_hand(some, of, titles, columns, label)
    parts[0].notes = (*notes, *parts[0].notes)
    return [_timed(part, stamps, groups, parts, table.normalised) for part in parts]


def _taken(raw: Raw, rows: list[int], hand: Hand | None) -> Raw:
    confidence = None if raw.confidence is None else raw.confidence[rows]
    index = None if raw.frame_index is None else raw.frame_index[rows]
    return replace(
        raw, joints=raw.joints[rows], confidence=confidence, frame_index=index, hand=hand
    )


def _frame_keys(
    table: Table, titles: list[str], columns: Columns, long: LongColumns
) -> tuple[NDArray[np.int64], NDArray[np.int64] | None]:
    """What tells one frame's rows from another's, and the frames' numbers."""
    if columns.frame is not None:
        said = table.coded(columns.frame)
        if all(map(str.isdigit, said.texts)):
            values = np.array([float(t) for t in said.texts])[said.codes]
            numbers = frame_numbers(values, len(values), table.path, titles[columns.frame])
            return numbers, numbers
        found = [_NUMBER.findall(t) for t in said.texts]  # names of pictures
        if all(found) and len({len(f) for f in found}) == 1:
            last = np.array([int(f[-1]) for f in found], dtype=np.int64)
            if len(np.unique(last)) == len(last):
                return last[said.codes], last[said.codes]
        return said.codes, None
    named = next((c for c, t in enumerate(titles) if is_frame_number(t)), None)
    if columns.times or named is not None:
        return table.coded(titles.index(columns.times[0]) if named is None else named).codes, None
    return _counted(table, long), None


def _counted(table: Table, long: LongColumns) -> NDArray[np.int64]:
    """Frames of rows without numbers or times: one begins where the joints begin again."""
    _, first, codes = np.unique(long.codes, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))[codes.ravel()]
    return np.concatenate([[0], np.cumsum(np.diff(rank) <= 0)]).astype(np.int64)


def _of_clips(titles: list[str], long: LongColumns, clips: list[tuple[int, int]]) -> list[Raw]:
    """The sequences of each clip of a table in which frames begin again."""
    raws = []
    for k, (a, b) in enumerate(clips, 1):
        rows = replace(long.table, lines=long.table.lines[a:b], places=long.table.places[a:b])
        for raw in read_long(titles, replace(long, table=rows, codes=long.codes[a:b])):
            raws.append(replace(raw, name=f"{raw.name} clip {k}"))
    line = long.table.places[clips[1][0]]
    note = f"frames begin again at line {line}: cut into {len(clips)} clips"
    raws[0].notes = (note, *raws[0].notes)
    return raws


def _frame_of(
    keys: tuple[NDArray[np.int64], NDArray[np.int64] | None],
) -> NDArray[np.int64]:
    """(rows,) each row's frame, as an index in order of numbers, or of first rows."""
    given, numbers = keys
    if numbers is not None:
        return _sorted_apart(numbers)[1]
    return given


def _grouped(
    table: Table,
    titles: list[str],
    long: LongColumns,
    at: NDArray[np.int64],
    labels: Coded | None,
    tracks: Coded | None,
) -> _Groups:
    """The groups where a joint may stand twice in a frame, of two hands without names."""
    frame = at.tolist()
    sides = [""] * len(frame) if labels is None else labels.all()
    numbers = [""] * len(frame) if tracks is None else tracks.all()
    begins: dict[int, int] = {}
    seen: dict[tuple[object, ...], int] = {}
    index: dict[tuple[object, ...], int] = {}
    groups = _Groups(np.zeros(len(frame), np.int64), [], [], [], [], [], None)
    for i, code in enumerate(long.codes.tolist()):
        hand, joint, axis = long.slots[code]
        begins.setdefault(frame[i], i)
        key = (frame[i], hand, sides[i], numbers[i])
        second = 0
        if joint is not None:
            one = (*key, joint, axis)
            before = seen.get(one)
            if before is None:
                seen[one] = i
            else:
                second = _second(table, titles, long, i, before, (*one, 1) in seen)
                seen[*one, 1] = i
                if hand is not None or sides[i] or numbers[i]:
                    raise InputError(_twice(table, titles, long, before, i), table.path)
        group = index.setdefault((*key, second), len(index))
        if group == len(groups.first):
            groups.first.append(i)
            groups.frame.append(frame[i])
            groups.hand.append(hand)
            groups.second.append(second)
        groups.of_row[i] = group
    groups.begins = [begins[k] for k in range(len(begins))]
    return groups


def _grouped_at_once(
    long: LongColumns, at: NDArray[np.int64], labels: Coded | None, tracks: Coded | None
) -> _Groups | None:
    """The groups where no joint stands twice in a frame; None where one does."""
    codes = long.codes
    hands = list(dict.fromkeys(hand for hand, _, _ in long.slots))
    hand_of = np.array([hands.index(hand) for hand, _, _ in long.slots], dtype=np.int64)
    label, n_labels = _coded(labels)
    track, n_tracks = _coded(tracks)
    hand = hand_of[codes]
    key = ((at * len(hands) + hand) * n_labels + label) * n_tracks + track
    joint = np.array([-1 if j is None else j for _, j, _ in long.slots], dtype=np.int64)[codes]
    axis = np.array([3 if a is None else a for _, _, a in long.slots], dtype=np.int64)[codes] + 1
    one = (key * (long.n_joints + 1) + joint) * 5 + axis
    one = one[joint >= 0]
    if _repeats(one):
        return None
    first, group = _sorted_apart(key)
    order = np.argsort(first, kind="stable")  # as they come in the file
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first = first[order]
    begins, _ = _sorted_apart(at)
    return _Groups(
        rank[group],
        first.tolist(),
        at[first].tolist(),
        [hands[h] for h in hand[first].tolist()],
        [0] * len(first),
        begins.tolist(),
        None,
    )


def _repeats(values: NDArray[np.int64]) -> bool:
    """Whether any of some numbers from 0 stands twice."""
    if not len(values):
        return False
    if values.max() < 20 * len(values) + 1000:
        return bool(np.bincount(values).max() > 1)
    ordered = np.sort(values)
    return bool((ordered[1:] == ordered[:-1]).any())


def _sorted_apart(values: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first row of each different value, in their order, and of each row which value it is."""
    steps = np.diff(values)
    if (steps >= 0).all():  # the usual case
        begins = np.concatenate([[0], np.flatnonzero(steps) + 1]).astype(np.int64)
        return begins[: len(values)], np.concatenate([[0], np.cumsum(steps > 0)])[: len(values)]
    _, first, which = np.unique(values, return_index=True, return_inverse=True)
    return first, which.ravel()


def _coded(said: Coded | None) -> tuple[NDArray[np.int64] | int, int]:
    """What each row says as a number, and how many there are; None: all the same."""
    return (0, 1) if said is None else (said.codes, max(len(said.texts), 1))


def _second(
    table: Table, titles: list[str], long: LongColumns, row: int, before: int, third: bool
) -> int:
    if third or table.places[row] - table.places[before] > _NEAR:
        raise InputError(_twice(table, titles, long, before, row), table.path)
    return 1


def _twice(table: Table, titles: list[str], long: LongColumns, first: int, second: int) -> str:
    name = table.texts(long.names[0])[second]
    return (
        f"line {table.places[second]}: {titles[long.names[0]]} {name[:40]} of this frame stands in"
        f" line {table.places[first]} too: a column named hand tells hands apart, one named frame"
        " frames"
    )


def _placed(
    table: Table, titles: list[str], long: LongColumns, groups: _Groups
) -> tuple[Array, Array | None]:
    """(groups, N, 3) joints and (groups, N) confidence."""
    values = table.numbers(long.axes, [titles[c] for c in long.axes])
    joints = np.full((len(groups.first), long.n_joints, 3), np.nan)
    sure = np.ones(joints.shape[:2])
    codes = long.codes
    joint_of = np.array([-1 if j is None else j for _, j, _ in long.slots], dtype=np.int64)
    axis_of = np.array([3 if a is None else a for _, _, a in long.slots], dtype=np.int64)
    joint, axis = joint_of[codes], axis_of[codes]
    whole = (joint >= 0) & (axis == 3)
    joints[groups.of_row[whole], joint[whole], : values.shape[1]] = values[whole]
    one = (joint >= 0) & (axis >= 0) & (axis < 3)
    joints[groups.of_row[one], joint[one], axis[one]] = values[one, 0]
    confident = (joint >= 0) & (axis == -1)
    sure[groups.of_row[confident], joint[confident]] = values[confident, 0]
    if long.sure is not None:
        given = table.numbers([long.sure], [titles[long.sure]])[:, 0]
        at = joint >= 0
        sure[groups.of_row[at], joint[at]] *= given[at]
    elif not confident.any():
        return joints, None
    return joints, usable_confidence(sure, joints)


def _timed(
    raw: Raw, stamps: Stamps | None, groups: _Groups, parts: list[Raw], normalised: bool
) -> Raw:
    """One hand in all frames, with their times and numbers."""
    at = raw.frame_index if raw.frame_index is not None else np.arange(len(raw.joints))
    n = len(groups.begins)
    alone = len(parts) > 1 and sum(len(p.joints) for p in parts) == n
    frames = at if alone else np.arange(n)
    numbers = None if groups.numbers is None else groups.numbers[frames]
    if stamps is not None:
        stamps = stamps.take(frames)
    place = np.searchsorted(frames, at)
    fill = numbers is not None and not alone and filled(numbers, stamps)
    if fill and numbers is not None:
        every = np.arange(numbers[0], numbers[-1] + 1)
        place = numbers[place] - numbers[0]
        stamps = None if stamps is None else between(stamps, numbers, every)
        numbers = every
        n = len(every)
    length = len(frames) if numbers is None else len(numbers)
    joints = np.full((length, *raw.joints.shape[1:]), np.nan)
    joints[place] = raw.joints
    confidence = None
    if raw.confidence is not None:
        confidence = np.ones(joints.shape[:2])
        confidence[place] = raw.confidence
    out = replace(raw, joints=joints, confidence=confidence, stamps=stamps, frame_index=numbers)
    return out if out.picture else seen_in_picture(out, normalised)
