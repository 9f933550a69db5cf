"""Hands in one frame of JSON, however deep they stand: a list of them, one under each side's name,
joints under any of their names, or named joints themselves."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from handtrack.hand.skeleton import Hand
from handtrack.hand.units import Unit
from handtrack.sequences.names import KEPT, as_side
from handtrack.sequences.readers.axis_lists import axis_keys
from handtrack.sequences.readers.points import COUNTS, are_points
from handtrack.sequences.titles import (
    JointsKey,
    is_confidence,
    is_frame_number,
    is_hand_label,
    is_hand_number,
    joints_key,
    may_be_hand_label,
    side_key,
    time_unit,
)

CONTAINERS: tuple[str, ...] = (
    *("hands", "hand_data", "handData", "data", "payload", "msg", "message", "result", "results"),
    *("hand_tracking", "handTracking", "tracking", "detections", "people", "hand_poses", "poses"),
    *("hand", "frame", "inputSources", "input_sources"),
)
_3D = re.compile(r"(?<![0-9])3[dD](?![a-z])")
_HOLDERS = frozenset(CONTAINERS)
_TEXT, _PLAIN = {str}, {str, int, float, bool}
_TRUTHS = ("isright", "isleft", "isrighthand", "islefthand")
TRACKED = ("isTracked", "is_tracked", "tracked", "isValid", "is_valid", "isActive")
MOST_NAMES = 5000
"""An object of more names is no frame and no hand."""
MOST_HANDS = 4
"""Hands of a frame."""
_DEEPEST = 6
_FEWEST = 16
"""Objects with a place each that are a hand under any name."""
TEXTS: tuple[str, ...] = (
    "categoryName",
    "category_name",
    "label",
    "displayName",
    "display_name",
    "name",
    "hand",
)
JOINTS_TOO = ("items", "bones", "pose")


@dataclass
class Found:
    """One hand in one frame.

    Attributes:
        label: what tells left from right there, as it stands; None: nothing does.
        number: the hand's number, where hands have one.
        value: its joints, not yet read; None: not seen.
        key: the name under which they stand; "" where they are named joints.
        unit: the unit that the name states.
        confidence: of the hand or of each joint, as it stands.
        inside: the object in which they stand.
    """

    label: Any
    number: str
    value: Any
    key: str
    unit: Unit | None
    confidence: Any
    inside: dict[str, Any]


def hands_in(frame: Any, label: Any = None, depth: int = 0) -> list[Found]:
    """The hands of a frame, seen or not; none where nothing in it is a hand."""
    if isinstance(frame, list):
        if are_points(frame):
            return [Found(label, "", frame, "", None, None, {})]
        if depth > _DEEPEST:
            return []
        return [
            f for one in frame if isinstance(one, dict) for f in hands_in(one, label, depth + 1)
        ]
    if not isinstance(frame, dict) or depth > _DEEPEST or len(frame) > MOST_NAMES:
        return []
    if _PLAIN.issuperset(map(type, frame.values())):
        return []  # numbers and texts alone are no joints
    if not _TEXT.issuperset(map(type, frame)):
        frame = {str(k): v for k, v in frame.items()}
    kinds = _kinds(tuple(frame))
    if kinds.truths or kinds.labels or kinds.maybe:
        said = _label(frame, kinds, depth)
        label = said if said is not None else label
    sides = [(side, frame[k]) for k, side in kinds.sides]
    if sides and any(_is_hand(v, depth) or v is None for _, v in sides):
        return [f for side, v in sides for f in _of_side(side, v, depth)]
    keys = _joint_keys(frame, kinds) if kinds.joints else []
    if keys:
        return [f for key in keys for f in _under(frame, key, label)]
    if are_points(frame):
        found = _found(frame, frame, "", label)
        if axis_keys(frame) is not None and isinstance(found.confidence, list):
            found.confidence = None  # read with the joints
        return [found]
    for key in (*CONTAINERS, *JOINTS_TOO):
        inner = frame.get(key)
        if isinstance(inner, dict) or (isinstance(inner, list) and key != "hand"):
            inside = hands_in(inner, label, depth + 1)
            if inside:
                return inside
    for inner in frame.values():  # a list of joints tells itself, whatever it is called
        full = isinstance(inner, list) and len(inner) >= _FEWEST
        if full and are_points(inner) and all(isinstance(p, dict) for p in inner):
            return [_found(frame, inner, "", label)]
    return []


def is_blank(frame: Any) -> bool:
    """Whether nothing was seen in a frame: null, {}, [], or hands that are."""
    if not isinstance(frame, dict):
        return frame is None or (isinstance(frame, list) and all(map(is_blank, frame)))
    found = hands_in(frame)
    if found:
        return all(f.value is None for f in found)
    return all(value in (None, [], {}) or _is_about(str(key)) for key, value in frame.items())


def _is_about(key: str) -> bool:
    about = is_hand_label(key) or is_hand_number(key) or is_frame_number(key)
    return about or key in ("header", "stamp") or time_unit(key) is not None


def names_hands(frame: Any) -> bool:
    """Whether a frame has a place for each hand, and not only for the one that it is of."""
    if not isinstance(frame, dict):
        return isinstance(frame, list) and bool(frame) and isinstance(frame[0], dict)
    if any(isinstance(frame[k], list) for k in frame.keys() & _HOLDERS):
        return True
    return sum(side_key(str(k)) is not None for k in frame) > 1


def side_of(label: Any) -> Hand | None:
    """A label, in any of the ways in which MediaPipe and others give it, as a hand."""
    if isinstance(label, str):
        return as_side(label)
    return next((side for text in _texts(label) if (side := as_side(text)) is not None), None)


def _texts(label: Any, depth: int = 0) -> Iterator[Any]:
    if depth > _DEEPEST:
        return
    if isinstance(label, dict):
        for key in TEXTS:
            yield label.get(key)
        if depth < 3:
            for value in label.values():
                yield from _texts(value, depth + 1) if isinstance(value, list | dict) else ()
    elif isinstance(label, list):
        for value in label[:1]:
            yield from _texts(value, depth + 1)
    else:
        yield label


class _Kinds(NamedTuple):
    """What the names in an object say, whatever stands under them.

    Attributes:
        truths: names that a hand is right or left, with which.
        labels: names of what tells left from right; maybe: names under which it may stand.
        sides: names of hands, with which.
        joints: names of joints.
        numbers: names of hands' numbers; sure: of confidences.
    """

    truths: tuple[tuple[str, bool], ...]
    labels: tuple[str, ...]
    maybe: tuple[str, ...]
    sides: tuple[tuple[str, Hand], ...]
    joints: tuple[tuple[str, JointsKey], ...]
    numbers: tuple[str, ...]
    sure: tuple[str, ...]


@lru_cache(KEPT)
def _kinds(keys: tuple[str, ...]) -> _Kinds:
    bare = {k: k.lower().replace("_", "") for k in keys}
    truths = tuple((k, "right" in b) for k, b in bare.items() if b in _TRUTHS)
    return _Kinds(
        truths,
        tuple(k for k in keys if is_hand_label(k)),
        tuple(k for k in keys if may_be_hand_label(k)),
        tuple((k, side) for k in keys if (side := side_key(k)) is not None),
        tuple((k, s) for k in keys if (s := joints_key(k)) is not None and not s.truth),
        tuple(k for k in keys if is_hand_number(k)),
        tuple(k for k in keys if is_confidence(k)),
    )


def _label(frame: dict[str, Any], kinds: _Kinds, depth: int) -> Any:
    """What tells left from right in an object."""
    for key, right in kinds.truths:
        if isinstance(frame[key], bool):
            return "right" if frame[key] == right else "left"
    for key in kinds.labels:
        value = frame[key]
        if value is None or isinstance(value, bool) or _holds_hands(value, depth):
            continue
        return value
    texts = (frame[key] for key in kinds.maybe)
    return next((t for t in texts if isinstance(t, str) and as_side(t)), None)


def _holds_hands(value: Any, depth: int) -> bool:
    """Whether a value under a name of labels is no label, but the hands themselves."""
    if isinstance(value, dict):
        return _is_hand(value, depth) or side_of(value) is None
    if not isinstance(value, list):
        return False
    if value and isinstance(value[0], dict) and len(value) <= 2 and _is_category(value[0]):
        return False
    return any(isinstance(v, int | float) or v is None or _is_hand(v, depth) for v in value[:2])


def _is_hand(value: Any, depth: int) -> bool:
    return are_points(value) or bool(isinstance(value, dict) and hands_in(value, None, depth + 1))


def _of_side(side: Hand, value: Any, depth: int) -> list[Found]:
    inner = hands_in(value, side, depth + 1)
    for found in inner:
        found.label = side
    if inner or value is None or value in ([], {}) or isinstance(value, bool):
        return inner or [Found(side, "", None, "", None, None, {})]
    return []


def _is_category(value: dict[str, Any]) -> bool:
    """Whether an object is MediaPipe's of a name and a score."""
    return _PLAIN.issuperset(map(type, value.values()))


def _joint_keys(frame: dict[str, Any], kinds: _Kinds) -> list[str]:
    """The names in an object under which joints stand: MediaPipe's world landmarks and not those
    in the picture; the seen ones."""
    said = dict(kinds.joints)
    worlds = [k for k, s in said.items() if s.world and frame[k] is not None]
    if worlds and len(said) > len(worlds):
        return worlds
    seen = [k for k in said if frame[k] is not None]
    spatial = [k for k in seen if _3D.search(str(k))]
    if spatial and len(spatial) < len(seen):
        return spatial  # keypoints3D beside the picture's keypoints
    return seen or list(said)[:1]


def _under(frame: dict[str, Any], key: str, label: Any) -> list[Found]:
    value, said = frame[key], joints_key(key)
    side = None if said is None else said.hand
    label = label if side is None else side
    if value == [None]:  # one hand, which was not seen
        value = []
    if value == [] or value is None:
        return [_found(frame, None, key, label)] if value is None or label is not None else []
    if not _is_several(value):
        return [_found(frame, value, key, label)]
    found = []
    for i, one in enumerate(value):
        own = label[i] if isinstance(label, list) and i < len(label) else label
        found.append(_found(frame, _unwrapped(one), key, own))
        if side_of(own) is None:
            found[-1].number = str(i)
    return found


def _is_several(value: Any) -> bool:
    """Whether a list is of hands, not of joints."""
    if not isinstance(value, list) or are_points(value):
        return False
    return len(value) <= MOST_HANDS and any(
        (isinstance(v, list) and len(v) in COUNTS)
        or (isinstance(v, dict) and axis_keys(v) is not None)
        for v in map(_unwrapped, value)
    )


def _unwrapped(value: Any) -> Any:
    """The joints inside an object that holds nothing else, as MediaPipe's {"landmark": [...]}."""
    if isinstance(value, dict) and _TEXT.issuperset(map(type, value)):
        keys = _joint_keys(value, _kinds(tuple(value)))
        return value[keys[0]] if len(keys) == 1 else value
    return value


def _found(frame: dict[str, Any], value: Any, key: str, label: Any) -> Found:
    said = joints_key(key) if key else None
    kinds = _kinds(tuple(frame))
    number = next((frame[k] for k in kinds.numbers if frame[k] is not None), "")
    sure = next((frame[k] for k in kinds.sure if frame[k] is not None), None)
    if sure is None:
        sure = next((frame[k] for k in TRACKED if isinstance(frame.get(k), bool)), None)
    return Found(label, str(number), value, key, said.unit if said else None, sure, frame)
