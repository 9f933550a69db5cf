"""Fields of both hands in one source: names that begin with a hand, or frames of two hands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from handtrack.hand.skeleton import HANDS, Hand
from handtrack.sequences.readers.fields import PAIRS, joint_columns, names_joints
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.titles import of_side, side_key


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
    if not any(names_joints(key) for key in own) and not joint_columns(own):
        return None
    return both | own | {"hand": hand}


def two_hands(raw: Raw) -> list[Raw]:
    """One hand, or two that stand one behind the other in each frame."""
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
                name=f"{raw.name} hand {k}",
                notes=(*raw.notes, note) if k == 1 else (),
            )
        )
    return parts
