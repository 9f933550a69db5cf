"""Frames of Ultraleap's newer service (LeapC), as its users write them in JSON: hands of five
digits of four bones, each from `prev_joint` to `next_joint`.

    {"timestamp": us, "hands": [{"type": "Right", "digits": [{"bones": [{"prev_joint": {x, y, z},
     "next_joint": ...} x 4]} x 5] or "thumb": {"metacarpal": {...}, ...}, "arm": {"next_joint"}}]}

A digit's joints are the ends of its bones; the thumb's metacarpal has no length. Millimetres, or
whichever unit makes a hand.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import FINGERS, N_JOINTS
from handtrack.sequences.readers.raw import Array, Raw
from handtrack.sequences.readers.records import read_records
from handtrack.sequences.size import fitting_unit

_BONES = ("metacarpal", "proximal", "intermediate", "distal")
_ENDS = (("prev_joint", "next_joint"), ("prevJoint", "nextJoint"), ("PrevJoint", "NextJoint"))
_LISTS = ("digits", "fingers", "Fingers")
_LOOK = 1000


def is_frame(value: Any) -> bool:
    """Whether a record is one of its frames, with a hand in it."""
    hands = _hands(value)
    return bool(hands) and isinstance(hands[0], dict) and _ends(_bones(hands[0], 1)) is not None


def any_in(values: Items[Any]) -> bool:
    """Whether the first frames with a hand in them are its."""
    some = next((v for v in values[:_LOOK] if _hands(v)), None)
    return some is not None and is_frame(some)


def read_frames(
    values: Items[Any], places: Items[str], path: Path, about: dict[str, Any] | None = None
) -> list[Raw]:
    """The hands of its frames.

    Raises:
        InputError: a bone that is none.
    """
    raws = read_records(as_records(values, places, path), places, path, about)
    return with_unit(raws)


def with_unit(raws: list[Raw]) -> list[Raw]:
    """The same in the unit that makes a hand."""
    for raw in raws:
        raw.unit = raw.unit or fitting_unit(raw.joints) or "mm"
    return raws


def as_records(values: Items[Any], places: Items[str], path: Path) -> list[Any]:
    """Its frames as other JSON has them, hands of 21 joints.

    Raises:
        InputError: a bone that is none.
    """
    frames: list[Any] = []
    for i, value in enumerate(values):
        hands = _hands(value)
        rest = {k: v for k, v in value.items() if k.lower() != "hands"} if hands else {}
        if isinstance(value, dict) and not hands:
            rest = {k: v for k, v in value.items() if k.lower() != "hands"}
        own = [_hand(h, f"{places[i]}: a hand", path) for h in hands]
        frames.append({**rest, "hands": own})
    return frames


def _hands(value: Any) -> list[Any]:
    if not isinstance(value, dict):
        return []
    hands = value.get("hands", value.get("Hands"))
    return hands if isinstance(hands, list) else []


def _bones(hand: dict[str, Any], finger: int) -> list[Any]:
    """The bones of one finger, from the palm on."""
    digits = next((hand[k] for k in _LISTS if isinstance(hand.get(k), list)), None)
    if digits is not None:
        digit = digits[finger] if finger < len(digits) else None
    else:
        names = (FINGERS[finger], "pinky" if finger == 4 else FINGERS[finger])
        digit = next((hand[n] for n in names if n in hand), None)
    if not isinstance(digit, dict):
        return []
    listed = digit.get("bones", digit.get("Bones"))
    if isinstance(listed, list):
        return listed
    return [digit[b] for b in _BONES if b in digit]


def _ends(bones: list[Any]) -> tuple[str, str] | None:
    """What the two ends of bones are called; None where they are no bones."""
    if len(bones) != 4 or not all(isinstance(b, dict) for b in bones):
        return None
    return next((e for e in _ENDS if all(k in b for b in bones for k in e)), None)


def _hand(hand: Any, where: str, path: Path) -> dict[str, Any]:
    """One hand as a record of 21 joints."""
    if not isinstance(hand, dict):
        raise InputError(f"{where} is no object", path)
    joints = np.full((N_JOINTS, 3), np.nan)
    for f in range(5):
        bones = _bones(hand, f)
        ends = _ends(bones)
        if ends is None:
            continue
        for k, bone in enumerate(bones[1:]):
            joints[1 + 4 * f + k] = _place(bone[ends[0]], where, path)
        joints[4 + 4 * f] = _place(bones[3][ends[1]], where, path)
    arm = hand.get("arm", hand.get("Arm"))
    wrist = next((arm[n] for _, n in _ENDS if n in arm), None) if isinstance(arm, dict) else None
    wrist = hand.get("wrist", hand.get("WristPosition", wrist))
    if wrist is not None:
        joints[0] = _place(wrist, where, path)
    kinds = (hand.get(k) for k in ("type", "handedness", "chirality", "hand_type"))
    label: Any = next((k for k in kinds if k is not None), None)
    if label is None and isinstance(hand.get("IsLeft"), bool):
        label = "left" if hand["IsLeft"] else "right"
    listed = [None if np.isnan(p).any() else p.tolist() for p in joints]
    return {"handedness": label, "joints": listed, "confidence": hand.get("confidence")}


def _place(given: Any, where: str, path: Path) -> Array:
    if isinstance(given, dict):
        given = [given.get("x"), given.get("y"), given.get("z")]
    try:
        place = np.array(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        place = np.zeros(0)
    if place.shape != (3,):
        raise InputError(f"{where}: the end of a bone is no place", path)
    return place
