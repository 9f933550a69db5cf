"""Frames of an object under their numbers or times."""

from __future__ import annotations

import re
from typing import Any

from handtrack.sequences.readers.found import hands_in
from handtrack.sequences.readers.points import are_points

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
