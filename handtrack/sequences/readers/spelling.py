"""Names of JSON in capital letters, as C# and others write them, as the readers know them."""

from __future__ import annotations

from typing import Any

from handtrack.sequences.readers.fields import RATES, UNIT_KEYS
from handtrack.sequences.readers.found import CONTAINERS, JOINTS_TOO, TEXTS, TRACKED
from handtrack.sequences.readers.points import INSIDE, NAMES, POSITION

ABOUT = ("info", "meta", "metadata", "header", "config", "settings")
"""Names under which an object says what holds for all of its frames."""
LISTS = ("frames", "records", "samples", "data", "recording", "sequence", "messages", "poses")
"""Names under which an object holds frames."""
_KNOWN: dict[str, str] = {
    name.lower(): name
    for name in (
        *(*ABOUT, *LISTS, *CONTAINERS, *JOINTS_TOO, *TEXTS, *TRACKED),
        *(*INSIDE, *POSITION, *NAMES, *RATES, *UNIT_KEYS),
        *("joints", "bones", "landmarks", "keypoints", "order", "subject", "columns"),
    )
}
_LOOKED_INTO, _DEEPEST = 4, 12


def in_small_letters(value: Any) -> Any:
    """The same value with the names that readers look for as they know them ("Joints", "NAME" as
    "joints", "name"); itself where it has none in other letters."""
    return _changed(value, 0) if _any_in(value, 0) else value


def _any_in(value: Any, depth: int) -> bool:
    """Whether there are such names, told from the first of each list."""
    if depth > _DEEPEST:
        return False
    if isinstance(value, list):
        some = [v for v in value[:100] if isinstance(v, dict | list) and v][:_LOOKED_INTO]
        return any(_any_in(v, depth + 1) for v in some)
    if not isinstance(value, dict):
        return False
    if any(_known(key) != key for key in value):
        return True
    inner = [v for v in value.values() if isinstance(v, dict | list) and v]
    return any(_any_in(v, depth + 1) for v in inner[: 8 * _LOOKED_INTO])


def _known(key: Any) -> Any:
    # a name in small letters is as it is meant, in camel case too
    if not isinstance(key, str) or not key[:1].isupper():
        return key
    return _KNOWN.get(key.lower(), key)


def _changed(value: Any, depth: int) -> Any:
    if depth > _DEEPEST:
        return value
    if isinstance(value, list):
        if value and isinstance(value[0], int | float):
            return value
        return [_changed(v, depth + 1) if isinstance(v, dict | list) else v for v in value]
    if not isinstance(value, dict):
        return value
    out: dict[Any, Any] = {}
    for key, inner in value.items():
        known = _known(key)
        if known != key and known in value:
            known = key
        out[known] = _changed(inner, depth + 1) if isinstance(inner, dict | list) else inner
    return out
