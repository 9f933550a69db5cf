"""Landmarks in the picture that stand beside those in the world, as in MediaPipe's results."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import replace
from typing import Any

from handtrack.sequences.readers.fields import size_of
from handtrack.sequences.readers.raw import Raw, Shown
from handtrack.sequences.titles import joints_key

_DEEPEST = 6


def without_world(value: Any, depth: int = 0) -> Any:
    """The same without the joints that are called those in the world: what stands beside them is
    in the picture."""
    if isinstance(value, list) and depth <= _DEEPEST:
        inside = isinstance(next((v for v in value if v is not None), None), dict | list)
        return [without_world(v, depth + 1) for v in value] if inside else value
    if not isinstance(value, dict) or depth > _DEEPEST:
        return value
    return {k: without_world(v, depth + 1) for k, v in value.items() if not _is_world(str(k))}


def _is_world(key: str) -> bool:
    said = joints_key(key)
    return said is not None and said.world


def with_pictures(
    raws: list[Raw], shown: list[Raw], values: Items[Any], about: dict[str, Any] | None
) -> list[Raw]:
    """Hands with what the picture shows of them, where that stands beside them.

    Args:
        raws: joints in the world.
        shown: of the same records, what is left without these.
        values: records, of which the first may say how large the pictures are.
        about: what the file says of all of them.
    """
    first = next((v for v in values if isinstance(v, dict) and v), {})
    size = size_of({**(about or {}), **first}, raws[0].path)
    by_hand = {(raw.hand, raw.name): raw.joints for raw in shown}
    out = []
    for raw in raws:
        points = by_hand.get((raw.hand, raw.name))
        if raw.detector and points is not None and points.shape == raw.joints.shape:
            raw = replace(raw, shown=Shown(points[..., :2], size))
        out.append(raw)
    return out
