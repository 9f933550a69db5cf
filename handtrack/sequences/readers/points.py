"""The joints of one hand in one frame, in any of the forms that JSON gives them.

    [[x, y, z], ...] | [x, y, z, x, ...] | [{"x", "y", "z", "visibility"}, ...]
    [{"name": "wrist", "position": ...}, ...] | {"wrist": point, "thumb_tip": point, ...}
    [["wrist", x, y, z], ...] | [["wrist", point], ...]
    {"0": point, ...} | {"thumb": [point x 4], ...}
    {"x": [...], "y": [...], "z": [...]} and more of `axis_lists`

A point is [x, y, z], {"x", "y", "z"}, either of them under "position" (itself under "transform"
or "pose"), or the 16 numbers of a matrix, by rows or by columns; null is a missing joint.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS, ORDER_JOINTS
from handtrack.sequences.names import CONFIDENCES, UNUSED, joint_name, words
from handtrack.sequences.readers.axis_lists import axis_keys, sure_of
from handtrack.sequences.readers.raw import Array
from handtrack.sequences.settled import settle
from handtrack.sequences.short_names import spelt_out
from handtrack.sequences.titles import few, nearest

COUNTS = frozenset(ORDER_JOINTS.values())
_FLAT = {3 * n: n for n in COUNTS}
INSIDE = ("transform", "pose", "to_global", "global", "world", "location", "value")
POSITION = ("position", "pos", "translation", "point", "xyz", "coordinates", "origin", "location")
_HOLDERS = frozenset((*POSITION, *INSIDE))
NAMES: tuple[str, ...] = (
    "name",
    "joint",
    "jointName",
    "joint_name",
    "bone",
    "bone_name",
    "boneName",
    "part",
)
NAMES += ("id", "index", "landmark", "label", "keypoint", "type")
AXES = (("x", "y", "z"), ("X", "Y", "Z"), ("px", "py", "pz"))
_META = {"unit", "units", "order", "source", "device", "version", "space", "frame", "type"}


class Points(NamedTuple):
    """One hand's joints.

    Attributes:
        joints: (N, 3), NaN = missing.
        confidence: (N,) or None.
        named: whether they are ours by name; else in the source's order.
    """

    joints: Array
    confidence: Array | None
    named: bool


def are_points(value: Any) -> bool:
    """Whether a JSON value could be the joints of a hand in one frame."""
    if isinstance(value, list):
        some = value[0] if value else None
        if some is None:
            some = next((v for v in value if v is not None), None)
        if len(value) in _FLAT and isinstance(some, int | float):
            return True
        if isinstance(some, dict):
            return _is_point(some)
        if _is_pair(some):
            return all(v is None or _is_pair(v) for v in value)
        return isinstance(some, list) and len(value) in COUNTS and len(some) in (3, 4, 16)
    if isinstance(value, dict):
        return axis_keys(value) is not None or _names_in(value) is not None
    return False


def read_points(value: Any, place: str, path: Path) -> Points:
    """One frame of one hand.

    Raises:
        InputError: no joints, a point that is none, or a name that is not known.
    """
    if isinstance(value, dict):
        keys = axis_keys(value)
        if keys is not None:
            columns = [_numbers(value[k], f"{place}: {k}", path) for k in keys]
            if len({len(c) for c in columns}) != 1:
                raise InputError(f"{place}: {', '.join(keys)} are of different length", path)
            sure = sure_of(value, len(columns[0]))
            confidence = None if sure is None else _numbers(sure, f"{place}: confidence", path)
            return Points(np.stack(columns, axis=1), confidence, False)
        return _named({str(k): v for k, v in _without_fingers(value).items()}, place, path)
    if not isinstance(value, list):
        raise InputError(f"{place}: a hand is neither an object nor a list of joints", path)
    if len(value) in _FLAT and all(isinstance(v, int | float) or v is None for v in value):
        return Points(np.array(value, dtype=np.float64).reshape(-1, 3), None, False)
    some = next((v for v in value if v is not None), None)
    if _is_pair(some):
        by_name = {v[0]: v[1] if len(v) == 2 else v[1:] for v in value if _is_pair(v)}
        return _named(by_name, place, path)
    key = next((k for k in NAMES if isinstance(some, dict) and k in some), None)
    if key is not None and isinstance(some, dict) and isinstance(some[key], str):
        pairs = [v for v in value if isinstance(v, dict)]
        return _named({str(v.get(key)): v for v in pairs}, place, path)
    if isinstance(some, dict) and key is not None:
        # numbered points stand in the order of their numbers
        numbers = [v.get(key) if isinstance(v, dict) else None for v in value]
        for begin in (0, 1):
            if sorted(map(str, numbers)) == sorted(map(str, range(begin, begin + len(value)))):
                value = [value[numbers.index(i)] for i in range(begin, begin + len(value))]
                break
    return _list(value, place, path)


def _is_pair(value: Any) -> bool:
    """Whether a list is a name and its point."""
    return isinstance(value, list) and len(value) in (2, 4) and isinstance(value[0], str)


def has_names(frame: Any) -> bool:
    """Whether joints in a list are objects, or a name and a place each."""
    first = frame[0] if isinstance(frame, list) and frame else None
    return isinstance(first, dict) or _is_pair(first)


def _list(value: list[Any], place: str, path: Path) -> Points:
    try:  # the usual case, all at once
        array = np.array([(p["x"], p["y"], p["z"]) for p in value], dtype=np.float64)
    except (TypeError, KeyError, ValueError):
        array = np.array(
            [_point(p, f"{place}: joint {i}", path) for i, p in enumerate(value)]
        ).reshape(-1, 3)
    return Points(array, _confidences(value), False)


def _confidences(points: Iterable[Any]) -> Array | None:
    """How sure each point is, where points say it themselves."""
    given = list(points)
    some = next((p for p in given if isinstance(p, dict)), None)
    if some is None:
        four = [p for p in given if isinstance(p, list) and len(p) == 4]
        return np.array([p[3] for p in four], float) if len(four) == len(given) and given else None
    keys = [k for k in some if k.lower() in CONFIDENCES and k != "presence"]
    if not keys:
        return None
    values = [p.get(keys[0]) if isinstance(p, dict) else 0.0 for p in given]
    return np.array([1.0 if v is None else float(v) for v in values])


def _named(value: dict[str, Any], place: str, path: Path) -> Points:
    plan = plan_of(tuple(value))
    if plan.numbered:
        said = {k: _number(k) for k in value}
        numbers = {n: value[k] for k, n in said.items() if n is not None}
        begin = 0 if 0 in numbers else 1
        n = N_JOINTS if max(numbers) < N_JOINTS + begin else max(numbers) + 1 - begin
        if n not in COUNTS:
            raise InputError(f"{place}: joints are numbered to {max(numbers)}", path)
        return _list([numbers.get(i + begin) for i in range(n)], place, path)
    joints, confidence = np.full((N_JOINTS, 3), np.nan), np.ones(N_JOINTS)
    if plan.simple:
        try:  # the usual case, all at once
            places = np.array([value[k] for k in plan.keys], dtype=np.float64)
        except (OverflowError, TypeError, ValueError):
            places = joints[:0]
        if places.shape == (len(plan.keys), 3):
            joints[list(plan.places)] = places
            return Points(joints, None, True)
    any_sure = False
    for (name, point), joint in zip(value.items(), plan.joints, strict=True):
        if joint is None:
            if name.lower() not in _META and _looks_placed(point):
                raise InputError(
                    f"{place}: joint {name[:40]!r} is unknown, the nearest name is {nearest(name)};"
                    f" understood are {few(plan.keys) or 'none'}",
                    path,
                )
            continue
        if joint == UNUSED or point is None:
            continue
        if np.isfinite(joints[joint]).any():
            raise InputError(f"{place}: two joints are {JOINT_NAMES[joint]}", path)
        joints[joint] = _point(point, f"{place}: {name}", path)
        sure = _confidences([point]) if isinstance(point, dict) else None
        if sure is not None:
            confidence[joint], any_sure = sure[0], True
    return Points(joints, confidence if any_sure else None, True)


class _Plan(NamedTuple):
    """Which joint each key is; None: none.

    Keys and places are of the 21 alone, `known` are so many; it is simple where every key is
    known and none twice.
    """

    joints: tuple[int | None, ...]
    numbered: bool
    keys: tuple[str, ...] = ()
    places: tuple[int, ...] = ()
    simple: bool = False
    known: int = 0


@lru_cache(maxsize=256)
def plan_of(keys: tuple[str, ...]) -> _Plan:
    if sum(_number(k) is not None for k in keys) > len(keys) / 2:
        return _Plan((), True)
    said = [joint_name(words(k)) for k in spelt_out(keys)]
    known = [s for s in said if s is not None]
    settled = iter(settle(known))
    joints = tuple(None if s is None else next(settled) for s in said)
    ours = [(k, j) for k, j in zip(keys, joints, strict=True) if j is not None and j != UNUSED]
    places = tuple(j for _, j in ours)
    simple = None not in joints and len(set(places)) == len(places) > 0
    return _Plan(joints, False, tuple(k for k, _ in ours), places, simple, len(ours))


def _number(key: str) -> int | None:
    """The joint's number that a name such as "7", "joint7" or "landmark_07" is."""
    if key.isdecimal():
        return int(key) if len(key) < 4 else None
    said = joint_name(words(key)) if key and key[-1].isdecimal() else None
    return None if said is None or said.finger is not None else said.number


def _names_in(value: dict[str, Any]) -> int | None:
    """How many keys of an object are joints with a place; None: none."""
    keys = tuple(map(str, value))
    plan = plan_of(keys)
    n = len(keys) if plan.numbered else plan.known
    if n == 0:
        return None
    if plan.numbered:
        return n if any(_looks_placed(v) for v in value.values()) else None
    ours = (value[k] for k in plan.keys if k in value)
    return n if any(_looks_placed(v) or _is_finger(v) for v in ours) else None


def _without_fingers(value: dict[str, Any]) -> dict[str, Any]:
    """{"thumb": [point x 4]} or {"thumb": {"cmc": point}} as names of single joints."""
    if plan_of(tuple(value)).simple and len(value) > 15:
        return value
    if not any(_is_finger(v) for v in value.values()):
        return value
    out: dict[str, Any] = {}
    for name, inner in value.items():
        if isinstance(inner, list) and _is_finger(inner):
            if len(inner) == 1:
                out[name] = inner[0]
            else:
                out |= {f"{name} {i + 5 - len(inner)}": point for i, point in enumerate(inner)}
        elif isinstance(inner, dict) and _is_finger(inner):
            out |= {f"{name} {part}": point for part, point in inner.items()}
        else:
            out[name] = inner
    return out


def _is_finger(value: Any) -> bool:
    if isinstance(value, list):
        seen = [v for v in value if v is not None and v not in ([], {})]
        return 1 <= len(value) <= 5 and bool(seen) and all(_looks_placed(v) for v in seen)
    if not isinstance(value, dict) or _is_point(value):
        return False
    return bool(value) and all(v is None or _looks_placed(v) for v in value.values())


def _is_point(value: dict[str, Any]) -> bool:
    if "x" in value and "y" in value and "z" in value:
        return not isinstance(value["x"], list)
    if not _HOLDERS.isdisjoint(value):  # a frame may have all its joints under such a name
        return not all(_are_many(value[k]) for k in _HOLDERS & value.keys())
    axes = next((keys for keys in AXES if all(k in value for k in keys)), None)
    return axes is not None and not isinstance(value[axes[0]], list)


def _are_many(value: Any) -> bool:
    """Whether there are as many places or more as a hand has joints."""
    return isinstance(value, list) and len(value) >= min(COUNTS) and are_points(value)


def _looks_placed(point: Any) -> bool:
    if isinstance(point, dict):
        return _is_point(point)
    return (
        isinstance(point, list)
        and len(point) in (3, 4, 16)
        and all(v is None or isinstance(v, int | float) for v in point)
    )


def _point(given: Any, where: str, path: Path) -> Array:
    value = given
    for _ in range(3):
        if not isinstance(value, dict):
            break
        key = next((k for k in (*INSIDE, *POSITION) if k in value), None)
        if key is None:
            break
        value = value[key]
    if isinstance(value, dict):
        point: dict[str, Any] = value
        axes = next((keys for keys in AXES if all(k in point for k in keys)), None)
        value = [point[k] for k in axes] if axes else (value or None)
    if value is None or value == []:
        return np.full(3, np.nan)
    try:
        numbers = np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        numbers = np.zeros(0)
    if numbers.shape in ((16,), (4, 4)):
        rows = numbers.reshape(4, 4)  # the place is its last row or its last column
        return rows[3, :3] if rows[3, :3].any() else rows[:3, 3]
    if numbers.shape == (4,):
        return numbers[:3]
    if numbers.shape != (3,):
        raise InputError(f"{where} is no position, expected [x, y, z]", path)
    return numbers


def _numbers(value: Any, where: str, path: Path) -> Array:
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.zeros((0, 0))
    if array.ndim != 1:
        raise InputError(f"{where} is not a list of numbers", path)
    return array
