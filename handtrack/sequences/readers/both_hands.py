"""Fields of both hands in one source: names that begin with a hand, a hand's name for each frame,
or frames of two hands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import HANDS, Hand
from handtrack.sequences.names import as_side
from handtrack.sequences.readers.axis_lists import column_keys
from handtrack.sequences.readers.fields import joint_columns, names_joints
from handtrack.sequences.readers.joint_frames import PAIRS
from handtrack.sequences.readers.pictures import seen_in_picture
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.titles import is_hand_label, of_side, side_key

_IS = {"isright": ("left", "right"), "isleft": ("right", "left")}
"""Hands by 0 and 1 under such a name."""


def of_sides(fields: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The fields of each hand (`left_joints_m`, or all that stands under `left`) with those of
    both; all of them where no hand has joints of its own."""
    parts = [own for hand in HANDS if (own := _of_side(fields, hand)) is not None]
    return parts or [dict(fields)]


def _of_side(fields: Mapping[str, Any], hand: Hand) -> dict[str, Any] | None:
    own: dict[str, Any] = {}
    both: dict[str, Any] = {}
    for key, value in fields.items():
        side, rest = of_side(key)
        if side is None:
            both[key] = value
        elif side != hand or value is None:
            continue
        elif side_key(key) is not None:
            own |= value if isinstance(value, dict) else {"joints": value}
        else:
            own[rest.replace(" ", "_")] = value
    if not any(names_joints(key) for key in own) and not (joint_columns(own) or column_keys(own)):
        return None
    return both | own | {"hand": hand}


def by_frame(fields: Mapping[str, Any], path: Path) -> list[dict[str, Any]]:
    """The fields of each hand where an array names a hand for each frame; else all of them.

    Raises:
        InputError: a name that is neither left nor right.
    """
    key = next((k for k, v in fields.items() if _names_frames(k, v)), None)
    if key is None:
        return [dict(fields)]
    values = np.asarray(fields[key])
    words = _IS.get(_bare(key))
    sides = [as_side(v) if words is None else words[int(v)] for v in values.tolist()]
    if None in sides:
        i = sides.index(None)
        raise InputError(f"{key}[{i}] is {str(values[i])[:40]!r}, expected left or right", path)
    rest = {k: v for k, v in fields.items() if k != key}
    out = []
    for hand in dict.fromkeys(sides):
        rows = np.array([side == hand for side in sides])
        own = {k: v[rows] if _has_rows(v, len(rows)) else v for k, v in rest.items()}
        out.append(own | {"hand": hand})
    return out


def _bare(key: str) -> str:
    return key.lower().replace("_", "").removesuffix("hand")


def _names_frames(key: str, value: Any) -> bool:
    if not isinstance(value, np.ndarray) or value.ndim != 1 or len(value) < 3:
        return False
    if _bare(key) in _IS:
        return value.dtype.kind in "biuf" and bool(np.isin(value, (0, 1)).all())
    return is_hand_label(key) and value.dtype.kind in "US"


def _has_rows(value: Any, n: int) -> bool:
    return isinstance(value, np.ndarray) and value.ndim > 0 and len(value) == n


def two_hands(raw: Raw) -> list[Raw]:
    """One hand, or two that stand one behind the other in each frame; of places in a picture
    marked so, unless the source calls them MediaPipe's of the world."""
    return [
        part if part.detector or part.shown is not None else seen_in_picture(part)
        for part in _apart(raw)
    ]


def _apart(raw: Raw) -> list[Raw]:
    n = raw.joints.shape[1]
    if n not in PAIRS:
        return [raw]
    half = n // 2
    note = f"{n} joints in a frame: two hands of {half}, one behind the other"
    parts = []
    for k, part in ((1, slice(0, half)), (2, slice(half, n))):
        confidence = raw.confidence
        if confidence is not None and confidence.ndim == 2:
            confidence = confidence[:, part]
        parts.append(
            replace(
                raw,
                joints=raw.joints[:, part],
                confidence=confidence,
                truth=None if raw.truth is None else raw.truth[:, part],
                shown=None,
                name=f"{raw.name} hand {k}",
                notes=(*raw.notes, note) if k == 1 else (),
            )
        )
    return parts
