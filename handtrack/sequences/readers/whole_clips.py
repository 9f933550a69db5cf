"""An object of JSON that holds all frames at once, as fields of a clip."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handtrack.sequences.names import as_side, words
from handtrack.sequences.readers.axis_lists import column_keys
from handtrack.sequences.readers.fields import RATES
from handtrack.sequences.readers.found import CONTAINERS, MOST_HANDS
from handtrack.sequences.readers.hands_or_frames import are_frames
from handtrack.sequences.readers.points import are_points, has_names
from handtrack.sequences.readers.spelling import ABOUT, LISTS
from handtrack.sequences.titles import is_hand_label, joints_key, side_key, time_unit

_DEEPEST = 3
_OF_HANDS = {"landmarks", "multi", "world", "hands"}


def as_clip(value: dict[str, Any]) -> dict[str, Any]:
    """The same with what frames of numbers stand for: `{"frames": [21 x 3, ...]}` as joints,
    `{"hands": {"left": [21 x 3, ...], ...}}` as the hands themselves."""
    for key in CONTAINERS:
        inner = value.get(key)
        if not isinstance(inner, dict) or not inner:
            continue
        if all(side_key(str(k)) is not None and _are_frames(v) for k, v in inner.items()):
            return {**{k: v for k, v in value.items() if k != key}, **inner}
    if any(joints_key(key) is not None for key in value):
        return value
    for key in LISTS:
        if _is_list_of_frames(value.get(key)) and not any(map(has_names, value[key])):
            return {**{k: v for k, v in value.items() if k != key}, "joints": value[key]}
    return value


def unwrapped(value: dict[str, Any], path: Path, depth: int = 0) -> dict[str, Any]:
    """The same with a clip that stands whole under a name of no meaning of its own
    (`{"data": {"fps": 30, "joints": [...]}}`) where its own names are."""
    inner = [(k, v) for k, v in value.items() if isinstance(v, dict) and k not in ABOUT]
    if len(inner) != 1 or depth == _DEEPEST:
        return value
    key, clip = inner[0]
    lists = any(isinstance(v, list) for v in value.values())
    if lists or joints_key(key) is not None or side_key(key) is not None:
        return value
    clip = unwrapped(clip, path, depth + 1)
    if not _holds_all_frames(clip, path):
        return value
    return {k: v for k, v in value.items() if k != key} | clip


def _holds_all_frames(clip: dict[str, Any], path: Path) -> bool:
    """Whether lists of frames stand under an object's names of joints or of hands."""
    several = [
        v
        for k, v in clip.items()
        if (joints_key(k) is not None or side_key(k) is not None) and _is_list_of_frames(v)
    ]
    return any(len(v) > MOST_HANDS for v in several) or is_clip(clip, path)


def is_clip(value: dict[str, Any], path: Path) -> bool:
    """Whether lists of as few frames as a frame may have hands are frames all the same.

    A label or a rate of all, a time for each, or plain numbers say so; a label for each says that
    they are hands; under MediaPipe's names it is told from where they are.

    Raises:
        InputError: they may be either.
    """
    several = {
        key: v
        for key, v in value.items()
        if joints_key(key) is not None and _is_list_of_frames(v) and 2 <= len(v) <= MOST_HANDS
    }
    if not several:
        return False
    labels = [v for key, v in value.items() if is_hand_label(key)]
    if any(isinstance(v, list | dict) for v in labels):
        return False
    sizes = {len(v) for v in several.values()}
    times = [v for key, v in value.items() if time_unit(key) is not None]
    if any(isinstance(v, list) and len(v) in sizes for v in times):
        return True
    if any(isinstance(v, str) and as_side(v) for v in labels):
        return True
    if any(key.lower() in RATES for key in value):
        return True
    objects = any(isinstance(p, dict) for v in several.values() for f in v if f for p in f[:1])
    named = any(_OF_HANDS & set(words(key)) for key in several)
    if not (named and objects):
        return not times
    if labels or times:
        return False
    return all(are_frames(v, key, path) for key, v in several.items())


def _are_frames(value: Any) -> bool:
    columns = isinstance(value, dict) and column_keys(value) is not None
    return columns or _is_list_of_frames(value)


def _is_list_of_frames(value: Any) -> bool:
    if not isinstance(value, list) or are_points(value):
        return False
    some = [f for f in value[:MOST_HANDS] if f]
    return bool(some) and all(isinstance(f, list) and are_points(f) for f in some)
