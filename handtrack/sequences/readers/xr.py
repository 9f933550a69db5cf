"""Reader of WebXR and OpenXR joint streams: JSON lines (or a list) of frames with named joints.

A frame is one hand, or several:

    {"time_ms": 12.5, "handedness": "left", "joints": {"wrist": [x, y, z], "thumb-tip": ...}}
    {"timestamp": 12.5, "left": {"wrist": ...} or null, "right": {...}}
    {"timestamp": 12.5, "hands": [{"handedness": "left", "joints": ...}]}

Joints have the names of the WebXR Hand Input Module ("index-finger-phalanx-proximal"), of OpenXR
(XR_HAND_JOINT_INDEX_PROXIMAL_EXT) or of engines (IndexProximal), or stand in a list of 25 (WebXR)
or 26 (OpenXR). A joint is [x, y, z], {"x", "y", "z"}, either of them under "position" (itself
under "transform" or "pose"), or the 16 numbers of a column-major matrix. m.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import FINGERS, HANDS, N_JOINTS, ORDERS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.fields import TIME_KEYS
from handtrack.sequences.readers.raw import Array, Raw, as_hand, stem

_CAPITAL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_NOISE = re.compile(r"^xr-hand-joint-|-ext$|-finger|-phalanx|phalanx-")
_LABELS = ("handedness", "hand", "side")
_LISTS = {25: "webxr", 26: "openxr"}
_BASES = ("metacarpal", "proximal", "distal", "tip")
_PARTS = ("proximal", "intermediate", "distal", "tip")

NAMES: dict[str, int] = {"wrist": 0} | {
    f"{finger}-{part}": 1 + 4 * f + i
    for f, finger in enumerate(FINGERS)
    for i, part in enumerate(_BASES if finger == "thumb" else _PARTS)
}
"""Our joint of each name that is left when a source's own additions are taken away."""
_UNUSED = {"palm", *(f"{finger}-metacarpal" for finger in FINGERS[1:])}


def plain_name(name: str) -> str:
    """ "index-finger-phalanx-proximal", "XR_HAND_JOINT_INDEX_PROXIMAL_EXT", "IndexProximal" as
    "index-proximal"."""
    text = _CAPITAL.sub("-", name).replace("_", "-").replace(" ", "-").lower()
    return _NOISE.sub("", text).replace("pinky", "little")


def is_frame(value: Any) -> bool:
    """Whether a JSON value is a frame of this kind, and not of plain joints."""
    if not isinstance(value, dict):
        return False
    return any(_named(joints) or label for label, joints in _hands(value))


def read_frames(values: list[Any], places: list[str], path: Path) -> list[Raw]:
    """The sequences of frames, one per hand.

    Args:
        values: decoded frames; null = nothing seen.
        places: where each stands, for messages ("line 3").
        path: the file.

    Raises:
        InputError: a frame or a joint that cannot be read, or no hand at all.
    """
    seen: dict[Hand | None, list[int]] = {}
    found: list[dict[Hand | None, Array]] = []
    for i, (value, place) in enumerate(zip(values, places, strict=True)):
        hands: dict[Hand | None, Array] = {}
        if value is not None and not isinstance(value, dict):
            raise InputError(f"{place} is not an object, expected a frame", path)
        for label, joints in _hands(value or {}):
            hand = None if label is None else as_hand(label, path, f"{place}: hand")
            if hand in hands:
                raise InputError(f"{place}: two {hand or 'unnamed'} hands", path)
            hands[hand] = _joints(joints, place, path)
            seen.setdefault(hand, []).append(i)
        found.append(hands)
    if not seen:
        raise InputError("no hand in any frame, expected named joints", path)
    stamps = _stamps(values, places)
    raws = []
    for hand in sorted(seen, key=lambda h: h or ""):
        # a file of one hand a line: the other's lines are not its frames
        rows = seen[hand] if all(len(hands) <= 1 for hands in found) else range(len(values))
        blank = np.full((N_JOINTS, 3), np.nan)
        raw = Raw(
            np.stack([found[i].get(hand, blank) for i in rows]),
            path,
            stem(path),
            hand=hand,
            unit="m",
        )
        if stamps is not None:
            raw.stamps = stamps.take(rows)
        raws.append(raw)
    return raws


def _hands(frame: dict[str, Any]) -> list[tuple[Any, Any]]:
    """(label or None, joints) of each hand in a frame."""
    several = frame.get("hands", frame)
    if isinstance(several, list):
        return [pair for one in several if isinstance(one, dict) for pair in _hands(one)]
    if isinstance(several, dict) and any(side in several for side in HANDS):
        sides = [(side, several[side]) for side in HANDS if several.get(side) is not None]
        return [(side, _inside(one)) for side, one in sides]
    label = next((frame[k] for k in _LABELS if isinstance(frame.get(k), str)), None)
    joints = _inside(frame)
    return [(label, joints)] if _named(joints) or _list_of_joints(joints) else []


def _inside(one: Any) -> Any:
    return one["joints"] if isinstance(one, dict) and one.get("joints") is not None else one


def _named(joints: Any) -> bool:
    return isinstance(joints, dict) and any(plain_name(name) in NAMES for name in joints)


def _list_of_joints(joints: Any) -> bool:
    return isinstance(joints, list) and len(joints) in _LISTS


def _joints(given: Any, place: str, path: Path) -> Array:
    """(21, 3) of one hand."""
    if isinstance(given, list):
        if len(given) not in _LISTS:
            raise InputError(f"{place}: {len(given)} joints, expected 25 or 26", path)
        all_of_them = np.array(
            [_point(p, f"{place}: joint {i}", path) for i, p in enumerate(given)]
        )
        return np.asarray(all_of_them[list(ORDERS[_LISTS[len(given)]])])
    out = np.full((N_JOINTS, 3), np.nan)
    if not isinstance(given, dict):
        raise InputError(f"{place}: a hand is neither an object nor a list of joints", path)
    for name, point in given.items():
        plain = plain_name(name)
        if plain in NAMES:
            out[NAMES[plain]] = _point(point, f"{place}: {name}", path)
        elif plain not in _UNUSED and isinstance(point, dict | list) and _looks_placed(point):
            raise InputError(f"{place}: joint {name!r} is unknown", path)
    return out


def _looks_placed(point: Any) -> bool:
    return "position" in point if isinstance(point, dict) else len(point) in (3, 16)


def _point(given: Any, where: str, path: Path) -> Array:
    value = given
    for key in ("transform", "pose", "position"):
        if isinstance(value, dict) and key in value:
            value = value[key]
    if isinstance(value, dict) and {"x", "y", "z"} <= set(value):
        value = [value["x"], value["y"], value["z"]]
    if value is None:
        return np.full(3, np.nan)
    try:
        numbers = np.array(value, dtype=np.float64)
    except (ValueError, TypeError):
        numbers = np.zeros(0)
    if numbers.shape == (16,):
        return numbers[12:15]
    if numbers.shape != (3,):
        raise InputError(f"{where} is no position, expected [x, y, z]", path)
    return numbers


def _stamps(values: list[Any], places: list[str]) -> Stamps | None:
    """Times as the frames have them; None where none has any."""
    frames = [v if isinstance(v, dict) else {} for v in values]
    stated = {key: unit for key, unit in TIME_KEYS.items() if unit is not None}
    stated |= {key.replace("time", "timestamp"): unit for key, unit in stated.items()}
    for key in (*stated, "time", "timestamp", "t"):
        column = [frame.get(key) for frame in frames]
        if any(value is not None for value in column):
            return Stamps(column, key, stated.get(key), places)
    return None
