"""Objects of JSON that hold all frames: as fields of a clip, under numbers, in lists further in."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.names import as_side, words
from handtrack.sequences.readers.axis_lists import column_keys
from handtrack.sequences.readers.fields import RATES
from handtrack.sequences.readers.found import CONTAINERS, MOST_HANDS, hands_in
from handtrack.sequences.readers.points import are_points, has_names, read_points
from handtrack.sequences.readers.raw import Array
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


def with_frames_above(value: dict[str, Any]) -> dict[str, Any]:
    """With a long list of frames that stands two names deep (`{"data": {"results": [...]}}`)."""
    for key in {*LISTS, *CONTAINERS} & value.keys():
        inner = value[key] if isinstance(value[key], dict) else {}
        lists = [inner[k] for k in {*LISTS, *CONTAINERS} & inner.keys()]
        if any(isinstance(v, list) and len(v) > MOST_HANDS and not are_points(v) for v in lists):
            return {k: v for k, v in value.items() if k != key} | inner
    return value


def with_what_it_says(value: dict[str, Any]) -> dict[str, Any]:
    """With what an object inside says of all frames (`{"info": {"fps": 60}, ...}`)."""
    said = {
        key: inner
        for name in ABOUT
        if isinstance(part := value.get(name), dict)
        for key, inner in part.items()
        if isinstance(inner, str | int | float)
    }
    return {**said, **value}


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


_MOVED = 0.12
"""Of its size a hand moves so far between two frames, at most."""
_APART = 0.5
"""Two hands are so far from each other, or turned so far."""


def are_frames(lists: list[Any], name: str, path: Path) -> bool:
    """Whether lists of landmarks are frames of one hand.

    Raises:
        InputError: they may be either.
    """
    try:
        hands = [read_points(one, name, path).joints for one in lists if one]
    except InputError:
        return False  # said where they are read
    if len(hands) < 2 or len({hand.shape for hand in hands}) > 1:
        return False
    steps = [_step(a, b) for a, b in pairwise(hands)]
    if max(steps) < _MOVED:
        return True
    if max(steps) > _APART:
        return False
    raise InputError(
        f"{name} holds {len(lists)} lists of landmarks, which may be frames of one hand or hands in"
        f" one frame: for frames pass --key {name} (load(key=...)) or say the fps in the file, for"
        " hands name them (handedness)",
        path,
    )


def _step(a: Array, b: Array) -> float:
    """How far apart two hands are, in sizes of the first; far where one mirrors the other."""
    both = np.isfinite(a).all(1) & np.isfinite(b).all(1)
    if both.sum() < 4:
        return np.inf
    a, b = a[both], b[both]
    size = float(np.ptp(a, axis=0).max())
    if size <= 0:
        return np.inf
    return float(np.linalg.norm(a - b, axis=1).mean()) / size


_NUMBER = re.compile(
    r"(?i)((?:frame|f|image|img|t)?[_ ]?)(\d{1,12})(?:\.(?:jpe?g|png|bmp|tiff?|webp))?"
)


def by_number(value: dict[str, Any]) -> list[Any]:
    """Frames under their numbers ("12", "frame_0012"), each with it; none where it is not so."""
    if len(value) > 1 and all(re.fullmatch(r"\d{1,10}\.\d{1,9}", key) for key in value):
        return [{"time": float(t)} | v for t, v in value.items() if isinstance(v, dict)]
    said = [_NUMBER.fullmatch(key) for key in value]
    if len(value) < 2 or not all(said) or len({m[1].lower() for m in said if m is not None}) > 1:
        return []
    numbers = {int(m[2]): v for m, v in zip(said, value.values(), strict=True) if m is not None}
    if all(v in (None, []) or (isinstance(v, list) and are_points(v)) for v in value.values()):
        return [{"frame": n, "joints": numbers[n] or None} for n in sorted(numbers)]
    if not all(v is None or isinstance(v, dict) for v in numbers.values()) or are_points(value):
        return []
    if not any(map(hands_in, numbers.values())):
        return []
    return [{"frame": n} | (numbers[n] or {}) for n in sorted(numbers)]
