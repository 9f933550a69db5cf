"""Frames of hands in JSON, one record each, as sequences: one of each hand.

What a source is, whose hand, how fast: the records that hold something say it; one that holds
nothing (null, {}, [], a hand that is null) is a frame in which nothing was seen.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import words
from handtrack.sequences.readers.beside_world import with_pictures, without_world
from handtrack.sequences.readers.fields import RATES, UNIT_KEYS, detector_of
from handtrack.sequences.readers.found import Found, hands_in, names_hands, side_of
from handtrack.sequences.readers.joint_frames import as_frames
from handtrack.sequences.readers.jsontext import blanks_as_null
from handtrack.sequences.readers.pictures import seen_in_picture
from handtrack.sequences.readers.points import are_points, read_points
from handtrack.sequences.readers.points_together import read_many
from handtrack.sequences.readers.raw import (
    Array,
    NotJointsError,
    Raw,
    as_fps,
    as_hand,
    as_unit,
    stem,
    usable_confidence,
)
from handtrack.sequences.readers.record_kinds import frames_among, refuse_meant
from handtrack.sequences.readers.record_places import Picked, frame_index_of, stamps_of


class Key(NamedTuple):
    """What tells one hand's records from another's."""

    hand: Hand | None
    number: str


@dataclass
class _Hand:
    """One hand's records."""

    rows: list[int] = field(default_factory=list)
    found: dict[int, Found] = field(default_factory=dict)


def read_records(
    values: Items[Any],
    places: Items[str],
    path: Path,
    about: dict[str, Any] | None = None,
    logged: Stamps | None = None,
) -> list[Raw]:
    """The sequences of frames, one per hand.

    Args:
        values: decoded frames.
        places: where each stands, for messages ("line 3").
        path: the file.
        about: what the file says of all of them: unit, order, fps, hand, name, subject.
        logged: times from outside of the records, where they have none.

    Raises:
        NotJointsError: no hand in any frame.
        InputError: a frame or a joint that cannot be read.
    """
    found = records_by_hand(values, places, path, about, logged)
    raws = [hand.raw if hand.world else seen_in_picture(hand.raw) for hand in found]
    if not any(hand.world for hand in found):
        return raws
    beside = without_world(list(values))
    try:
        shown = [hand.raw for hand in records_by_hand(beside, places, path, about, logged)]
    except InputError:  # nothing in a picture
        return raws
    return with_pictures(raws, shown, values, about)


class HandRecords(NamedTuple):
    """One hand's sequence, which of the records are its frames, and whether these call its joints
    those in the world."""

    raw: Raw
    rows: list[int]
    world: bool


def records_by_hand(
    values: Items[Any],
    places: Items[str],
    path: Path,
    about: dict[str, Any] | None = None,
    logged: Stamps | None = None,
) -> list[HandRecords]:
    """As `read_records`, not asked yet whether joints are in a picture."""
    about = about or {}
    values = blanks_as_null(list(values))
    frames = frames_among(values)
    if len(frames) < len(values):
        whole = {
            k: v for i in sorted({*range(len(values))} - {*frames}) for k, v in values[i].items()
        }
        plain = {k: v for k, v in whole.items() if k in (*UNIT_KEYS, *RATES, "order", "subject")}
        of_frames = records_by_hand(
            [values[i] for i in frames],
            Picked(places, frames),
            path,
            {**plain, **about},
            None if logged is None else logged.take(frames),
        )
        note = f"{len(values) - len(frames)} records of {len(values)} are of another kind: left out"
        for one in of_frames[:1]:
            one.raw.notes = (*one.raw.notes, note)
        return [one._replace(rows=[frames[i] for i in one.rows]) for one in of_frames]
    hands = _grouped(values, places, path, about)
    refuse_meant(values, places, path)
    said = {k: _first(values, (k,), about) for k in ("order", "name", "subject")}
    unit, rate = (_first(values, keys, about) for keys in (UNIT_KEYS, RATES))
    out = []
    for key, hand in hands.items():
        joints, confidence = _joints(hand, places, path)
        raw = Raw(joints, path, str(said["name"] or stem(path)), hand=key.hand)
        raw.confidence = confidence
        raw.by_number = key.hand is None and any(_is_number(f.label) for f in hand.found.values())
        units = {f.unit for f in hand.found.values() if f.value is not None and f.unit}
        if len(units) > 1:
            raise InputError("the joints' names state different units", path)
        raw.unit = units.pop() if units else None
        if raw.unit is None and unit is not None:
            raw.unit = as_unit(unit, path)
        raw.order = None if said["order"] is None else str(said["order"])
        raw.fps = None if rate is None else as_fps(rate, path)
        raw.subject = str(said["subject"] or "")
        if key.number and sum(k.hand == key.hand for k in hands) > 1:
            raw.name = f"{raw.name} hand {key.number}"
        rows = [values[i] for i in hand.rows]
        inside = [hand.found[i].inside if i in hand.found else None for i in hand.rows]
        at = Picked(places, hand.rows)
        own = stamps_of(rows, at) or stamps_of(inside, at)
        raw.stamps = own or (None if logged is None else logged.take(hand.rows))
        raw.frame_index = frame_index_of(rows, path)
        world = any(f.key and "world" in words(f.key) for f in hand.found.values())
        raw.detector = next((d for f in hand.found.values() if (d := detector_of(f.key))), "")
        out.append(HandRecords(raw, hand.rows, world))
    return out


def _first(values: Items[Any], names: Items[str], about: dict[str, Any]) -> Any:
    for name in names:
        found = (v[name] for v in values if isinstance(v, dict) and v.get(name) is not None)
        value = next((v for v in found if isinstance(v, str | int | float)), about.get(name))
        if value is not None:
            return value
    return None


def _grouped(
    values: Items[Any], places: Items[str], path: Path, about: dict[str, Any]
) -> dict[Key, _Hand]:
    """The records of each hand, in order of their names."""
    found: list[list[tuple[Key, Found]]] = []
    for i, value in enumerate(values):
        if not isinstance(value, dict | list | None):
            raise InputError(f"{places[i]} is no frame: expected an object or a list", path)
        found.append([(_key(f, places, i, path, about), f) for f in hands_in(value)])
    found = _by_place(found)
    _check_kinds(values, places, found, path)
    seen = {key for of in found for key, f in of if f.value is not None}
    if not seen:
        raise NotJointsError(_nothing(values, places), path)
    named: set[Hand | None] = {key.hand for key in seen if key.hand} or {
        key.hand for of in found for key, _ in of
    }
    by_number = any(len({k.hand for k, _ in of}) < len(of) for of in found) or not any(named)
    hands: dict[Key, _Hand] = {}
    for i, of in enumerate(found):
        for key, one in of:
            side = key.hand
            if side is None and len(named) == 1:
                side = next(iter(named))  # it was not named while it was not seen
            if side is None and one.value is None:
                continue
            key = Key(side, key.number if by_number else "")
            hand = hands.setdefault(key, _Hand())
            if i in hand.found:
                raise InputError(f"{places[i]}: two {side or 'unnamed'} hands", path)
            hand.found[i] = one
    together = any(len(of) > 1 for of in found) or any(map(names_hands, values))
    for hand in hands.values():
        # a file of one hand a line: the other's lines are not its frames
        everything = together or len(hands) == 1
        hand.rows = list(range(len(values))) if everything else sorted(hand.found)
    kept = {k: h for k, h in hands.items() if any(f.value is not None for f in h.found.values())}
    return dict(sorted(kept.items(), key=lambda item: (item[0].hand or "", item[0].number)))


def _by_place(found: list[list[tuple[Key, Found]]]) -> list[list[tuple[Key, Found]]]:
    """Hands of frames that nothing tells apart, by their places in the frames' lists."""
    bare = Key(None, "")
    if not any(len(of) > 1 for of in found) or any(key != bare for of in found for key, _ in of):
        return found
    return [[(Key(None, str(k)), one) for k, (_, one) in enumerate(of)] for of in found]


def _key(found: Found, places: Items[str], i: int, path: Path, about: dict[str, Any]) -> Key:
    label = about.get("hand", about.get("handedness")) if found.label is None else found.label
    if label is None or label == "":
        return Key(None, found.number)
    side = side_of(label)
    if side is None:
        if _is_number(label):
            return Key(None, found.number or str(label))
        if isinstance(label, list) and not label:
            return Key(None, found.number)
        return Key(as_hand(label, path, f"{places[i]}: hand"), found.number)
    return Key(side, found.number)


def _is_number(label: Any) -> bool:
    return isinstance(label, int | float) and not isinstance(label, bool) and label in (0, 1)


def _check_kinds(
    values: Items[Any], places: Items[str], found: list[list[tuple[Key, Found]]], path: Path
) -> None:
    """Lists among objects are frames like them, or nothing is."""
    if not any(isinstance(v, dict) for v in values):
        return
    for i, (value, of) in enumerate(zip(values, found, strict=True)):
        if isinstance(value, list) and value and not of:
            raise InputError(f"{places[i]} is not an object, others are", path)


def _nothing(values: Items[Any], places: Items[str]) -> str:
    full = [i for i, v in enumerate(values) if isinstance(v, dict) and v]
    if not full:
        return "every frame is missing"
    most = max(full[:50], key=lambda i: len(values[i]))
    value, place = values[most], places[most]
    there = ", ".join(str(k)[:30] for k in list(value)[:8])
    return f"no joints in it: expected joints_m or joints, {place} has {there}"


def _joints(hand: _Hand, places: Items[str], path: Path) -> tuple[Array, Array | None]:
    """(T, N, 3) and (T, N) of one hand; frames in which it was not seen are NaN."""
    at = [k for k, i in enumerate(hand.rows) if i in hand.found and hand.found[i].value is not None]
    given = [hand.found[hand.rows[k]] for k in at]
    where = Picked(places, [hand.rows[k] for k in at])
    frames, sure = _together(given, where, path) or _one_by_one(given, where, path)
    sure = None if sure is None else usable_confidence(sure)
    joints = np.full((len(hand.rows), *frames.shape[1:]), np.nan)
    joints[at] = frames
    confidence = np.ones(joints.shape[:2])
    if sure is not None:
        confidence[at] = sure
    whole = _whole_confidence(given, where, frames.shape[1], path)
    if sure is None and whole is None:
        return joints, None
    if whole is not None:
        confidence[at] *= whole
    return joints, usable_confidence(confidence)


def _together(
    given: list[Found], places: Items[str], path: Path
) -> tuple[Array, Array | None] | None:
    """Lists of numbers all at once, which is fast; None where they are anything else."""
    values = [f.value for f in given]
    many = read_many(values) if given else None
    if many is not None:
        return many.joints, many.confidence
    if not all(isinstance(v, list) and v and _plain(v) for v in values):
        return None
    try:
        array = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        return None
    if array.ndim == 4 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim == 3 and array.shape[2] != 3:
        return None
    if array.ndim not in (2, 3):
        return None
    key = given[0].key or "the list"
    return as_frames(array, path, f"{places[0]}: {key}"), None


def _plain(value: list[Any]) -> bool:
    return isinstance(value[0], list | int | float)


def _one_by_one(given: list[Found], places: Items[str], path: Path) -> tuple[Array, Array | None]:
    frames: list[Array] = []
    sure: list[Array] = []
    any_sure = False
    for found, place in zip(given, places, strict=True):
        what = f"{place}: {found.key}" if found.key else place
        if isinstance(found.value, dict) or are_points(found.value):
            points = read_points(found.value, what if found.key else place, path)
            joints, confidence = points.joints, points.confidence
        else:
            whole = as_frames(found.value, path, what)
            if len(whole) != 1:
                raise InputError(f"{what} holds {len(whole)} frames, expected one", path)
            joints, confidence = whole[0], None
        if frames and joints.shape != frames[0].shape:
            raise InputError(
                f"{place} has {len(joints)} joints, others have {len(frames[0])}", path
            )
        any_sure = any_sure or confidence is not None
        frames.append(joints)
        sure.append(np.ones(len(joints)) if confidence is None else confidence)
    return np.stack(frames), np.stack(sure) if any_sure else None


def _whole_confidence(given: list[Found], places: Items[str], n: int, path: Path) -> Array | None:
    """(T, N) of what stands beside the joints; frames without one count fully."""
    if all(f.confidence is None for f in given):
        return None
    rows = np.ones((len(given), n))
    for row, found, place in zip(rows, given, places, strict=True):
        if found.confidence is None or isinstance(found.confidence, dict):
            continue
        try:
            array = np.array(found.confidence, dtype=np.float64)
        except (ValueError, TypeError, OverflowError):
            raise InputError(f"{place}: confidence is not a list of numbers", path) from None
        if array.shape not in ((), (1,), (n,)):
            raise InputError(f"{place}: confidence has shape {array.shape}, expected ({n},)", path)
        row[:] = array
    return rows
